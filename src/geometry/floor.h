/* The floor under a camera: the lowest large plane among points below it, by robust sampling.
 *
 * Points are in the camera's frame, the plane is {p : down p = height} with the unit vector `down`
 * and height > 0. Hypotheses come by turns from three points, and from one point with the expected
 * direction; the best is refined by weighted least squares, with the expected direction as a prior.
 * The score is that of MSAC (P. Torr and A. Zisserman, CVIU 2000) on relative heights, less what
 * lies under the plane: a floor has nothing below it, a table top has. Every point has its own
 * uncertainty, since triangulated points err along their rays. Real-time safe: bounded by count and
 * samples; no heap. */
#ifndef FOVEA_GEOMETRY_FLOOR_H
#define FOVEA_GEOMETRY_FLOOR_H

#include <stdbool.h>
#include <stdint.h>

#include "base/elementary.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_FLOOR_POINTS_MAX = 512 };

struct fv_floor_point {
    double p[3];  /* camera frame, any unit */
    double sigma; /* one standard deviation of its height, relative, above 0 */
};

struct fv_floor_prior {
    double down[3];   /* unit: where the floor's normal is expected to point away from the camera */
    double sigma_rad; /* one standard deviation of its direction */
    double off_max_rad; /* hypotheses further aside are not looked at */
};

struct fv_floor {
    double down[3];        /* unit */
    double height;         /* distance of the camera from the plane, in the points' unit */
    double sigma;          /* one standard deviation of the height, relative */
    double information[6]; /* of down / height by the points alone, without the prior: the upper
                              triangle by rows; singular where they leave a direction open */
    uint32_t inliers;
    double support; /* weight of the inliers less that of what lies below, the best known points
                       counting 1 */
};

/* Up to `samples` hypotheses. False, `plane` untouched: fewer than `inliers_min` points agree, or
 * they fix the height badly (they lie on a line, or all far away), or as much lies below the plane
 * as in it, or it is hardly denser than what stands on it. */
bool fv_floor_estimate(const struct fv_floor_point *points, uint32_t count,
                       const struct fv_floor_prior *prior, uint32_t samples, uint32_t inliers_min,
                       struct fv_random *random, struct fv_floor *plane);

/* How far points are from a plane, of those near enough to be in it: 1.48 times the median
 * distance, in their standard deviations. 1 where these are stated right; 0: no point is near. */
double fv_floor_spread(const struct fv_floor_point *points, uint32_t count,
                       const struct fv_floor *plane);

/* The same plane where a unit of length is `metres` of another. */
void fv_floor_in_metres(struct fv_floor *plane, double metres);

#ifdef __cplusplus
}
#endif
#endif
