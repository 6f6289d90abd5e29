/* Pixels of several points at a time: bit for bit those of fovea_camera_project. */
#ifndef FOVEA_GEOMETRY_PROJECT_H
#define FOVEA_GEOMETRY_PROJECT_H

#include <stdbool.h>

#include "fovea/camera.h"
#include "geometry/pair.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_PROJECT_PAIRS = 4 };

/* A point of the plane at distance 1 as a radial-tangential lens places it, by r2 = x x + y y and
 * the radial factor there: the operations of camera.c in their order. */
static inline void fv_pair_place(const double *k, fv_pair x, fv_pair y, fv_pair r2, fv_pair scale,
                                 fv_pair out[2])
{
    const double p1 = k[2], p2 = k[3];
    out[0] = x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    out[1] = y * scale + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
}

/* A camera made ready, which costs a tangent. */
struct fv_project {
    struct fovea_camera camera;
    double radius2_max; /* radial-tangential: of the plane at distance 1 */
    bool rational;
};

struct fv_project fv_project_of(const struct fovea_camera *camera);

/* Pixels of points of the camera's frame, given as x, y and z of all; `seen` is false where
 * fovea_camera_project refuses a point, and its pixel is undefined. Radial-tangential lenses are
 * done side by side. Real-time safe. */
void fv_project_points(const struct fv_project *project, fv_pair points[3][FV_PROJECT_PAIRS],
                       fv_pair pixels[2][FV_PROJECT_PAIRS], fv_flags seen[FV_PROJECT_PAIRS]);

#ifdef __cplusplus
}
#endif
#endif
