#include "paint.h"

#include <string.h>

/* Noise of textures: octaves of lattice noise, painted row by row in strips of columns. Integers
 * alone: every processor paints the same. */

/* Lattice value in [-128, 127]: the finaliser of MurmurHash3 over the cell's coordinates. */
static int32_t lattice(int32_t x, int32_t y, uint32_t seed)
{
    uint32_t h = (uint32_t)x * 0x9E3779B1u ^ (uint32_t)y * 0x85EBCA77u ^ seed;
    h ^= h >> 16;
    h *= 0x85EBCA6Bu;
    h ^= h >> 13;
    h *= 0xC2B2AE35u;
    h ^= h >> 16;
    return (int32_t)(h & 255u) - 128;
}

enum { STRIP = 512, OCTAVES_MAX = 16, SPREAD = 16 };

/* Cells of one size, and what a strip of columns shows of a row of them. */
struct octave {
    int32_t size, amplitude; /* the latter at most 127 */
    uint32_t seed;
    int32_t first, count, at;                   /* cells; texels of the first before the strip */
    int16_t fade[STRIP];                        /* across a cell, for each texel */
    int16_t above[STRIP + 2], below[STRIP + 2]; /* values at the corners of each cell's left side */
};

/* Of one row of texels the value at the left side of each cell and the slope across it: by cell,
 * and given to each of its texels. */
struct cells {
    int16_t cell_value[STRIP + 2], cell_slope[STRIP + 2];
    int16_t value[SPREAD + STRIP + SPREAD], slope[SPREAD + STRIP + SPREAD];
};

/* Cubic fade between lattice values, 8-bit fractions. */
static int32_t fade(int32_t at, int32_t size)
{
    const int32_t f = (at % size) * 256 / size;
    return f * f * (768 - 2 * f) >> 16;
}

static void octave_begin(struct octave *o, int32_t x0, int32_t count)
{
    o->first = x0 / o->size;
    o->count = (x0 + count - 1) / o->size - o->first + 1;
    o->at = x0 - o->first * o->size;
    for (int32_t i = 0; i < count; i++)
        o->fade[i] = i < o->size ? (int16_t)fade(x0 + i, o->size) : o->fade[i - o->size];
}

FV_WIDE static void find_corners(int16_t *restrict corners, int32_t first, int32_t count,
                                 int32_t cy, uint32_t seed)
{
    for (int32_t k = 0; k < count; k++)
        corners[k] = (int16_t)lattice(first + k, cy, seed);
}

/* The corners about a row of texels; `top` is the first that is painted. */
static void octave_row_begin(struct octave *o, int32_t y, bool top)
{
    if (!top && y % o->size != 0) return;
    if (top)
        find_corners(o->above, o->first, o->count + 1, y / o->size, o->seed);
    else
        memcpy(o->above, o->below, (size_t)(o->count + 1) * sizeof o->above[0]);
    find_corners(o->below, o->first, o->count + 1, y / o->size + 1, o->seed);
}

FV_IN_WIDE void repeat(int16_t *restrict to, int16_t value)
{
    for (int32_t i = 0; i < SPREAD; i++)
        to[i] = value;
}

FV_IN_WIDE void find_values(const struct octave *o, struct cells *c, int32_t down)
{
    const int16_t *above = o->above, *below = o->below;
    for (int32_t k = 0; k < o->count; k++) {
        const int32_t here = above[k] * 256 + (below[k] - above[k]) * down,
                      next = above[k + 1] * 256 + (below[k + 1] - above[k + 1]) * down;
        c->cell_value[k] = (int16_t)here;
        c->cell_slope[k] = (int16_t)((next - here) / 256);
    }
}

/* Give what each cell has to its texels, the first cell's from `at` texels before the strip on.
 * SPREAD texels are written at once: what is too much the next cell overwrites. Most cells have 2
 * or 4 texels, which vectors spread many at a time. */
