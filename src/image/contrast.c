/* Contrast-limited adaptive histogram equalization (Zuiderveld, Graphics Gems IV, 1994). */
#include "image/filters.h"

#include <stdbool.h>
#include <string.h>

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

void fv_contrast_set_limit(struct fv_contrast *contrast, double limit)
{
    const double clip = limit * contrast->tile_width * contrast->tile_height / 256;
    contrast->clip = limit > 0 ? (clip < 1 ? 1 : (int32_t)clip) : 0;
}

/* Tiles cover the plane and, where its sizes are no multiples of the tiles' number, up to one more
 * pixel per tile, reflected. */
void fv_contrast_carve(struct fv_contrast *contrast, int32_t width, int32_t height, int32_t tiles,
                       double limit, struct fv_arena *arena)
{
    const bool even = width % tiles == 0 && height % tiles == 0;
    const size_t count = (size_t)tiles;
    contrast->tiles = tiles;
    contrast->tile_width = even ? width / tiles : width / tiles + 1;
    contrast->tile_height = even ? height / tiles : height / tiles + 1;
    fv_contrast_set_limit(contrast, limit);
    contrast->tables = fv_arena_take_raw(arena, count * count, sizeof *contrast->tables);
    contrast->blended = fv_arena_take_raw(arena, count, sizeof *contrast->blended);
    contrast->weights = fv_arena_take_raw(arena, (size_t)width, sizeof *contrast->weights);
    contrast->counts = fv_arena_take_raw(arena, 4, sizeof *contrast->counts);
}

/* Position in tiles, centres at whole numbers, in 1/4096. */
static int32_t place(int32_t pixel, int32_t tile)
{
    return (int32_t)(((int64_t)pixel * 8192 / tile + 1) / 2) - 2048;
}

static int32_t tile_before(int32_t at)
{
    return (at + 4096) / 4096 - 1; /* rounded down; at >= -2048 */
}

void fv_contrast_prepare(struct fv_contrast *contrast, int32_t width)
{
    memset(contrast->ends, 0, sizeof contrast->ends);
    for (int32_t x = 0; x < width; x++) {
        const int32_t at = place(x, contrast->tile_width), before = tile_before(at);
        contrast->weights[x] = (uint16_t)(at - 4096 * before);
        contrast->ends[before + 1] = x + 1;
    }
}

/* Cut the histogram at the limit and spread what was cut off over all levels. */
static void limit_counts(uint32_t counts[256], uint32_t clip)
{
    uint32_t cut = 0;
    for (int i = 0; i < 256; i++) {
        cut += counts[i] > clip ? counts[i] - clip : 0;
        counts[i] = counts[i] > clip ? clip : counts[i];
    }
    uint32_t rest = cut % 256;
    for (int i = 0; i < 256; i++)
        counts[i] += cut / 256;
    const uint32_t step = rest == 0 || 256 / rest < 1 ? 1 : 256 / rest;
    for (uint32_t i = 0; i < 256 && rest > 0; i += step, rest--)
        counts[i]++;
}

/* Count a tile. Beyond the plane, pixels are reflected without repeating the edge. */
static void count_tile(struct fv_contrast *contrast, const struct fv_kernels *kernels,
                       const struct fv_plane *in, int32_t left, int32_t top)
{
    const int32_t inside = smaller(contrast->tile_width, in->width - left);
    memset(contrast->counts, 0, 4 * sizeof *contrast->counts);
    for (int32_t y = top; y < top + contrast->tile_height; y++) {
        const uint8_t *row = fv_plane_row(in, y < in->height ? y : 2 * (in->height - 1) - y);
        if (inside > 0) kernels->histogram_u8(contrast->counts, row + left, inside);
        for (int32_t x = left + (inside > 0 ? inside : 0); x < left + contrast->tile_width; x++)
            contrast->counts[0][row[2 * (in->width - 1) - x]]++;
    }
}

static void make_tables(struct fv_contrast *contrast, const struct fv_kernels *kernels,
                        const struct fv_plane *in)
{
    const float scale = 255.0f / (float)(contrast->tile_width * contrast->tile_height);
    for (int32_t i = 0; i < contrast->tiles * contrast->tiles; i++) {
        uint32_t *counts = contrast->counts[0], sum = 0;
        count_tile(contrast, kernels, in, i % contrast->tiles * contrast->tile_width,
                   i / contrast->tiles * contrast->tile_height);
        for (int k = 0; k < 256; k++)
            counts[k] += contrast->counts[1][k] + contrast->counts[2][k] + contrast->counts[3][k];
        if (contrast->clip > 0) limit_counts(counts, (uint32_t)contrast->clip);
        for (int k = 0; k < 256; k++) {
            sum += counts[k];
            contrast->tables[i][k] = fv_table_nearest((double)((float)sum * scale));
        }
    }
}

/* Tables of the tiles around a row of pixels, blended by its place between their centres, in 1/256
 * grey level. */
static void blend_tables(struct fv_contrast *contrast, const struct fv_kernels *kernels, int32_t y)
{
    const int32_t at = place(y, contrast->tile_height), above = tile_before(at);
    const int32_t top = above < 0 ? 0 : above, bottom = smaller(above + 1, contrast->tiles - 1);
    for (int32_t tile = 0; tile < contrast->tiles; tile++)
        kernels->contrast_blend_u16(
            contrast->blended[tile], contrast->tables[top * contrast->tiles + tile],
            contrast->tables[bottom * contrast->tiles + tile], at - 4096 * above);
}

void fv_contrast_run(struct fv_contrast *contrast, const struct fv_kernels *kernels,
                     const struct fv_plane *in, const struct fv_plane *out)
{
    make_tables(contrast, kernels, in);
    for (int32_t y = 0; y < in->height; y++) {
        blend_tables(contrast, kernels, y);
        for (int32_t i = 0, x = 0; i <= contrast->tiles; i++) {
            const int32_t left = i == 0 ? 0 : i - 1, right = smaller(i, contrast->tiles - 1);
            if (contrast->ends[i] <= x) continue;
            kernels->contrast_row_u8(fv_plane_row(out, y) + x, fv_plane_row(in, y) + x,
                                     contrast->ends[i] - x, contrast->blended[left],
                                     contrast->blended[right], contrast->weights + x);
            x = contrast->ends[i];
        }
    }
}
