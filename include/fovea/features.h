/* Features: image corners with their position in the raw image, found on every level of the pyramid
 * by one of several methods (fovea/extract.h has their sources), thinned by non-maximum
 * suppression, and spread over the image. */
#ifndef FOVEA_FEATURES_H
#define FOVEA_FEATURES_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_PYRAMID_LEVELS_MAX = 8, FOVEA_FEATURES_MIN = 100, FOVEA_FEATURES_MAX = 4000 };

/* The first four have binary descriptors, which the loop's odometry compares. */
enum fovea_feature_method {
    FOVEA_FEATURES_FAST = 0,       /* FAST corners */
    FOVEA_FEATURES_ORB = 1,        /* FAST corners, the best by Harris' measure */
    FOVEA_FEATURES_HARRIS = 2,     /* corners by det - k trace^2 of the matrix of derivatives */
    FOVEA_FEATURES_SHI_TOMASI = 3, /* corners by its least eigenvalue */
    FOVEA_FEATURES_SIFT = 4,       /* extremes of differences of Gaussians in scale */
    /* maxima of the determinant of the Hessian in scale, by sums over boxes. Builds with SURF=no
     * leave it out: then it is refused */
    FOVEA_FEATURES_SURF = 5,
    FOVEA_FEATURE_METHOD_COUNT
};

struct fovea_feature {
    float x_px, y_px; /* raw image, level-0 pixels */
    float size_px;    /* diameter of the patch it stands for, level-0 pixels */
    uint8_t level;    /* pyramid level, 0 the finest */
    /* Grey levels: the largest threshold at which it still is a corner of FAST; with the other
     * methods four times the fourth root of Harris' measure, or the square root of the least
     * eigenvalue, per pixel */
    uint8_t score;
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
    /* default FOVEA_FEATURES_FAST; or ORB, HARRIS, SHI_TOMASI. All find corners on every level of
     * the pyramid, and describe them as ORB does */
    enum fovea_feature_method method;
};

#ifdef __cplusplus
}
#endif
#endif
