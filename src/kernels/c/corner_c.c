#include "kernels/kernels.h"

const int8_t fv_corner_circle[2][16] = {{0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1},
                                        {3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1, 0, 1, 2, 3}};

/* The lowest and the highest level of each arc of nine, whose first eight are twice four. */
static uint8_t corner_score(const uint8_t *pixel, const ptrdiff_t offset[16])
{
    uint8_t level[24], low[24], high[24];
    int best = 0;
    for (int i = 0; i < 24; i++)
        low[i] = high[i] = level[i] = pixel[offset[i % 16]];
    for (int reach = 1; reach < 8; reach *= 2) {
        for (int i = 0; i + reach < 24; i++) {
            low[i] = low[i] < low[i + reach] ? low[i] : low[i + reach];
            high[i] = high[i] > high[i + reach] ? high[i] : high[i + reach];
        }
    }
    for (int i = 0; i < 16; i++) {
        const int lowest = low[i] < level[i + 8] ? low[i] : level[i + 8],
                  highest = high[i] > level[i + 8] ? high[i] : level[i + 8];
        if (lowest - *pixel > best) best = lowest - *pixel;
        if (*pixel - highest > best) best = *pixel - highest;
    }
    return (uint8_t)best;
}

void fv_k_corner_scores_u8__c(uint8_t *scores, const uint8_t *image, ptrdiff_t stride_bytes,
                              const int32_t *centres, int32_t count)
{
    ptrdiff_t offset[16];
    for (int i = 0; i < 16; i++)
        offset[i] = fv_corner_circle[1][i] * stride_bytes + fv_corner_circle[0][i];
    for (int32_t k = 0; k < count; k++)
        for (int v = 0; v < FV_CORNER_ROWS; v++)
            for (int u = 0; u < FV_CORNER_COLUMNS; u++)
                *scores++ =
                    corner_score(image + centres[k] + (v - 2) * stride_bytes + u - 2, offset);
}
