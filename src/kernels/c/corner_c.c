#include "kernels/kernels.h"

const int8_t fv_corner_circle[2][16] = {{0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1},
                                        {3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1, 0, 1, 2, 3}};

static uint8_t corner_score(const uint8_t *pixel, ptrdiff_t stride_bytes)
{
    int best = 0;
    for (int start = 0; start < 16; start++) {
        int lowest = 255, highest = 0; /* of the arc of nine */
        for (int i = start; i < start + 9; i++) {
            const int level =
                pixel[fv_corner_circle[1][i % 16] * stride_bytes + fv_corner_circle[0][i % 16]];
            if (level < lowest) lowest = level;
            if (level > highest) highest = level;
        }
        if (lowest - *pixel > best) best = lowest - *pixel;
        if (*pixel - highest > best) best = *pixel - highest;
    }
    return (uint8_t)best;
}

void fv_k_corner_scores_u8__c(uint8_t *scores, const uint8_t *image, ptrdiff_t stride_bytes,
                              const int32_t *centres, int32_t count)
{
    for (int32_t k = 0; k < count; k++)
        for (int v = 0; v < FV_CORNER_ROWS; v++)
            for (int u = 0; u < FV_CORNER_COLUMNS; u++)
                *scores++ =
                    corner_score(image + centres[k] + (v - 2) * stride_bytes + u - 2, stride_bytes);
}
