/* The essential matrix of two calibrated views, on unit bearings.
 *
 * x2^T E x1 = 0 with E = [t]x R, where T_2_1 = (R, t) takes points of camera 1 to camera 2.
 * Minimal solver: D. Nister, "An efficient solution to the five-point relative pose problem" (PAMI
 * 2004). Sampling: MSAC with local optimisation (O. Chum, J. Matas, J. Kittler, "Locally optimized
 * RANSAC", DAGM 2003). The residual is Sampson's on the unit sphere, in radians, so that wide
 * lenses are treated like narrow ones. Real-time safe, any thread; no heap. */
#ifndef FOVEA_GEOMETRY_ESSENTIAL_H
#define FOVEA_GEOMETRY_ESSENTIAL_H

#include <stdint.h>

#include "base/elementary.h"
#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_ESSENTIAL_SOLUTIONS_MAX = 10 };

/* One correspondence: unit bearings in camera 1 and camera 2. */
struct fv_pair {
    double x1[3], x2[3];
};

struct fv_sampling {
    double threshold_rad; /* residuals above it are outliers */
    double confidence;    /* probability that one sample was free of outliers, for instance 0.999 */
    uint32_t iterations_max; /* hard bound on samples */
};

/* Up to ten essential matrices (row-major, Frobenius norm sqrt(2)) of five pairs; returns their
 * number. */
int fv_essential_five_point(const struct fv_pair pairs[5], double E[FV_ESSENTIAL_SOLUTIONS_MAX][9]);

/* Squared residual (rad^2) of a pair. */
double fv_essential_residual2(const double E[9], const struct fv_pair *pair);

void fv_essential_from_motion(const struct fv_se3 *T_2_1, double E[9]);

/* The four motions of an essential matrix, |t| = 1 (B. K. P. Horn, "Recovering baseline and
 * orientation from essential matrix", 1990). */
void fv_essential_motions(const double E[9], struct fv_se3 T_2_1[4]);

/* Gauss-Newton on five degrees of freedom over pairs whose residual is below `threshold_rad`,
 * robust weights.
 */
void fv_essential_refine(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                         int steps, struct fv_se3 *T_2_1);

/* Robust estimate. `inlier` (count bytes, 0 or 1) and `T_2_1` (|t| = 1) are written on success.
 * Of the four motions the one with most inliers in front of both cameras is taken. Returns the
 * number of inliers; 0: none found, outputs untouched. */
uint32_t fv_essential_estimate(const struct fv_pair *pairs, uint32_t count,
                               const struct fv_sampling *sampling, struct fv_random *random,
                               struct fv_se3 *T_2_1, uint8_t *inlier);

#ifdef __cplusplus
}
#endif
#endif