FV_IN_WIDE void spread(int16_t *restrict texels, const int16_t *restrict cells, int32_t count,
                       int32_t size, int32_t at)
{
    int16_t *to = texels + SPREAD - at;
    if (size == 2) {
        for (int32_t k = 0; k < count; k++)
            to[2 * k] = to[2 * k + 1] = cells[k];
        return;
    }
    if (size == 4) {
        for (int32_t k = 0; k < count; k++)
            to[4 * k] = to[4 * k + 1] = to[4 * k + 2] = to[4 * k + 3] = cells[k];
        return;
    }
    if (size <= SPREAD) {
        for (int32_t k = 0; k < count; k++)
            repeat(to + k * size, cells[k]);
        return;
    }
    for (int32_t k = 0; k < count; k++) {
        const int32_t begin = SPREAD + k * size - at, end = begin + size;
        for (int32_t i = begin < 0 ? 0 : begin; i < end && i < SPREAD + STRIP; i += SPREAD)
            repeat(texels + i, cells[k]);
    }
}

/* One row of texels, added in units of 1/256 grey level. What is between two lattice values fits in
 * 16 bits, though the product may not. */
FV_WIDE static void octave_row(const struct octave *o, int32_t *restrict sum, int32_t count,
                               int32_t down)
{
    struct cells c;
    const int16_t *value = c.value + SPREAD, *slope = c.slope + SPREAD;
    const int16_t amplitude = (int16_t)o->amplitude;
    find_values(o, &c, down);
    spread(c.value, c.cell_value, o->count, o->size, o->at);
    spread(c.slope, c.cell_slope, o->count, o->size, o->at);
    for (int32_t i = 0; i < count; i++) {
        const int16_t here = (int16_t)(value[i] + (int16_t)(slope[i] * o->fade[i]));
        sum[i] += (int16_t)((int16_t)(here / 128) * amplitude);
    }
}

/* Cells from `cell` texels down to `finest`, each octave `fall`/256 of the one before. Returns how
 * many there are. */
static int32_t make_octaves(struct octave octaves[OCTAVES_MAX], int32_t cell, int32_t finest,
                            int32_t amplitude, int32_t fall, uint32_t seed)
{
    int32_t count = 0;
    for (int32_t size = cell; size >= finest && amplitude > 0 && count < OCTAVES_MAX; size /= 2) {
        octaves[count].size = size;
        octaves[count].amplitude = amplitude;
        octaves[count++].seed = seed + (uint32_t)size * 0x27D4EB2Fu;
        amplitude = amplitude * fall / 256;
    }
    return count;
}

FV_WIDE static void add_noise(uint8_t *restrict row, const int32_t *restrict sum, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        row[i] = (uint8_t)fv_sim_clamp(row[i] + sum[i] / 256, 0, 255);
}

/* One strip, row by row, while the row's sums are at hand. */
static void paint_strip(struct fv_sim_brush *brush, struct octave *octaves, int32_t octave_count,
                        int32_t left, int32_t count, int32_t y0, int32_t y1)
{
    int32_t sum[STRIP];
    for (int32_t i = 0; i < octave_count; i++)
        octave_begin(&octaves[i], left, count);
    for (int32_t y = y0; y < y1; y++) {
        memset(sum, 0, (size_t)count * sizeof *sum);
        for (int32_t i = 0; i < octave_count; i++) {
            octave_row_begin(&octaves[i], y, y == y0);
            octave_row(&octaves[i], sum, count, fade(y, octaves[i].size));
        }
        add_noise(brush->texels + (size_t)y * (size_t)brush->stride + left, sum, count);
    }
}

void fv_sim_noise(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                  int32_t cell, int32_t finest, int32_t amplitude, int32_t fall)
{
    struct octave octaves[OCTAVES_MAX];
    const int32_t octave_count = make_octaves(octaves, cell, finest < 1 ? 1 : finest, amplitude,
                                              fall, fv_random_u32(&brush->random));
    x0 = fv_sim_clamp(x0, 0, brush->width);
    x1 = fv_sim_clamp(x1, 0, brush->width);
    y0 = fv_sim_clamp(y0, 0, brush->height);
    y1 = fv_sim_clamp(y1, 0, brush->height);
    for (int32_t left = x0; left < x1; left += STRIP)
        paint_strip(brush, octaves, octave_count, left, left + STRIP < x1 ? STRIP : x1 - left, y0,
                    y1);
}
