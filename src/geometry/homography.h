/* The homography of two calibrated views, on unit bearings: x2 ~ H x1 for points of a plane or a
 * purely turning camera.
 *
 * Sampling: MSAC on four-point samples with refitting. Decomposition: Y. Ma, S. Soatto, J. Kosecka,
 * S. Sastry, "An Invitation to 3-D Vision" (2004), algorithm 5.2. Real-time safe, any thread; no
 * heap. */
#ifndef FOVEA_GEOMETRY_HOMOGRAPHY_H
#define FOVEA_GEOMETRY_HOMOGRAPHY_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/essential.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Robust estimate; returns the number of inliers, 0: none found. `inlier` takes count bytes. */
uint32_t fv_homography_estimate(const struct fv_pair *pairs, uint32_t count,
                                const struct fv_sampling *sampling, struct fv_random *random,
                                double H[9], uint8_t *inlier);

/* Motions with |t| = 1 that explain H; returns their number: 4 or 0 (a pure rotation, or not a
 * homography of two views). `baseline_ratio`, |t| over the plane's distance, tells how far H is
 * from a rotation. */
int fv_homography_motions(const double H[9], struct fv_se3 T_2_1[4], double *baseline_ratio);

#ifdef __cplusplus
}
#endif
#endif
