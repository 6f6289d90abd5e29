#include "sim.h"

#include <stdlib.h>
#include <string.h>

/* Level 0 is the base, level 1 is 5/7 of it (area-weighted), and every further one halves the one
 * two before it. So the scales are exact rationals close to 2^(-l/2), and all of it is integer
 * arithmetic. */
static int32_t level_size(int32_t base, int32_t level)
{
    int64_t size = (level & 1) ? ((int64_t)base * 5 + 6) / 7 : base;
    for (int32_t i = level / 2; i > 0; i--)
        size = (size + 1) / 2;
    return (int32_t)(size < 2 ? 2 : size);
}

static int32_t level_count(int32_t width, int32_t height)
{
    const int32_t small = width < height ? width : height;
    int32_t count = 1;
    while (count < FV_SIM_LEVELS_MAX && level_size(small, count) >= 3)
        count++;
    return count;
}

bool fv_sim_texture_create(struct fv_sim_texture *texture, int32_t width, int32_t height)
{
    memset(texture, 0, sizeof *texture);
    texture->width = width;
    texture->height = height;
    /* A hair inside, so that rounding in the level's scale cannot step past the doubled texel. */
    texture->u_max = (float)width - 1.0f / 64.0f;
    texture->v_max = (float)height - 1.0f / 64.0f;
    texture->level_count = level_count(width, height);
    for (int32_t l = 0; l < texture->level_count; l++)
        texture->bytes += (size_t)(level_size(width, l) + 1) * (size_t)(level_size(height, l) + 1);
    texture->texels = calloc(texture->bytes + 16, 1);
    if (texture->texels == NULL) return false;
    size_t offset = 0;
    for (int32_t l = 0; l < texture->level_count; l++) {
        struct fv_sim_level *level = &texture->level[l];
        level->texels = texture->texels + offset;
        level->width = level_size(width, l);
        level->height = level_size(height, l);
        level->stride = level->width + 1;
        offset += (size_t)level->stride * (size_t)(level->height + 1);
    }
    return true;
}

enum { GROUPS = 64 }; /* of seven source texels, which make five, in a part of a row */

/* Weights, in fifths of a source texel, of the (up to three) source texels under target texel i of
 * a 7:5 reduction. */
static int32_t seven_to_five(int32_t i, int32_t weight[3])
{
    const int32_t begin = 7 * i, end = begin + 7, first = begin / 5;
    for (int32_t k = 0; k < 3; k++) {
        const int32_t low = fv_sim_clamp(5 * (first + k), begin, end),
                      high = fv_sim_clamp(5 * (first + k + 1), begin, end);
        weight[k] = high - low;
    }
    return first;
}

/* Rows a, b and c weighted, from x0 on; beyond the end the last texel again. */
FV_WIDE static void weigh_rows(int32_t *restrict sum, const uint8_t *const row[3],
                               const int32_t weight[3], int32_t x0, int32_t width)
{
    const int32_t inside = width - x0 < 7 * GROUPS + 2 ? width - x0 : 7 * GROUPS + 2;
    const uint8_t *a = row[0] + x0, *b = row[1] + x0, *c = row[2] + x0;
    const int32_t wa = weight[0], wb = weight[1], wc = weight[2];
    for (int32_t i = 0; i < inside; i++)
        sum[i] = wa * a[i] + wb * b[i] + wc * c[i];
    for (int32_t i = inside; i < 7 * GROUPS + 2; i++)
        sum[i] = sum[inside - 1];
}

/* Groups of texels of a row, of which each takes five from seven sums. */
FV_WIDE static void reduce_groups(uint8_t *restrict out, const int32_t *restrict sum,
                                  int32_t groups)
{
    for (int32_t i = 0; i < groups; i++) {
        const int32_t *s = sum + 7 * i;
        uint8_t *to = out + 5 * i;
        to[0] = (uint8_t)((5 * s[0] + 2 * s[1] + 24) / 49);
        to[1] = (uint8_t)((3 * s[1] + 4 * s[2] + 24) / 49);
        to[2] = (uint8_t)((s[2] + 5 * s[3] + s[4] + 24) / 49);
        to[3] = (uint8_t)((4 * s[4] + 3 * s[5] + 24) / 49);
        to[4] = (uint8_t)((2 * s[5] + 5 * s[6] + 24) / 49);
    }
}

static void reduce_seven_to_five(const struct fv_sim_level *from, struct fv_sim_level *to)
{
    int32_t sum[7 * GROUPS + 2], weight[3];
    uint8_t part[5 * GROUPS];
    for (int32_t y = 0; y < to->height; y++) {
        uint8_t *out = (uint8_t *)to->texels + (size_t)y * (size_t)to->stride;
        const int32_t y0 = seven_to_five(y, weight);
        const uint8_t *row[3];
        for (int32_t j = 0; j < 3; j++)
            row[j] = from->texels +
                     (size_t)fv_sim_clamp(y0 + j, 0, from->height - 1) * (size_t)from->stride;
        for (int32_t x = 0; x < to->width; x += 5 * GROUPS) {
            const int32_t count = to->width - x < 5 * GROUPS ? to->width - x : 5 * GROUPS;
            weigh_rows(sum, row, weight, x / 5 * 7, from->width);
            reduce_groups(part, sum, (count + 4) / 5);
            memcpy(out + x, part, (size_t)count);
        }
    }
}

FV_WIDE static void halve_row(uint8_t *restrict out, const uint8_t *restrict a,
                              const uint8_t *restrict b, int32_t count)
{
    for (int32_t x = 0; x < count; x++)
        out[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) / 4);
}

static void reduce_half(const struct fv_sim_level *from, struct fv_sim_level *to)
{
    const int32_t last = from->width - 1, whole = from->width / 2;
    for (int32_t y = 0; y < to->height; y++) {
        uint8_t *out = (uint8_t *)to->texels + (size_t)y * (size_t)to->stride;
        const uint8_t *a =
            from->texels + (size_t)fv_sim_clamp(2 * y, 0, from->height - 1) * (size_t)from->stride;
        const uint8_t *b = from->texels + (size_t)fv_sim_clamp(2 * y + 1, 0, from->height - 1) *
                                              (size_t)from->stride;
        halve_row(out, a, b, whole < to->width ? whole : to->width);
        for (int32_t x = whole; x < to->width; x++)
            out[x] = (uint8_t)((2 * a[last] + 2 * b[last] + 2) / 4);
    }
}

static void double_last(struct fv_sim_level *level)
{
    uint8_t *texels = (uint8_t *)level->texels;
    const size_t stride = (size_t)level->stride;
    for (int32_t y = 0; y < level->height; y++)
        texels[(size_t)y * stride + stride - 1] = texels[(size_t)y * stride + stride - 2];
    memcpy(texels + (size_t)level->height * stride, texels + (size_t)(level->height - 1) * stride,
           stride);
}

void fv_sim_texture_finish(struct fv_sim_texture *texture)
{
    for (int32_t l = 1; l < texture->level_count; l++) {
        if (l == 1)
            reduce_seven_to_five(&texture->level[0], &texture->level[1]);
        else
            reduce_half(&texture->level[l - 2], &texture->level[l]);
    }
    for (int32_t l = 0; l < texture->level_count; l++)
        double_last(&texture->level[l]);
}

void fv_sim_texture_free(struct fv_sim_texture *texture)
{
    free(texture->texels);
    memset(texture, 0, sizeof *texture);
}
