/* FAST corners of a picture on every level of its pyramid, the best of each level by Harris'
 * measure: those of ORB (Rublee, Rabaud, Konolige and Bradski, "ORB: an efficient alternative to
 * SIFT or SURF", ICCV 2011).
 *
 * FAST says where corners are, but its score ranks corners and ends of edges alike; of each level
 * the FV_RANKED_MORE x quota strongest by FAST are ranked by det - 0.04 trace^2 of the matrix of
 * Sobel derivatives, weighted by a Gaussian (binomial) window of 7 x 7 pixels. Quotas fall by 5/6
 * from level to level. What a level lacks is not made up for on others: in a darker or blurred
 * picture of the same things that would add features that the other picture does not have. The
 * loop, whose poses need corners everywhere, picks them otherwise (spread.h).
 *
 * Measured on the Oxford affine sets graf, bikes, boat (1000 features, means of 15 pairs), and on
 * 12 photographs changed by hand (blur, zoom and rotation, viewpoint, light, noise, JPEG):
 * repeatability .441 and .556 with corners spread as in the loop; .493 and .642 as here; OpenCV's
 * .471 and .616. With a flat window and twice the quota .488 and .641; from there with a threshold
 * of 7 .477 and .605, with lacks handed to finer levels .488 and .625, with both .476 and .604, and
 * so ranked by FAST score .461, or over all levels at once .451 and .566.
 *
 * Places are those of refine.h. The least difference of a pair to OpenCV's repeatability on the
 * affine sets is then -.043, -.035, -.041 and -.048 with 500, 1000, 2000 and 3000 features. Without
 * refinement it is -.018 and -.016 with 1000 and 2000, but matching scores fall from .279 to .254.
 * Of the refinement .85 gives -.032 and -.037; but that part was chosen on these sets, and on
 * changed photographs of COCO right matches then lie no nearer (.971 and .968 px rms), so all of it
 * is taken. Tried and left out, by the mean of repeatability of 1000 features (.493): where lines
 * of gradients meet (Foerstner) .489, least -.09; borders of 31 pixels .493, least -.037; no other
 * within 2.3 pixels that is better .494, but least -.048 with 2000. Of a corner on several levels
 * the best alone .450, with 400 to 3000 features (.501). */
#ifndef FOVEA_FEATURES_RANKED_H
#define FOVEA_FEATURES_RANKED_H

#include <stdint.h>

#include "base/arena.h"
#include "features/fast.h"
#include "features/spread.h"
#include "features/strongest.h"
#include "fovea/features.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

enum { FV_RANKED_MORE = 3 };

struct fv_ranked {
    uint32_t count_max, threshold;
    int32_t border;
    struct fv_fast_scratch fast;
    struct fv_strongest by_score, by_measure; /* of the level in work */
    /* What was found: coarse levels first, of each level the strongest first. */
    struct fv_corner *corners;    /* score 0 */
    struct fovea_feature *places; /* x_px and y_px alone */
    float *responses;             /* grey levels per pixel to the fourth power */
};

/* Take memory for pictures of the pyramid's size: at most `count_max` corners of at least
 * `threshold` by FAST, `border` (at least FV_CORNER_MARGIN_PX) pixels from the border of their
 * level. Init-only. */
void fv_ranked_carve(struct fv_ranked *ranked, uint32_t count_max, uint32_t threshold,
                     const struct fv_pyramid *pyramid, int32_t border, struct fv_arena *arena);

/* Find them, none where `mask` (of the size of level 0, its pixels may be NULL) is 0; returns how
 * many. Real-time safe: time is at most proportional to the pixels times the logarithm of
 * count_max. The same bits everywhere. */
uint32_t fv_ranked_find(struct fv_ranked *ranked, const struct fv_kernels *kernels,
                        const struct fv_pyramid *pyramid, const struct fv_plane *mask);

/* Harris' measure of the pixel (x, y), 4 pixels from the border, times 25 x 2^24; at least 1. */
int64_t fv_ranked_measure(const struct fv_plane *level, int32_t x, int32_t y);

#endif
