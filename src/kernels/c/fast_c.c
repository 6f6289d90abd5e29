#include "kernels/kernels.h"

#include <stdbool.h>

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

/* Nine contiguous pixels hold at least one of every opposite pair: most pixels fail here, of these
 * most at the first pair or the second. */
static bool may_be_corner(const uint8_t *pixel, const ptrdiff_t offset[16], int32_t threshold)
{
    static const uint8_t order[8] = {0, 4, 2, 6, 1, 3, 5, 7};
    const int32_t bright = *pixel + threshold, dark = *pixel - threshold;
    bool brighter = true, darker = true;
    for (int k = 0; k < 8 && (brighter || darker); k++) {
        const int32_t a = pixel[offset[order[k]]], b = pixel[offset[order[k] + 8]];
        brighter &= larger(a, b) > bright;
        darker &= smaller(a, b) < dark;
    }
    return brighter || darker;
}

/* One more than the largest threshold: over all arcs, the best of the arc's weakest pixel. An arc
 * of nine is one of eight, which is twice four, and a pixel. */
static int32_t strength(const int32_t difference[16])
{
    int32_t low[24], high[24], best = 0;
    for (int i = 0; i < 24; i++)
        low[i] = high[i] = difference[i & 15];
    for (int reach = 1; reach < 8; reach *= 2) {
        for (int i = 0; i + reach < 24; i++) {
            low[i] = smaller(low[i], low[i + reach]);
            high[i] = larger(high[i], high[i + reach]);
        }
    }
    for (int i = 0; i < 16; i++) {
        const int32_t last = difference[(i + 8) & 15];
        best = larger(best, larger(smaller(low[i], last), -larger(high[i], last)));
    }
    return best;
}

void fv_k_fast_score_u8__c(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                           int32_t count, int32_t threshold)
{
    ptrdiff_t offset[16];
    for (int k = 0; k < 16; k++)
        offset[k] = circle[k][0] + circle[k][1] * stride_bytes;
    for (int32_t i = 0; i < count; i++) {
        int32_t difference[16];
        scores[i] = 0;
        if (!may_be_corner(pixels + i, offset, threshold)) continue;
        for (int k = 0; k < 16; k++)
            difference[k] = pixels[i + offset[k]] - pixels[i];
        const int32_t best = strength(difference);
        if (best > threshold) scores[i] = (uint8_t)(best - 1);
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
