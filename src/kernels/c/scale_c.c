#include "kernels/kernels.h"

static inline uint32_t part(uint32_t value, uint32_t weight)
{
    return value * weight >> 16;
}

void fv_k_scale_blur_row_u16__c(uint16_t *out, const uint16_t *const *rows, int32_t width,
                                const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    uint16_t *column = scratch + FV_SCALE_PAD;
    const uint32_t rounding = (uint32_t)(radius + 1) / 2;
    for (int32_t x = 0; x < width; x++) {
        uint32_t sum = rounding + part(rows[radius][x], weights[0]);
        for (int32_t i = 1; i <= radius; i++)
            sum += part((uint32_t)rows[radius - i][x] + rows[radius + i][x], weights[i]);
        column[x] = (uint16_t)sum;
    }
    for (int32_t i = 1; i <= radius; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0; x < width; x++) {
        uint32_t sum = rounding + part(column[x], weights[0]);
        for (int32_t i = 1; i <= radius; i++)
            sum += part((uint32_t)column[x - i] + column[x + i], weights[i]);
        out[x] = (uint16_t)(sum < FV_SCALE_WHITE ? sum : FV_SCALE_WHITE);
    }
}

static inline int32_t difference(const uint16_t *const *rows, int32_t l, int32_t row, int32_t x)
{
    return rows[3 * (l + 1) + row][x] - rows[3 * l + row][x];
}

/* Largest and smallest of the nine differences around x. */
static void range_of(const uint16_t *const *rows, int32_t l, int32_t x, int32_t *most,
                     int32_t *least)
{
    *most = *least = difference(rows, l, 1, x);
    for (int32_t row = 0; row < 3; row++)
        for (int32_t i = x - 1; i <= x + 1; i++) {
            const int32_t d = difference(rows, l, row, i);
            if (d > *most) *most = d;
            if (d < *least) *least = d;
        }
}

void fv_k_scale_peaks_row_u16__c(uint16_t *marks, const uint16_t *const *rows, int32_t width,
                                 int32_t threshold, int16_t *scratch)
{
    (void)scratch;
    marks[0] = marks[width - 1] = 0;
    for (int32_t x = 1; x < width - 1; x++) {
        marks[x] = 0;
        for (int32_t k = 0; k < 3; k++) {
            const int32_t d = difference(rows, k + 1, 1, x);
            if (d <= threshold && d >= -threshold) continue;
            int32_t most[3], least[3];
            for (int32_t i = 0; i < 3; i++)
                range_of(rows, k + i, x, &most[i], &least[i]);
            const int peak = d > 0 && d >= most[0] && d >= most[1] && d >= most[2];
            const int pit = d < 0 && d <= least[0] && d <= least[1] && d <= least[2];
            if (peak || pit) marks[x] = (uint16_t)(marks[x] | 1u << k);
        }
    }
}
