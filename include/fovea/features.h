/* Features: image corners with their position in the raw image.
 *
 * FAST-9/16 corners (Rosten and Drummond, ECCV 2006) found on every level of the pyramid, thinned
 * by non-maximum suppression, and spread over the image. */
#ifndef FOVEA_FEATURES_H
#define FOVEA_FEATURES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_PYRAMID_LEVELS_MAX = 8, FOVEA_FEATURES_MIN = 100, FOVEA_FEATURES_MAX = 4000 };

struct fovea_feature {
    float x_px, y_px;  /* raw image, level-0 pixels */
    float size_px;     /* diameter of the patch it stands for, level-0 pixels */
    uint8_t level;     /* pyramid level, 0 the finest */
    uint8_t score;     /* FAST score: largest threshold at which it still is a corner */
    uint16_t reserved; /* zero, so that the struct has no undefined bytes */
};

struct fovea_features_config {
    /* [100, 4000], default 1000: features per frame; step time grows linearly */
    uint32_t count_max;
    uint32_t pyramid_levels; /* [1, 8], default 8 */
    uint32_t threshold;      /* [2, 100] grey levels, default 20: tried first in every cell */
    uint32_t threshold_min; /* [2, 100], default 7, at most threshold: where a cell has no corner */
    /* [1, 8], default 2: features that a cell of the grid may give. High takes the
     * strongest, which match best between two pictures (8: matching score up by half on
     * the Oxford sets); low spreads evenly, which constrains poses better (of 36 runs of
     * odometry none fails with 2, two fail with 8) */
    uint32_t per_cell;
};

#ifdef __cplusplus
}
#endif
#endif
