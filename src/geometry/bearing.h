/* Bearings of key points: a coarse table of the camera's inverse, made exact by one Newton step per
 * point.
 *
 * Unprojecting a thousand key points by iteration costs more than finding them. The table holds the
 * unit bearing at every FV_BEARING_STEP_PX-th pixel; a key point takes the bilinear blend (off by
 * less than 0.1 px for usual lenses) and one Gauss-Newton step on the sphere with the exact model,
 * which squares that error away: what is left is at most 2e-5 px for EuRoC's camera, less than the
 * rounding of a key point's own float coordinates; in the last tenth of a folding lens's field,
 * where distortion has next to no derivative, up to 0.05 px. The step's Jacobian is what
 * optimisation needs anyway. */
#ifndef FOVEA_GEOMETRY_BEARING_H
#define FOVEA_GEOMETRY_BEARING_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/camera.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_BEARING_STEP_PX = 8 };

struct fv_bearing_node {
    float bearing[3]; /* unit; not numbers where the model refuses the pixel */
};

struct fv_bearing_table {
    int32_t columns, rows;
    struct fv_bearing_node *nodes;
};

/* Take the table of a camera of width x height pixels. Sets sizes and addresses only. Init-only. */
void fv_bearing_carve(struct fv_bearing_table *table, int32_t width, int32_t height,
                      struct fv_arena *persistent);

/* Fill it. Init-only: a few milliseconds. */
void fv_bearing_init(struct fv_bearing_table *table, const struct fovea_camera *camera);

/* Bearing of a pixel, and A = d(pixel)/d(point) at it (2x3 row-major, A b = 0). False: the model
 * has no bearing there; outputs untouched. Real-time safe. */
bool fv_bearing_of(const struct fv_bearing_table *table, const struct fovea_camera *camera,
                   double x_px, double y_px, double bearing[3], double A[6]);

/* What fv_bearing_of gives for one pixel. */
struct fv_ray {
    double bearing[3]; /* unit, camera frame */
    double A[6];       /* d(pixel)/d(point), 2x3 row-major */
    bool seen; /* false: the model has no bearing there, and the other members are undefined */
};

/* Rays of `count` pixels (x, y), each bit for bit that of fv_bearing_of. Radial-tangential lenses
 * are done two points at a time, in about half the time. Real-time safe. */
void fv_bearings_of(const struct fv_bearing_table *table, const struct fovea_camera *camera,
                    const float (*pixels)[2], uint32_t count, struct fv_ray *rays);

#ifdef __cplusplus
}
#endif
#endif
