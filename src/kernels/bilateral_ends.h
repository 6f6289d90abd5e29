/* What the variants of fv_k_bilateral_row_u8 for vectors share.
 *
 * All divide in float and round down: (sum + norm / 2) / norm is exact so, since the sum is below
 * 2^23 and the norm below 2^15, so that a quotient that is not whole lies further from the next
 * whole one than it is rounded. */
#ifndef FOVEA_KERNELS_BILATERAL_ENDS_H
#define FOVEA_KERNELS_BILATERAL_ENDS_H

#include "kernels/kernels.h"

/* The two columns on either side, by a row of eight with their neighbours. */
static inline void bilateral_ends(uint8_t *out, const uint8_t *const *rows, int32_t width,
                                  const uint16_t weights[3][256])
{
    uint8_t eight[8];
    const uint8_t *right[5];
    for (int i = 0; i < 5; i++)
        right[i] = rows[i] + width - 8;
    fv_k_bilateral_row_u8__c(eight, rows, 8, weights);
    out[0] = eight[0];
    out[1] = eight[1];
    fv_k_bilateral_row_u8__c(eight, right, 8, weights);
    out[width - 2] = eight[6];
    out[width - 1] = eight[7];
}

#endif
