/* What the pairs of two views determine: an essential or a fundamental matrix, or no more than a
 * homography.
 *
 * Pairs that all agree with a camera that only turned (or did not move) fit every essential matrix
 * [t]x R, whatever t; pairs that all agree with a homography H (one plane, a camera that only
 * turned) fit every fundamental matrix [e]x H. Sampling then returns one of them by chance, or
 * none. So the simpler model is fitted as well, and the other is taken only where more matches
 * agree with it alone than chance would give (as O. Chum, T. Werner and J. Matas, "Two-view
 * geometry estimation unaffected by a dominant plane", CVPR 2005, count what lies off a plane).
 *
 * On unit bearings, as geometry/essential.h. Real-time safe, any thread; no heap. */
#ifndef FOVEA_GEOMETRY_TWO_VIEWS_H
#define FOVEA_GEOMETRY_TWO_VIEWS_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/essential.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_two_views {
    /* Row by row: the matrix that was asked for, or where `simple` the homography x2 ~ H x1, which
     * is a rotation of calibrated views */
    double model[9];
    /* The pairs do not determine what was asked for. Those within 1.77 thresholds agree then, as a
     * distance between points holds the noise of two coordinates of both images, and Sampson's
     * distance that of one. */
    bool simple;
    uint32_t inliers; /* 0: nothing was found, `model` is 0 */
};

/* Pairs that agree with a motion: those whose second bearing is within the threshold of the arc on
 * which x1 would be seen at some distance, from R x1 (at infinity) to t (the first camera itself).
 * The part of the great circle behind R x1 is of negative distances: half of the distant points,
 * and of all points where the camera hardly moved, lie there by noise, but near R x1. Returns their
 * number. */
uint32_t fv_two_views_mark(const struct fv_pair *pairs, uint32_t count, double threshold_rad,
                           const struct fv_se3 *T_2_1, uint8_t *inlier);

/* The essential matrix of calibrated views, or a rotation. `inlier` and `work` take count bytes
 * each. */
void fv_two_views_essential(const struct fv_pair *pairs, uint32_t count,
                            const struct fv_sampling *sampling, struct fv_random *random,
                            uint8_t *inlier, uint8_t *work, struct fv_two_views *found);

/* The fundamental matrix of views that a pinhole camera of any focal length was taken for, or a
 * homography. */
void fv_two_views_fundamental(const struct fv_pair *pairs, uint32_t count,
                              const struct fv_sampling *sampling, struct fv_random *random,
                              uint8_t *inlier, uint8_t *work, struct fv_two_views *found);

#ifdef __cplusplus
}
#endif
#endif
