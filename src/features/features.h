/* Features of a frame: corners on every level of the pyramid, spread over the image.
 *
 * Corners are those of FAST-9/16 with non-maximum suppression (fast.h), or those of Harris' or Shi
 * and Tomasi's measure (response.h), of a score of at least config.threshold_min; where a cell of
 * the grid holds any corner of config.threshold, only those count. With the method ORB the corners
 * that FAST leaves in the cells, at most FV_SPREAD_KEPT each, get their score by Harris' measure,
 * as OpenCV's ORB ranks them: so the time for it is bounded by the number of features. They are
 * picked so that they cover the image, with a quota for each level (spread.h), and keep
 * FV_FEATURES_BORDER_PX from the border of their level, so that a descriptor's patch fits. The
 * order is fixed: by level from coarse to fine, then cell by cell. Integer only up to the final
 * scaling of positions. */
#ifndef FOVEA_FEATURES_FEATURES_H
#define FOVEA_FEATURES_FEATURES_H

#include <stdint.h>

#include "base/arena.h"
#include "features/fast.h"
#include "features/response.h"
#include "features/spread.h"
#include "fovea/features.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_FEATURES_BORDER_PX = 19, FV_FEATURES_PATCH_PX = 31 };

struct fv_features {
    struct fovea_features_config config;
    uint32_t count;              /* features of the last frame */
    struct fovea_feature *list;  /* config.count_max elements */
    struct fv_corner *corners;   /* the same in whole pixels of their levels, element by element */
    struct fv_fast_scratch fast; /* of FAST and ORB */
    struct fv_response_scratch response; /* of Harris and Shi-Tomasi */
    struct fv_spread spread;
    bool whole_pixels; /* positions stay in whole pixels of their levels; set after carving */
};

/* Take memory for frames of the pyramid's size from the arena. Fills sizes and addresses only.
 * Init-only. */
void fv_features_carve(struct fv_features *features, const struct fovea_features_config *config,
                       const struct fv_pyramid *pyramid, struct fv_arena *frame);

/* Change thresholds, features per cell and the most features, which are at most those of carving.
 * Real-time safe. */
void fv_features_set(struct fv_features *features, const struct fovea_features_config *config);

/* Find at most `count_asked` features (cut to config.count_max). `mask`, when not NULL, has the
 * size of level 0: no feature where it is 0. Fills features->list, ->corners
 * and ->count; returns the count. Real-time safe; cost bounded by the number of pixels. */
uint32_t fv_features_find(struct fv_features *features, const struct fv_kernels *kernels,
                          const struct fv_pyramid *pyramid, const struct fv_plane *mask,
                          uint32_t count_asked);

#ifdef __cplusplus
}
#endif
#endif
