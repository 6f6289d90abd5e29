/* What the unit of length adds to the covariance of a pose, in a map whose unit is free.
 *
 * Where the camera passes from what it knew to what has next to no parallax, the map goes on in
 * another unit of length, and the pictures behind do not show it. In 24 simulated runs of 500
 * frames without faults bends (covariance.h) up to .4 changed it by 2 %, however many keyframes had
 * them; where bends of 1 followed each other, most of all in one run of sim:road, it went off by
 * some 40 % at each keyframe. So a keyframe keeps the variance of the logarithm of its unit over
 * that of the map's first keyframe: the mean of those of the keyframes from which its landmarks
 * come, and (.4 bend^3)^2. A frame has the mean likewise. A closure leaves its keyframes the
 * smaller variance of its two ends; a map from a file begins with none.
 *
 * The unit of a map is not that of its first keyframe but the mean of all: after a passage early on
 * most of the map has one unit. Where the variance grows by a step, the keyframes before it and
 * those behind differ by it, and the mean lies between them: those behind are off it by the share
 * of the keyframes before, those before by the share behind. The squares of these shares times the
 * steps, summed, are mean |V_k - V| - mean |V_k - V_l| / 2 over the keyframes' variances V_k, for
 * a frame's V (the form of T. Gneiting and A. Raftery, "Strictly proper scoring rules, prediction,
 * and estimation", 2007, 4.2). That share of the way from the reference, squared, is added along
 * the way. */
#ifndef FOVEA_ODOMETRY_COVARIANCE_UNIT_H
#define FOVEA_ODOMETRY_COVARIANCE_UNIT_H

#include <stdbool.h>

#include "map/map.h"

struct fv_odometry;

/* Adds to the covariance of a pose `t` away from the reference what the unit of its landmarks may
 * be off that of the map, and notes in state->covariance by how much a keyframe made of the frame
 * varies: more by its bend, but in a young map, which has nothing before it. Real-time safe. */
void fv_covariance_add_unit(struct fv_odometry *odometry, const struct fv_map_frame *frame,
                            double bend, bool is_young, const double t[3], double covariance[21]);

/* A keyframe was made: half the mean difference of the variances is found anew. Real-time safe, a
 * step for each pair of keyframes. */
void fv_covariance_spread_units(struct fv_odometry *odometry);

/* Variance of a unit about that of the map, of keyframes with these variances; `half_difference`:
 * half of their mean difference. */
double fv_covariance_unit_about(const float *variances, uint32_t count, double half_difference,
                                double variance);
double fv_covariance_half_difference(const float *variances, uint32_t count);

#endif
