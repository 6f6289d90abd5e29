#include "features/features.h"

#include "features/refine.h"

void fv_features_carve(struct fv_features *features, const struct fovea_features_config *config,
                       const struct fv_pyramid *pyramid, struct fv_arena *frame)
{
    features->config = *config;
    features->count = 0;
    features->list = fv_arena_take(frame, config->count_max, sizeof *features->list);
    features->corners = fv_arena_take(frame, config->count_max, sizeof *features->corners);
    fv_fast_carve(&features->fast, pyramid->level[0].width, frame);
    int32_t width[FOVEA_PYRAMID_LEVELS_MAX], height[FOVEA_PYRAMID_LEVELS_MAX];
    for (uint32_t i = 0; i < pyramid->levels; i++) {
        width[i] = pyramid->level[i].width;
        height[i] = pyramid->level[i].height;
    }
    fv_spread_carve(&features->spread, pyramid->levels, width, height, config->count_max, frame);
}

static void find_in_level(struct fv_features *features, const struct fv_kernels *kernels,
                          const struct fv_pyramid *pyramid, uint32_t level,
                          const struct fv_plane *mask)
{
    const struct fv_plane *from = &pyramid->level[level];
    struct fv_fast fast;
    fv_fast_begin(&fast, kernels, from, FV_FEATURES_BORDER_PX,
                  (int32_t)features->config.threshold_min, &features->fast);
    while (fv_fast_next(&fast)) {
        const uint8_t *mask_row =
            mask == NULL ? NULL : fv_plane_row(mask, fv_pyramid_pixel_in_raw(level, fast.y));
        for (int32_t i = 0; i < fast.count; i++) {
            const int32_t x = fast.columns[i];
            if (mask_row != NULL && mask_row[fv_pyramid_pixel_in_raw(level, x)] == 0) continue;
            fv_spread_offer(&features->spread, level, x, fast.y, fast.scores[x]);
        }
    }
}

static void fill_list(struct fv_features *features)
{
    for (uint32_t i = 0; i < features->count; i++) {
        const struct fv_corner *corner = &features->corners[i];
        features->list[i] = (struct fovea_feature){
            .x_px = fv_pyramid_to_raw(corner->level, corner->x),
            .y_px = fv_pyramid_to_raw(corner->level, corner->y),
            .size_px = FV_FEATURES_PATCH_PX * fv_pyramid_scale(corner->level),
            .level = corner->level,
            .score = corner->score,
        };
    }
}

uint32_t fv_features_find(struct fv_features *features, const struct fv_kernels *kernels,
                          const struct fv_pyramid *pyramid, const struct fv_plane *mask,
                          uint32_t count_asked)
{
    const uint32_t asked =
        count_asked < features->config.count_max ? count_asked : features->config.count_max;
    fv_spread_begin(&features->spread, asked, (uint8_t)features->config.threshold,
                    (uint8_t)features->config.per_cell);
    for (uint32_t level = pyramid->levels; level-- > 0;)
        find_in_level(features, kernels, pyramid, level, mask);
    features->count = fv_spread_pick(&features->spread, features->corners);
    fill_list(features);
    fv_refine_corners(kernels, pyramid, features->corners, features->count, features->list);
    return features->count;
}
