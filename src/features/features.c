#include "features/features.h"

#include <stdbool.h>

#include "features/ranked.h"
#include "features/refine.h"

static const float harris_k = .04f;

static bool by_fast(const struct fv_features *features)
{
    return features->config.method <= FOVEA_FEATURES_ORB;
}

void fv_features_carve(struct fv_features *features, const struct fovea_features_config *config,
                       const struct fv_pyramid *pyramid, struct fv_arena *frame)
{
    features->config = *config;
    features->count = 0;
    features->whole_pixels = false;
    features->list = fv_arena_take(frame, config->count_max, sizeof *features->list);
    features->corners = fv_arena_take(frame, config->count_max, sizeof *features->corners);
    if (by_fast(features))
        fv_fast_carve(&features->fast, pyramid->level[0].width, frame);
    else
        fv_response_carve(&features->response, pyramid->level[0].width,
                          config->method == FOVEA_FEATURES_HARRIS ? harris_k : -1, frame);
    int32_t width[FOVEA_PYRAMID_LEVELS_MAX], height[FOVEA_PYRAMID_LEVELS_MAX];
    for (uint32_t i = 0; i < pyramid->levels; i++) {
        width[i] = pyramid->level[i].width;
        height[i] = pyramid->level[i].height;
    }
    fv_spread_carve(&features->spread, pyramid->levels, width, height, config->count_max, frame);
}

void fv_features_set(struct fv_features *features, const struct fovea_features_config *config)
{
    features->config.count_max = config->count_max;
    features->config.threshold = config->threshold;
    features->config.threshold_min = config->threshold_min;
    features->config.per_cell = config->per_cell;
}

/* The mask's row that a row of a level lies in; NULL: no mask. */
static const uint8_t *mask_row_of(const struct fv_plane *mask, uint32_t level, int32_t y)
{
    return mask == NULL ? NULL : fv_plane_row(mask, fv_pyramid_pixel_in_raw(level, y));
}

static bool hidden(const uint8_t *mask_row, uint32_t level, int32_t x)
{
    return mask_row != NULL && mask_row[fv_pyramid_pixel_in_raw(level, x)] == 0;
}

static void find_in_level(struct fv_features *features, const struct fv_kernels *kernels,
                          const struct fv_pyramid *pyramid, uint32_t level,
                          const struct fv_plane *mask)
{
    struct fv_fast fast;
    fv_fast_begin(&fast, kernels, &pyramid->level[level], FV_FEATURES_BORDER_PX,
                  (int32_t)features->config.threshold_min, &features->fast);
    while (fv_fast_next(&fast)) {
        const uint8_t *mask_row = mask_row_of(mask, level, fast.y);
        for (int32_t i = 0; i < fast.count; i++) {
            const int32_t x = fast.columns[i];
            if (hidden(mask_row, level, x)) continue;
            fv_spread_offer(&features->spread, level, x, fast.y, fast.scores[x]);
        }
        fv_spread_thresholds(&features->spread, level, fast.y + 2,
                             (uint8_t)features->config.threshold_min, features->fast.thresholds);
    }
}

/* The same by the measure of Harris or of Shi and Tomasi. */
static void measure_level(struct fv_features *features, const struct fv_kernels *kernels,
                          const struct fv_pyramid *pyramid, uint32_t level,
                          const struct fv_plane *mask)
{
    struct fv_response response;
    fv_response_begin(&response, kernels, &pyramid->level[level], FV_FEATURES_BORDER_PX,
                      (int32_t)features->config.threshold_min, &features->response);
    while (fv_response_next(&response)) {
        const uint8_t *mask_row = mask_row_of(mask, level, response.y);
        for (int32_t i = 0; i < response.count; i++) {
            const int32_t x = response.columns[i];
            if (hidden(mask_row, level, x)) continue;
            fv_spread_offer(&features->spread, level, x, response.y, response.scores[i]);
        }
    }
}

/* Harris' measure of a corner that FAST found, as a score. */
static uint8_t ranked_score(const void *pyramid, uint32_t level, int32_t x, int32_t y)
{
    const struct fv_plane *plane = fv_pyramid_level(pyramid, level);
    return fv_response_score((float)fv_ranked_measure(plane, x, y) * (1.f / (25.f * (1 << 24))));
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
        if (by_fast(features))
            find_in_level(features, kernels, pyramid, level, mask);
        else
            measure_level(features, kernels, pyramid, level, mask);
    if (features->config.method == FOVEA_FEATURES_ORB)
        fv_spread_score(&features->spread, ranked_score, pyramid);
    features->count = fv_spread_pick(&features->spread, features->corners);
    fill_list(features);
    if (features->whole_pixels) return features->count;
    if (by_fast(features))
        fv_refine_corners(kernels, pyramid, features->corners, features->count, features->list);
    else
        fv_response_refine(pyramid, features->response.harris_k, features->corners, features->count,
                           features->list);
    return features->count;
}
