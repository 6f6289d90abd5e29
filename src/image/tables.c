/* Operations that map grey levels by one table, and how the table follows from the plane. */
#include "image/filters.h"

#include <stdbool.h>
#include <string.h>

#include "base/elementary.h"

void fv_histogram_count(uint32_t counts[4][256], const struct fv_kernels *kernels,
                        const struct fv_plane *plane)
{
    memset(counts, 0, 4 * 256 * sizeof counts[0][0]);
    for (int32_t y = 0; y < plane->height; y++)
        kernels->histogram_u8(counts, fv_plane_row(plane, y), plane->width);
}

void fv_table_run(const uint8_t table[256], const struct fv_kernels *kernels,
                  const struct fv_plane *in, const struct fv_plane *out)
{
    for (int32_t y = 0; y < in->height; y++)
        kernels->nn_table_u8(table, fv_plane_row(in, y), fv_plane_row(out, y), in->width);
}

static uint32_t count_of(const uint32_t counts[4][256], int level)
{
    return counts[0][level] + counts[1][level] + counts[2][level] + counts[3][level];
}

uint8_t fv_table_nearest(double grey)
{
    if (!(grey > 0)) return 0;
    if (grey >= 255) return 255;
    const double below = fv_floor(grey), rest = grey - below;
    const uint8_t level = (uint8_t)below;
    return (uint8_t)(level + (rest > .5 || (rest == .5 && level % 2 == 1)));
}

void fv_table_equalize(uint8_t table[256], const uint32_t counts[4][256])
{
    uint32_t total = 0, sum = 0;
    int first = 0;
    for (int i = 0; i < 256; i++)
        total += count_of(counts, i);
    while (first < 255 && count_of(counts, first) == 0)
        first++;
    const uint32_t others = total - count_of(counts, first);
    for (int i = 0; i < 256; i++)
        table[i] = (uint8_t)(others == 0 ? i : 0);
    if (others == 0) return; /* of one level: stays as it is */
    const float scale = 255.0f / (float)others;
    for (int i = first + 1; i < 256; i++) {
        sum += count_of(counts, i);
        table[i] = fv_table_nearest((double)((float)sum * scale));
    }
}

/* Grey levels times a factor plus an offset, rounded to a float and then to a level, as OpenCV's
 * convertTo does with a fused multiplication. */
static struct fv_line table_line(uint8_t table[256], double factor, double offset)
{
    const double a = (double)(float)factor, b = (double)(float)offset;
    for (int i = 0; i < 256; i++)
        table[i] = fv_table_nearest((double)(float)(i * a + b));
    return (struct fv_line){(float)factor, (float)offset};
}

/* The table rounds a line once, the kernel product and sum: an offset a little off may be needed.
 */
static bool same_line(const uint8_t table[256], const struct fv_kernels *kernels, float factor,
                      float offset)
{
    uint8_t grey[256], found[256];
    for (int i = 0; i < 256; i++)
        grey[i] = (uint8_t)i;
    kernels->line_u8(found, grey, 256, factor, offset);
    return memcmp(found, table, sizeof found) == 0;
}

void fv_line_run(const struct fv_line *line, const uint8_t table[256],
                 const struct fv_kernels *kernels, const struct fv_plane *in,
                 const struct fv_plane *out)
{
    static const float off[] = {0, 4e-6f, -4e-6f, 1e-5f, -1e-5f};
    const uint32_t looked_up_faster = FV_ISA_AVX512ICL; /* by bytes in registers */
    bool same = false;
    float offset = line->offset;
    if ((kernels->isas & (FV_ISA_AVX2 | looked_up_faster)) == FV_ISA_AVX2)
        for (size_t i = 0; !same && i < sizeof off / sizeof off[0]; i++) {
            offset = line->offset + off[i];
            same = same_line(table, kernels, line->factor, offset);
        }
    if (!same) {
        fv_table_run(table, kernels, in, out);
        return;
    }
    for (int32_t y = 0; y < in->height; y++)
        kernels->line_u8(fv_plane_row(out, y), fv_plane_row(in, y), in->width, line->factor,
                         offset);
}

struct fv_line fv_table_range(uint8_t table[256], const struct fv_kernels *kernels,
                              const struct fv_plane *plane, int32_t low, int32_t high)
{
    uint8_t range[2] = {255, 0};
    for (int32_t y = 0; y < plane->height; y++)
        kernels->range_u8(range, fv_plane_row(plane, y), plane->width);
    const double scale = range[1] > range[0] ? (high - low) * (1.0 / (range[1] - range[0])) : 0;
    return table_line(table, scale, low - range[0] * scale);
}

/* Square root by Newton's iteration from above; value >= 0. */
static double root(double value)
{
    double r = value > 1 ? value : 1;
    for (int i = 0; i < 40; i++)
        r = .5 * (r + value / r);
    return r;
}

struct fv_line fv_table_deviation(uint8_t table[256], const uint32_t counts[4][256], double mean,
                                  double deviation)
{
    double count = 0, sum = 0, squares = 0;
    for (int i = 0; i < 256; i++) {
        const double n = count_of(counts, i);
        count += n;
        sum += n * i;
        squares += n * i * i;
    }
    const double centre = sum / count, variance = squares / count - centre * centre;
    const double scale = variance > 1e-6 ? deviation / root(variance) : 0;
    return table_line(table, scale, mean - centre * scale);
}

void fv_table_gamma(uint8_t table[256], double gamma)
{
    table[0] = 0;
    for (int i = 1; i < 256; i++)
        table[i] = fv_table_nearest(255 * fv_pow(i / 255.0, gamma));
}
