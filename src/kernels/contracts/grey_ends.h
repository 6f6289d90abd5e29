/* Shared by the SIMD variants of grey_bayer_u8: the first column and the columns from `rest` on, as
 * in the contract. */
#ifndef FOVEA_KERNELS_CONTRACTS_GREY_ENDS_H
#define FOVEA_KERNELS_CONTRACTS_GREY_ENDS_H

#include <stdint.h>

static inline int32_t fv_k_grey_bayer_column(const uint8_t *above, const uint8_t *row,
                                             const uint8_t *below, int32_t x)
{
    return above[x] + 2 * row[x] + below[x];
}

static inline uint8_t fv_k_grey_bayer_pixel(const uint8_t *above, const uint8_t *row,
                                            const uint8_t *below, int32_t count, int32_t x)
{
    const int32_t left = x > 0 ? x - 1 : 1, right = x < count - 1 ? x + 1 : count - 2;
    return (uint8_t)((fv_k_grey_bayer_column(above, row, below, left) +
                      2 * fv_k_grey_bayer_column(above, row, below, x) +
                      fv_k_grey_bayer_column(above, row, below, right) + 8) >>
                     4);
}

static inline void fv_k_grey_bayer_ends(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                                        const uint8_t *below, int32_t count, int32_t rest)
{
    grey[0] = fv_k_grey_bayer_pixel(above, row, below, count, 0);
    for (int32_t x = rest; x < count; x++)
        grey[x] = fv_k_grey_bayer_pixel(above, row, below, count, x);
}

#endif
