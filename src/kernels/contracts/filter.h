/* Contracts of the kernels that filter rows of grey pixels (fovea/preprocess.h).
 *
 * Common to all: no alignment needed unless stated; nothing is read or written outside the stated
 * ranges; inputs and outputs do not overlap unless stated; every variant gives the same bits. Rows
 * above and below are chosen by the caller, who reflects or repeats at top and bottom. */
#ifndef FOVEA_KERNELS_CONTRACTS_FILTER_H
#define FOVEA_KERNELS_CONTRACTS_FILTER_H

#include <stdint.h>

enum {
    FV_GAUSS_RADIUS_MAX = 3,
    FV_GAUSS_PAD = 64, /* elements of the scratch row beyond its width */
    FV_BILATERAL_WEIGHT_MAX = 2048,
    FV_CONTRAST_BITS = 12 /* of the weight of a tile */
};

/* One row of a (2 radius + 1) x (2 radius + 1) Gaussian: out[x] = (sum over i, j of w[|i|] w[|j|]
 * rows[i + radius][x + j] + 32768) >> 16 with columns reflected without repeating the edge. Weights
 * from the centre outwards: weights[0] + 2 (weights[1] + ... + weights[radius]) = 256. radius in
 * [1, 3]; rows[0 .. 2 radius]: `width` readable bytes each, width >= 8. `scratch`: width +
 * FV_GAUSS_PAD elements, 64-byte aligned, undefined afterwards. */
typedef void fv_k_gauss_row_u8_fn(uint8_t *out, const uint8_t *const *rows, int32_t width,
                                  const uint16_t *weights, int32_t radius, uint16_t *scratch);

/* out[x] = median of the nine pixels around x in three rows, edges repeated; width >= 2. */
typedef void fv_k_median3_row_u8_fn(uint8_t *out, const uint8_t *const *rows, int32_t width);

/* out[i] = clamp((weight a[i] + (256 - weight) b[i] + 128) >> 8) to [0, 255], i < count, weight in
 * [0, 2048]; out == a or out == b is allowed. */
typedef void fv_k_mix_u8_fn(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                            int32_t weight);

/* out[i] = the whole number nearest to in[i] factor + offset (of two the even one), clamped to [0,
 * 255], with the product and the sum rounded to float; i < count. |factor| and |offset| at most
 * 65535; in == out is allowed. */
typedef void fv_k_line_u8_fn(uint8_t *out, const uint8_t *in, int32_t count, float factor,
                             float offset);

/* range[0] = min(range[0], all in[i]), range[1] = max(range[1], all in[i]), i < count. */
typedef void fv_k_range_u8_fn(uint8_t range[2], const uint8_t *in, int32_t count);

/* Add to counts[k][v], k in [0, 4), so that their sum over k grows by the number of i < count with
 * in[i] = v. */
typedef void fv_k_histogram_u8_fn(uint32_t counts[4][256], const uint8_t *in, int32_t count);

/* One row of a bilateral filter over the 13 pixels at distances 0, 1, sqrt 2 and 2: out[x] = (sum w
 * p + n / 2) / n rounded down, n = sum w, w = FV_BILATERAL_WEIGHT_MAX for the centre c and
 * weights[k][|p - c|] for k = 0 (distance 1), 1 (sqrt 2), 2 (distance 2), each at most that.
 * Columns are reflected without repeating the edge; width >= 8. */
typedef void fv_k_bilateral_row_u8_fn(uint8_t *out, const uint8_t *const *rows, int32_t width,
                                      const uint16_t weights[3][256]);

/* out[i] = (a[i] (4096 - weight) + b[i] weight + 8) >> 4 for i in [0, 256), weight in [0, 4096]:
 * two tables of grey levels to one in 1/256 grey level. */
typedef void fv_k_contrast_blend_u16_fn(uint16_t out[256], const uint8_t a[256],
                                        const uint8_t b[256], int32_t weight);

/* Blend two tables of 16 bits from pixel to pixel: out[i] = (left[in[i]] (4096 - w) +
 * right[in[i]] w + 2^19) >> 20 with w = weights[i] in [0, 4096], i < count; entries are at most
 * 65280. in == out is allowed. */
typedef void fv_k_contrast_row_u8_fn(uint8_t *out, const uint8_t *in, int32_t count,
                                     const uint16_t left[256], const uint16_t right[256],
                                     const uint16_t *weights);

#endif
