/* The fundamental matrix of two views of unknown cameras, on unit bearings of any pinhole camera
 * that is taken for both: x2^T F x1 = 0, of rank 2.
 *
 * Minimal solver: the seven-point algorithm (R. Hartley and A. Zisserman, "Multiple View Geometry
 * in Computer Vision", 2nd edition 2004, section 11.1.2). Fit over inliers: the normalised
 * eight-point algorithm (R. Hartley, "In defense of the eight-point algorithm", PAMI 1997),
 * weighted again by Sampson's distance. Sampling and residual: as geometry/essential.h. Real-time
 * safe, any thread; no heap. */
#ifndef FOVEA_GEOMETRY_FUNDAMENTAL_H
#define FOVEA_GEOMETRY_FUNDAMENTAL_H

#include <stdint.h>

#include "geometry/essential.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_FUNDAMENTAL_SOLUTIONS_MAX = 3 };

/* The one to three matrices (row-major, Frobenius norm 1) of seven pairs; returns their number, 0
 * where the pairs do not determine them. */
int fv_fundamental_seven_point(const struct fv_pair pairs[7],
                               double F[FV_FUNDAMENTAL_SOLUTIONS_MAX][9]);

/* Robust estimate. `inlier` takes count bytes, 0 or 1. Returns the number of inliers; 0: none found
 * (fewer than 9 agree), F untouched. */
uint32_t fv_fundamental_estimate(const struct fv_pair *pairs, uint32_t count,
                                 const struct fv_sampling *sampling, struct fv_random *random,
                                 double F[9], uint8_t *inlier);

#ifdef __cplusplus
}
#endif
#endif
