#include "features/ranked.h"

#include "base/float_bits.h"
#include "features/refine.h"

enum { WINDOW = 7, RADIUS = WINDOW / 2 };

/* Of the way from a corner's pixel to the refined place (ranked.h). */
static const float part = 0.85f;

void fv_ranked_carve(struct fv_ranked *ranked, uint32_t count_max, uint32_t threshold,
                     const struct fv_pyramid *pyramid, int32_t border, struct fv_arena *arena)
{
    ranked->count_max = count_max;
    ranked->threshold = threshold;
    ranked->border = border;
    fv_fast_carve(&ranked->fast, pyramid->level[0].width, arena);
    fv_strongest_carve(&ranked->by_score, FV_RANKED_MORE * count_max, arena);
    fv_strongest_carve(&ranked->by_measure, count_max, arena);
    ranked->corners = fv_arena_take(arena, count_max, sizeof *ranked->corners);
    ranked->places = fv_arena_take(arena, count_max, sizeof *ranked->places);
    ranked->responses = fv_arena_take(arena, count_max, sizeof *ranked->responses);
    if (pyramid->levels == 1) return;
    const struct fv_plane *largest = &pyramid->level[1];
    fv_gauss_make(&ranked->gauss, 3, 0);
    fv_filters_carve(&ranked->filters, largest->width, arena);
    ranked->smooth = fv_arena_take(arena, (size_t)largest->height, (size_t)largest->stride);
}

/* The level as corners are found on it. */
static struct fv_plane smoothed(const struct fv_ranked *ranked, const struct fv_kernels *kernels,
                                const struct fv_pyramid *pyramid, uint32_t level)
{
    struct fv_plane plane = pyramid->level[level];
    const int32_t least = 2 * ranked->border; /* no corner fits in so few pixels */
    if (level == 0 || plane.width <= least || plane.height <= least) return plane;
    plane.pixels = ranked->smooth;
    fv_gauss_run(&ranked->filters, &ranked->gauss, kernels, &pyramid->level[level], &plane);
    return plane;
}

/* Differences and weighted sums along x, the horizontal halves of Sobel derivatives. */
static void sobel_rows(const struct fv_plane *level, int32_t x, int32_t y,
                       int32_t difference[WINDOW + 2][WINDOW], int32_t sum[WINDOW + 2][WINDOW])
{
    for (int32_t v = 0; v < WINDOW + 2; v++) {
        const uint8_t *row = fv_plane_row(level, y + v - RADIUS - 1) + x - RADIUS;
        for (int32_t u = 0; u < WINDOW; u++) {
            difference[v][u] = row[u + 1] - row[u - 1];
            sum[v][u] = row[u + 1] + 2 * row[u] + row[u - 1];
        }
    }
}

int64_t fv_ranked_measure(const struct fv_plane *level, int32_t x, int32_t y)
{
    static const int32_t weight[WINDOW] = {1, 6, 15, 20, 15, 6, 1};
    int32_t difference[WINDOW + 2][WINDOW], sum[WINDOW + 2][WINDOW];
    int64_t xx = 0, yy = 0, xy = 0;
    sobel_rows(level, x, y, difference, sum);
    for (int32_t v = 0; v < WINDOW; v++) {
        int32_t row_xx = 0, row_yy = 0, row_xy = 0; /* at most 64 x 1020^2 */
        for (int32_t u = 0; u < WINDOW; u++) {
            const int32_t dx = difference[v][u] + 2 * difference[v + 1][u] + difference[v + 2][u];
            const int32_t dy = sum[v + 2][u] - sum[v][u];
            row_xx += weight[u] * dx * dx;
            row_yy += weight[u] * dy * dy;
            row_xy += weight[u] * dx * dy;
        }
        xx += weight[v] * (int64_t)row_xx;
        yy += weight[v] * (int64_t)row_yy;
        xy += weight[v] * (int64_t)row_xy;
    }
    /* Below 2^26 each, so that the measure fits. */
    xx /= 64;
    yy /= 64;
    xy /= 64;
    const int64_t measure = 25 * (xx * yy - xy * xy) - (xx + yy) * (xx + yy);
    return measure > 1 ? measure : 1;
}

