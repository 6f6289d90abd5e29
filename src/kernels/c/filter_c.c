#define FV_NAME(kernel) fv_k_##kernel##__c
#include "kernels/filter_loops.h"

/* The compiler makes one of it for each radius. */
static inline void gauss_row(uint8_t *restrict out, const uint8_t *const *rows, int32_t width,
                             const uint16_t *weights, int32_t radius, uint16_t *restrict scratch)
{
    uint16_t *column = scratch + FV_GAUSS_RADIUS_MAX; /* sums down the columns: at most 255 * 256 */
    const uint8_t *row[2 * FV_GAUSS_RADIUS_MAX + 1];
    uint32_t weight[FV_GAUSS_RADIUS_MAX + 1];
    for (int32_t i = 0; i <= 2 * radius; i++)
        row[i] = rows[i];
    for (int32_t i = 0; i <= radius; i++)
        weight[i] = weights[i];
    for (int32_t x = 0; x < width; x++) {
        uint32_t sum = weight[0] * row[radius][x];
        for (int32_t i = 1; i <= radius; i++)
            sum += weight[i] * (uint32_t)(row[radius - i][x] + row[radius + i][x]);
        column[x] = (uint16_t)sum;
    }
    for (int32_t i = 1; i <= radius; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0; x < width; x++) {
        uint32_t sum = 32768 + weight[0] * column[x];
        for (int32_t i = 1; i <= radius; i++)
            sum += weight[i] * (uint32_t)(column[x - i] + column[x + i]);
        out[x] = (uint8_t)(sum >> 16);
    }
}

void fv_k_gauss_row_u8__c(uint8_t *out, const uint8_t *const *rows, int32_t width,
                          const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    if (radius == 1)
        gauss_row(out, rows, width, weights, 1, scratch);
    else if (radius == 2)
        gauss_row(out, rows, width, weights, 2, scratch);
    else
        gauss_row(out, rows, width, weights, 3, scratch);
}

void fv_k_mix_u8__c(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count, int32_t weight)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t mixed = (weight * a[i] + (256 - weight) * b[i] + 128) >> 8;
        out[i] = (uint8_t)(mixed < 0 ? 0 : mixed > 255 ? 255 : mixed);
    }
}

void fv_k_line_u8__c(uint8_t *out, const uint8_t *in, int32_t count, float factor, float offset)
{
    for (int32_t i = 0; i < count; i++) {
        const float product = (float)in[i] * factor, line = product + offset;
        const float clamped = line > 255 ? 255 : line > 0 ? line : 0;
        const int32_t below = (int32_t)clamped;
        const float apart = clamped - (float)below;
        const int32_t up = apart > .5f || (apart == .5f && below % 2 != 0);
        out[i] = (uint8_t)(below + up);
    }
}

void fv_k_contrast_blend_u16__c(uint16_t *restrict out, const uint8_t *a, const uint8_t *b,
                                int32_t weight)
{
    for (int32_t i = 0; i < 256; i++)
        out[i] = (uint16_t)((a[i] * (4096 - weight) + b[i] * weight + 8) >> 4);
}

void fv_k_histogram_u8__c(uint32_t counts[4][256], const uint8_t *in, int32_t count)
{
    int32_t i = 0;
    for (; i + 4 <= count; i += 4) { /* four tables: equal neighbours do not wait for each other */
        counts[0][in[i]]++;
        counts[1][in[i + 1]]++;
        counts[2][in[i + 2]]++;
        counts[3][in[i + 3]]++;
    }
    for (; i < count; i++)
        counts[0][in[i]]++;
}

static inline int32_t reflected(int32_t x, int32_t width)
{
    if (x < 0) return -x;
    return x < width ? x : 2 * (width - 1) - x;
}

void fv_k_bilateral_row_u8__c(uint8_t *out, const uint8_t *const *rows, int32_t width,
                              const uint16_t weights[3][256])
{
    static const int8_t taps[12][3] = {{-1, 0, 0},  {1, 0, 0},  {0, -1, 0}, {0, 1, 0},
                                       {-1, -1, 1}, {1, -1, 1}, {-1, 1, 1}, {1, 1, 1},
                                       {-2, 0, 2},  {2, 0, 2},  {0, -2, 2}, {0, 2, 2}};
    for (int32_t x = 0; x < width; x++) {
        const int32_t centre = rows[2][x];
        uint32_t norm = FV_BILATERAL_WEIGHT_MAX;
        uint32_t sum = norm * (uint32_t)centre;
        for (int i = 0; i < 12; i++) {
            const int32_t p = rows[2 + taps[i][1]][reflected(x + taps[i][0], width)];
            const uint32_t w = weights[taps[i][2]][p < centre ? centre - p : p - centre];
            norm += w;
            sum += w * (uint32_t)p;
        }
        out[x] = (uint8_t)((sum + norm / 2) / norm);
    }
}

void fv_k_contrast_row_u8__c(uint8_t *out, const uint8_t *in, int32_t count,
                             const uint16_t left[256], const uint16_t right[256],
                             const uint16_t *weights)
{
    for (int32_t i = 0; i < count; i++) {
        const uint32_t a = left[in[i]], b = right[in[i]], w = weights[i];
        out[i] = (uint8_t)((a * (4096 - w) + b * w + (1u << 19)) >> 20);
    }
}
