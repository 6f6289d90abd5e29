/* A point from two bearings. Real-time safe, any thread. */
#ifndef FOVEA_GEOMETRY_TRIANGULATE_H
#define FOVEA_GEOMETRY_TRIANGULATE_H

#include <stdbool.h>

#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The point in the frame of camera 1 on the shortest segment between the two rays, placed so that
 * the angular errors of both bearings have the smallest sum of squares, and the cosine of the angle
 * between the rays. False when the rays diverge, or are parallel to 1e-6 rad; outputs are then
 * untouched. */
bool fv_triangulate(const struct fv_se3 *T_2_1, const double x1[3], const double x2[3],
                    double point[3], double *cos_parallax);

#ifdef __cplusplus
}
#endif
#endif
