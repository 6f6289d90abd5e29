#include "image/segments.h"

#include <string.h>

#include "base/elementary.h"
#include "image/region.h"

enum {
    BINS = 2896,           /* of gradients, in quarters of a grey level: up to 2 * 510 * sqrt 2 */
    SQUARED_LEAST = 110,   /* of a gradient in half grey levels: above 2 / sin 22.5 degrees */
    VISITS_PER_PIXEL = 24, /* at most, of the image */
    SEED_VISITS = 2        /* that a seed costs which has no region */
};

enum phase { GRADIENTS = 0, SORTING, REGIONS, DONE };

void fovea_segments_config_default(struct fovea_segments_config *config)
{
    *config = (struct fovea_segments_config){.count_max = 4000};
}

static enum fovea_status check(const struct fovea_segments_config *config, int32_t width,
                               int32_t height, struct fovea_error *error)
{
    const struct {
        const char *name;
        double value, low, high;
    } ranges[] = {
        {"length_min_px", config->length_min_px, 0, 10000},
        {"count_max", config->count_max, 1, 20000},
        {"width", width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX},
        {"height", height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (!(ranges[i].value >= ranges[i].low && ranges[i].value <= ranges[i].high))
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g",
                                   ranges[i].name, ranges[i].value, ranges[i].low, ranges[i].high);
    return FOVEA_OK;
}

/* Pixels of the smallest region that chance hardly makes in an image of this size: of 11 (w h)^2.5
 * rectangles, with a chance of 1/8 for each pixel. */
static uint32_t region_least(int32_t columns, int32_t rows)
{
    const double tests = 2.5 * (fv_log(columns) + fv_log(rows)) + fv_log(11);
    return (uint32_t)(tests / fv_log(8));
}

void fv_segments_carve(struct fv_segments *s, const struct fovea_segments_config *config,
                       int32_t width, int32_t height, struct fv_arena *arena,
                       struct fv_arena *scratch)
{
    s->config = *config;
    s->width = width;
    s->height = height;
    s->columns = width * 4 / 5;
    s->rows = height * 4 / 5;
    s->region_least = region_least(s->columns, s->rows);
    fv_gauss_make(&s->gauss, 7, 0.75);
    const size_t pixels = (size_t)s->columns * (size_t)s->rows;
    s->scratch = fv_arena_take_raw(scratch, (size_t)width + FV_GAUSS_PAD, sizeof *s->scratch);
    for (int i = 0; i < 2; i++) {
        s->smooth[i] = fv_arena_take_raw(arena, (size_t)width + FV_CACHE_LINE_BYTES, 1);
        s->reduced[i] = fv_arena_take_raw(arena, (size_t)s->columns, 1);
    }
    s->line = fv_arena_take_raw(arena, pixels, sizeof *s->line);
    s->used = fv_arena_take_raw(arena, pixels, 1);
    s->starts = fv_arena_take_raw(arena, BINS, sizeof *s->starts);
    s->seeds = fv_arena_take_raw(arena, pixels, sizeof *s->seeds);
    s->region = fv_arena_take_raw(arena, FV_REGION_MAX, sizeof *s->region);
    s->found = fv_arena_take_raw(arena, config->count_max, sizeof *s->found);
}

void fv_segments_begin(const struct fv_segments *s, struct fv_segments_state *state)
{
    *state =
        (struct fv_segments_state){.visits_left = VISITS_PER_PIXEL * (int64_t)s->width * s->height};
    memset(s->starts, 0, BINS * sizeof *s->starts);
}

/* ---- gradients ------------------------------------------------------------------------------- */

static int32_t reflected(int32_t y, int32_t height)
{
    if (y < 0) y = -y;
    return y < height ? y : 2 * (height - 1) - y;
}

static void smooth_row(const struct fv_segments *s, const struct fv_kernels *kernels,
                       const struct fv_plane *plane, int32_t y)
{
    const uint8_t *rows[2 * FV_FILTER_RADIUS_MAX + 1];
    for (int32_t i = 0; i < 7; i++)
        rows[i] = fv_plane_row(plane, reflected(y - 3 + i, s->height));
    kernels->gauss_row_u8(s->smooth[y % 2], rows, s->width, s->gauss.weights, s->gauss.radius,
                          s->scratch);
}

/* A row of the reduced image, of the smoothed rows at 1.25 y + 0.125: five pixels make four, with
 * weights of 1/8, rounded once. */
static void reduce_row(const struct fv_segments *s, int32_t y)
{
    const int32_t above = y / 4 * 5 + y % 4, wy = 2 * (y % 4) + 1;
    const uint8_t *up = s->smooth[above % 2], *down = s->smooth[(above + 1) % 2];
    uint8_t *to = s->reduced[y % 2];
    for (int32_t x = 0; x < s->columns; x++) {
        const int32_t at = x / 4 * 5 + x % 4, wx = 2 * (x % 4) + 1;
        const int32_t left = up[at] * (8 - wy) + down[at] * wy,
                      right = up[at + 1] * (8 - wy) + down[at + 1] * wy;
        to[x] = (uint8_t)((left * (8 - wx) + right * wx + 32) >> 6);
    }
}

static uint32_t bin_of(struct fv_level_line line)
{
    return (uint32_t)(2 * __builtin_sqrt((double)(line.x * line.x + line.y * line.y)));
}

/* Directions of row y, from it and the one below; none in the last row and column. */
static void direct_row(const struct fv_segments *s, int32_t y)
{
    struct fv_level_line *line = s->line + (size_t)y * (size_t)s->columns;
    const uint8_t *up = s->reduced[y % 2], *down = s->reduced[(y + 1) % 2];
    memset(s->used + (size_t)y * (size_t)s->columns, 0, (size_t)s->columns);
    memset(line, 0, (size_t)s->columns * sizeof *line);
    for (int32_t x = 0; y + 1 < s->rows && x + 1 < s->columns; x++) {
        const int32_t falling = down[x + 1] - up[x], rising = up[x + 1] - down[x];
        const int32_t gx = falling + rising, gy = falling - rising;
        if (gx * gx + gy * gy < SQUARED_LEAST) continue;
        line[x] = (struct fv_level_line){(int16_t)gy, (int16_t)-gx};
        s->starts[bin_of(line[x])]++;
    }
}

/* One row of gradients. Those of a row need the reduced row below it. */
static void gradient_row(const struct fv_segments *s, struct fv_segments_state *state,
                         const struct fv_kernels *kernels, const struct fv_plane *plane)
{
    const int32_t y = state->row++;
    if (y < s->rows) {
        const int32_t last = y / 4 * 5 + y % 4 + 1;
        for (; state->smoothed <= last; state->smoothed++)
            smooth_row(s, kernels, plane, state->smoothed);
        reduce_row(s, y);
    }
    if (y > 0) direct_row(s, y - 1);
}

/* ---- seeds ----------------------------------------------------------------------------------- */

/* From counts to where the pixels of each bin begin, the largest gradients first. */
static uint32_t order_bins(const struct fv_segments *s)
{
    uint32_t at = 0;
    for (int32_t bin = BINS - 1; bin >= 0; bin--) {
        const uint32_t count = s->starts[bin];
        s->starts[bin] = at;
        at += count;
    }
    return at;
}

static void sort_row(const struct fv_segments *s, int32_t y)
{
    const uint32_t first = (uint32_t)y * (uint32_t)s->columns;
    for (uint32_t i = first; i < first + (uint32_t)s->columns; i++)
        if (s->line[i].x != 0 || s->line[i].y != 0) s->seeds[s->starts[bin_of(s->line[i])]++] = i;
}

/* ---- segments -------------------------------------------------------------------------------- */

/* A place between the pixels of the reduced image's gradients, in pixels of the image: gradients
 * lie half a pixel after the pixel that they are numbered by. */
static float to_image(double at)
{
    return (float)((at + 1) * 1.25 - 0.5);
}

static void keep(const struct fv_segments *s, struct fv_segments_state *state,
                 const struct fv_rectangle *r)
{
    if (state->count >= s->config.count_max || (r->end - r->begin) * 1.25 < s->config.length_min_px)
        return;
    s->found[state->count++] = (struct fovea_segment){.x0_px = to_image(r->x + r->begin * r->dx),
                                                      .y0_px = to_image(r->y + r->begin * r->dy),
                                                      .x1_px = to_image(r->x + r->end * r->dx),
                                                      .y1_px = to_image(r->y + r->end * r->dy),
                                                      .width_px = (float)(r->width * 1.25)};
}

/* One seed; the visits that it took. */
static int64_t take_seed(const struct fv_segments *s, struct fv_segments_state *state)
{
    const int64_t before = state->visits_left;
    const uint32_t seed = s->seeds[state->seed++];
    struct fv_rectangle rectangle;
    state->visits_left -= SEED_VISITS;
    if (!s->used[seed] && fv_region_find(s, seed, &state->visits_left, &rectangle))
        keep(s, state, &rectangle);
    return before - state->visits_left;
}

bool fv_segments_advance(const struct fv_segments *s, struct fv_segments_state *state,
                         const struct fv_kernels *kernels, const struct fv_plane *plane,
                         int32_t pixels)
{
    int64_t left = pixels;
    for (; state->phase == GRADIENTS && left > 0; left -= s->width) {
        gradient_row(s, state, kernels, plane);
        if (state->row > s->rows)
            *state = (struct fv_segments_state){
                .phase = SORTING, .seeds = order_bins(s), .visits_left = state->visits_left};
    }
    for (; state->phase == SORTING && left > 0; left -= s->width) {
        sort_row(s, state->row++);
        if (state->row == s->rows) state->phase = REGIONS;
    }
    while (state->phase == REGIONS && left > 0) {
        if (state->seed == state->seeds || state->visits_left <= 0 ||
            state->count == s->config.count_max)
            state->phase = DONE;
        else
            left -= take_seed(s, state);
    }
    return state->phase == DONE;
}

/* ---- the public functions -------------------------------------------------------------------- */

/* With its kernels, at the start of the caller's memory. */
struct fovea_segments {
    struct fv_kernels kernels;
    struct fv_segments segments;
};

static struct fovea_segments *carve(const struct fovea_segments_config *config, int32_t width,
                                    int32_t height, struct fv_arena *arena)
{
    struct fovea_segments counted = {0};
    struct fovea_segments *made = fv_arena_take(arena, 1, sizeof *made);
    fv_segments_carve(made == NULL ? &counted.segments : &made->segments, config, width, height,
                      arena, arena);
    return made;
}

size_t fovea_segments_size(const struct fovea_segments_config *config, int32_t width,
                           int32_t height, struct fovea_error *error)
{
    struct fv_arena arena;
    if (check(config, width, height, error) != FOVEA_OK) return 0;
    fv_arena_count(&arena);
    carve(config, width, height, &arena);
    return arena.used;
}

enum fovea_status fovea_segments_init(struct fovea_segments **segments,
                                      const struct fovea_segments_config *config, int32_t width,
                                      int32_t height, void *memory, size_t bytes,
                                      struct fovea_error *error)
{
    struct fv_arena arena;
    enum fv_cpu_set set;
    const size_t needed = fovea_segments_size(config, width, height, error);
    if (needed == 0) return FOVEA_ERROR_ARGUMENT;
    enum fovea_status status = fv_arena_check_block(memory, bytes, needed, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&set, error);
    if (status != FOVEA_OK) return status;
    fv_arena_init(&arena, memory, bytes);
    struct fovea_segments *made = carve(config, width, height, &arena);
    fv_kernels_init(&made->kernels, set);
    *segments = made;
    return FOVEA_OK;
}

enum fovea_status fovea_segments_run(struct fovea_segments *segments,
                                     const struct fovea_image *image,
                                     struct fovea_segments_found *found)
{
    const struct fv_segments *s = &segments->segments;
    struct fv_segments_state state;
    if (fovea_image_check(image) != FOVEA_OK || image->format != FOVEA_PIXEL_GREY8 ||
        image->width != s->width || image->height != s->height)
        return FOVEA_ERROR_ARGUMENT;
    const struct fv_plane plane =
        fv_plane_of(image->data, image->width, image->height, image->stride_bytes);
    fv_segments_begin(s, &state);
    while (!fv_segments_advance(s, &state, &segments->kernels, &plane, INT32_MAX)) {
    }
    *found = (struct fovea_segments_found){.count = state.count, .list = s->found};
    return FOVEA_OK;
}
