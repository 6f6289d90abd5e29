/* Positions of corners to a fraction of a pixel: the peak of a quadratic that is fitted to the
 * corner strength around them.
 *
 * FAST decides only which whole pixel is the strongest. The strength of its 5 x 5 surroundings
 * (contracts/corner.h) is fitted by a quadratic, weighted by a Gaussian of one pixel, and its peak
 * taken. Measured by warping real images (EuRoC, KITTI, 7-Scenes, graf) by known similarities with
 * noise of 2 grey levels: distance between matched corners, median 0.55 to 0.17 px of their level,
 * RMS 0.73 to 0.40. A 3 x 3 fit gives 0.22, parabolas along the axes 0.25, gradient-based
 * refinement (Foerstner) 0.50: it moves corners away from what FAST finds again. */
#ifndef FOVEA_FEATURES_REFINE_H
#define FOVEA_FEATURES_REFINE_H

#include <stdint.h>

#include "features/spread.h"
#include "fovea/features.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Peak of the quadratic through scores (FV_CORNER_SCORES of one corner) as an offset from the
 * middle, each part within 0.75 pixel; 0 0 where there is no peak. */
void fv_refine_peak(const uint8_t *scores, float offset_px[2]);

/* Set x_px and y_px of features[i] to the refined position of corners[i], in the raw image. Corners
 * keep FV_CORNER_MARGIN_PX from the border of their level. Real-time safe; constant time per
 * corner. */
void fv_refine_corners(const struct fv_kernels *kernels, const struct fv_pyramid *pyramid,
                       const struct fv_corner *corners, uint32_t count,
                       struct fovea_feature *features);

#ifdef __cplusplus
}
#endif
#endif
