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
 * Levels but the finest are smoothed by 1 2 1 across and down before corners are sought on them.
 * Their pixels are blends of .9 and .1 to .5 and .5 of two of the level before, so that sharpness
 * has a period of five pixels, and corners come and go with it. Descriptors see them unsmoothed.
 *
 * Places lie .85 of the way from the corner's pixel to what refine.h finds. Between matches of
 * photographs of COCO that were turned, zoomed and tilted the least squares say .86 (16 pictures,
 * 11,470 pairs) and .84 (16 others), with root mean square distances of .49 pixels of the level;
 * whole pixels leave .74, all of it .50.
 *
 * Measured on the Oxford affine sets graf, bikes, boat (1000 features, means of 15 pairs):
 * repeatability .441 with corners spread as in the loop, .493 without smoothing and with all of the
 * refinement, .511 as here; OpenCV's .471. Matching .279, .295; OpenCV's .246. On 80 pairs of
 * photographs (blur, zoom and rotation, tilt) that nothing was chosen by: .636, .657; OpenCV's
 * .552. Smoothing level 0 too helps blurred images by .01 and costs graf as much; smoothing for the
 * rank alone gives half, for FAST alone nothing. Quotas that fall by 1.3
 * repeat better in other such photographs (+.014) and match less in the affine sets (-.009).
 * Without smoothing: a flat window and twice the quota .488; from there a threshold of 7 .477;
 * lacks handed to finer levels .488; all ranked by FAST score .461, over all levels at once .451;
 * pixels by areas .476, by cubics .486; Foerstner's places .489; of a corner on several levels the
 * best alone .450.
 *
 * Single pairs: repeatability takes features that lie within 2.5 pixels, whatever their sizes. Of
 * boat 1-5 and 1-6 (zoom 2.4 and 2.7) and graf 1-6 OpenCV's surplus lies in pairs whose levels do
 * not fit the zoom: its places are whole pixels, up to 1.8 pixels of the image off, so that corners
 * on several levels scatter, and meet others by chance; hardly one matches. Among pairs of like
 * size no pair is more than .018 below OpenCV's with 300, 500, 1000 or 2000 features; of all the
 * least are -.016, -.036, -.033, -.045, -.053 (graf 1-6) with 300, 500, 1000, 2000, 3000.
 *
 * What was tried at 2000 and 3000: repeatability and matching on photographs to choose by, and the
 * least difference of a pair of the affine sets with 2000 and with 3000, where it was looked at:
 *
 *     as here                            .747 .585   -.045 -.053
 *     FAST threshold 12                  .707 .540
 *     FAST threshold 8                   .698 .531
 *     twice the quota ranked             .750 .591
 *     six times                          .745 .582
 *     .7 of the refinement               .745 .584
 *     corners 2.5 pixels apart           .752 .592   -.046 -.061
 *     the same, twice the quota          .756 .598   -.054 -.069
 *     the same, quotas fall by 4/5       .752 .588   -.045 -.055
 *     the same, quotas fall by 3/4       .751 .585   -.037 -.043
 *
 * The last alone holds -.04 with 2000, and costs where pictures are noisy (.735 to .708) and dark
 * (.856 to .838). (Pixels are those of the level.) On 12 photographs changed in 11 ways, with 2000
 * features, .680 and .404 as here (OpenCV's .631 and .333); 31 pixels from the border as OpenCV, so
 * that more corners lie in both pictures, .653 and .384; ranked by det / trace .678 and .404, by
 * the least eigenvalue .672 and .401: neither was tried on the affine sets. */
#ifndef FOVEA_FEATURES_RANKED_H
#define FOVEA_FEATURES_RANKED_H

#include <stdint.h>

#include "base/arena.h"
#include "features/fast.h"
#include "features/spread.h"
#include "features/strongest.h"
#include "fovea/features.h"
#include "image/filters.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

enum { FV_RANKED_MORE = 3 };

struct fv_ranked {
    uint32_t count_max, threshold;
    int32_t border;
    struct fv_fast_scratch fast;
    struct fv_strongest by_score, by_measure; /* of the level in work */
    struct fv_gauss gauss;
    struct fv_filters filters;
    uint8_t *smooth; /* the level in work, not level 0; NULL where there is no other */
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
