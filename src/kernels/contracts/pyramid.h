/* Contracts of the kernels that make one pyramid level from the one before (image/pyramid.h says
 * what is computed).
 *
 * Common to both: no alignment needed; source and destination do not overlap; up to 64 bytes past
 * the last source byte named below may be read, and up to 63 past the last destination byte written
 * with undefined values; the stated output has the same bits in every variant. */
#ifndef FOVEA_KERNELS_CONTRACTS_PYRAMID_H
#define FOVEA_KERNELS_CONTRACTS_PYRAMID_H

#include <stdint.h>

/* out[i] = (a[i] (128 - weight_b) + b[i] weight_b + 64) >> 7 for i in [0, count), weight_b in [1,
 * 127]. */
typedef void fv_k_blend_rows_u8_fn(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                                   int32_t weight_b);

/* Six pixels to five: out[i] = (in[j] (128 - w) + in[j + 1] w + 64) >> 7 for i in [0, count), with
 * j = i + floor(i / 5) and w = 13, 38, 64, 90, 115 for i mod 5 = 0 .. 4. */
typedef void fv_k_shrink_row_u8_fn(uint8_t *out, const uint8_t *in, int32_t count);

#endif