/* The strongest of a level by FAST score. */
static void scan(struct fv_ranked *ranked, const struct fv_kernels *kernels,
                 const struct fv_plane *from, uint32_t level, const struct fv_plane *mask)
{
    struct fv_fast fast;
    fv_strongest_begin(&ranked->by_score);
    fv_fast_begin(&fast, kernels, from, ranked->border, (int32_t)ranked->threshold, &ranked->fast);
    while (fv_fast_next(&fast)) {
        const uint8_t *mask_row = mask->pixels == NULL
                                      ? NULL
                                      : fv_plane_row(mask, fv_pyramid_pixel_in_raw(level, fast.y));
        for (int32_t i = 0; i < fast.count; i++) {
            const int32_t x = fast.columns[i];
            if (mask_row == NULL || mask_row[fv_pyramid_pixel_in_raw(level, x)] != 0)
                fv_strongest_offer(&ranked->by_score, fast.scores[x], x, fast.y);
        }
    }
}

/* Of these the best by Harris' measure, from corners[first] on; returns how many. */
static uint32_t rank(struct fv_ranked *ranked, const struct fv_plane *from, uint32_t level,
                     uint32_t first)
{
    struct fv_strongest *best = &ranked->by_measure;
    fv_strongest_begin(best);
    for (uint32_t i = 0; i < ranked->by_score.count; i++) {
        const int32_t x = fv_strongest_x(&ranked->by_score, i);
        const int32_t y = fv_strongest_y(&ranked->by_score, i);
        fv_strongest_offer(best, (uint32_t)fv_float_bits((float)fv_ranked_measure(from, x, y)), x,
                           y);
    }
    fv_strongest_sort(best);
    for (uint32_t i = 0; i < best->count; i++) {
        ranked->corners[first + i] = (struct fv_corner){
            .x = (uint16_t)fv_strongest_x(best, i),
            .y = (uint16_t)fv_strongest_y(best, i),
            .level = (uint8_t)level,
        };
        ranked->responses[first + i] =
            fv_float_of_bits((int32_t)fv_strongest_response(best, i)) * (1.f / (25.f * (1 << 24)));
    }
    return best->count;
}

static void refine(struct fv_ranked *ranked, const struct fv_kernels *kernels,
                   const struct fv_pyramid *seen, uint32_t first, uint32_t count)
{
    const struct fv_corner *corners = ranked->corners + first;
    struct fovea_feature *places = ranked->places + first;
    fv_refine_corners(kernels, seen, corners, count, places);
    for (uint32_t i = 0; i < count; i++) {
        const float x_px = fv_pyramid_to_raw(corners[i].level, corners[i].x);
        const float y_px = fv_pyramid_to_raw(corners[i].level, corners[i].y);
        places[i].x_px = x_px + part * (places[i].x_px - x_px);
        places[i].y_px = y_px + part * (places[i].y_px - y_px);
    }
}

uint32_t fv_ranked_find(struct fv_ranked *ranked, const struct fv_kernels *kernels,
                        const struct fv_pyramid *pyramid, const struct fv_plane *mask)
{
    struct fv_pyramid seen = *pyramid;
    uint32_t count = 0, due = ranked->count_max;
    for (uint32_t level = pyramid->levels; level-- > 0 && due > 0;) {
        uint32_t quota =
            fv_spread_quota(level, pyramid->levels, ranked->count_max, FV_SPREAD_OVER_EVEN);
        if (quota > due || level == 0) quota = due;
        if (quota == 0) continue;
        due -= quota;
        ranked->by_score.room = FV_RANKED_MORE * quota;
        ranked->by_measure.room = quota;
        seen.level[level] = smoothed(ranked, kernels, pyramid, level);
        scan(ranked, kernels, &seen.level[level], level, mask);
        const uint32_t found = rank(ranked, &seen.level[level], level, count);
        refine(ranked, kernels, &seen, count, found);
        count += found;
    }
    return count;
}
