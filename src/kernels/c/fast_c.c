#include "kernels/kernels.h"

#include <string.h>

/* The circle, from the top clockwise. */
static const int8_t circle[16][2] = {{0, -3}, {1, -3},  {2, -2},  {3, -1}, {3, 0},  {3, 1},
                                     {2, 2},  {1, 3},   {0, 3},   {-1, 3}, {-2, 2}, {-3, 1},
                                     {-3, 0}, {-3, -1}, {-2, -2}, {-1, -3}};

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

enum { STRETCH = 64 }; /* pixels looked at together, so that the compiler can use vectors */

/* Nine contiguous pixels hold at least one of every opposite pair: those of a corner are brighter
 * than `low`, the least of the pairs' brighter ones, or darker than `high`, the most of the darker
 * ones. Not inlined: GCC would exchange the loops and use no vectors. */
__attribute__((noinline)) static void take_pair(uint8_t *restrict low, uint8_t *restrict high,
                                                const uint8_t *restrict a,
                                                const uint8_t *restrict b, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const uint8_t p = a[i], q = b[i], most = p > q ? p : q, least = p < q ? p : q,
                      low_before = low[i], high_before = high[i];
        low[i] = most < low_before ? most : low_before;
        high[i] = least > high_before ? least : high_before;
    }
}

/* One more than the largest threshold: over all arcs, the best of the arc's weakest pixel. An arc
 * of nine is one of eight, which is twice four, and a pixel. */
static int32_t strength(const uint8_t *pixel, const ptrdiff_t offset[16])
{
    uint8_t level[24], low[24], high[24];
    int32_t best = 0;
    for (int i = 0; i < 24; i++)
        low[i] = high[i] = level[i] = pixel[offset[i & 15]];
    for (int reach = 1; reach < 8; reach *= 2) {
        for (int i = 0; i + reach < 24; i++) {
            low[i] = low[i] < low[i + reach] ? low[i] : low[i + reach];
            high[i] = high[i] > high[i + reach] ? high[i] : high[i + reach];
        }
    }
    for (int i = 0; i < 16; i++) {
        const int32_t last = level[i + 8];
        best = larger(best, smaller(low[i], last) - *pixel);
        best = larger(best, *pixel - larger(high[i], last));
    }
    return best;
}

void fv_k_fast_score_u8__c(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                           const uint8_t *thresholds, int32_t count)
{
    ptrdiff_t offset[16];
    for (int k = 0; k < 16; k++)
        offset[k] = circle[k][0] + circle[k][1] * stride_bytes;
    for (int32_t begin = 0; begin < count; begin += STRETCH) {
        const int32_t stretch = count - begin < STRETCH ? count - begin : STRETCH;
        uint8_t low[STRETCH], high[STRETCH];
        memset(low, 255, sizeof low);
        memset(high, 0, sizeof high);
        for (int k = 0; k < 8; k++)
            take_pair(low, high, pixels + begin + offset[k], pixels + begin + offset[k + 8],
                      stretch);
        for (int32_t i = 0; i < stretch; i++) {
            const uint8_t *pixel = pixels + begin + i;
            const int32_t threshold = thresholds[begin + i];
            scores[begin + i] = 0;
            if (low[i] <= *pixel + threshold && high[i] >= *pixel - threshold) continue;
            const int32_t best = strength(pixel, offset);
            if (best > threshold) scores[begin + i] = (uint8_t)(best - 1);
        }
    }
}

int32_t fv_k_fast_peaks_u8__c(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                              const uint8_t *below, int32_t from, int32_t to)
{
    int32_t found = 0;
    for (int32_t x = from; x < to; x++) {
        if (row[x] == 0) continue;
        int32_t around = larger(row[x - 1], row[x + 1]);
        for (int32_t dx = -1; dx <= 1; dx++)
            around = larger(around, larger(above[x + dx], below[x + dx]));
        if (row[x] > around) columns[found++] = (uint16_t)x;
    }
    return found;
}
