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

/* Nine contiguous pixels hold at least one of every opposite pair: most pixels fail here. */
static bool may_be_corner(const int32_t difference[16], int32_t threshold)
{
    bool brighter = true, darker = true;
    for (int k = 0; k < 8; k++) {
        brighter &= larger(difference[k], difference[k + 8]) > threshold;
        darker &= smaller(difference[k], difference[k + 8]) < -threshold;
    }
    return brighter || darker;
}

/* One more than the largest threshold: over all arcs, the best of the arc's weakest pixel. */
static int32_t strength(const int32_t difference[16])
{
    int32_t best = 0;
    for (int start = 0; start < 16; start++) {
        int32_t low = 255, high = -255;
        for (int k = 0; k < 9; k++) {
            low = smaller(low, difference[(start + k) & 15]);
            high = larger(high, difference[(start + k) & 15]);
        }
        best = larger(best, larger(low, -high));
    }
    return best;
}

void fv_k_fast_score_u8__c(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                           int32_t count, int32_t threshold)
{
    for (int32_t i = 0; i < count; i++) {
        int32_t difference[16];
        for (int k = 0; k < 16; k++)
            difference[k] = pixels[i + circle[k][0] + circle[k][1] * stride_bytes] - pixels[i];
        scores[i] = 0;
        if (!may_be_corner(difference, threshold)) continue;
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
