/* Contracts of the kernels behind ORB (Rublee et al., ICCV 2011): smoothing, orientation, steered
 * BRIEF.
 *
 * Common to all: no alignment needed unless stated; nothing is read or written outside the stated
 * ranges; inputs and outputs do not overlap; every variant gives the same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_ORB_H
#define FOVEA_KERNELS_CONTRACTS_ORB_H

#include <stddef.h>
#include <stdint.h>

enum {
    FV_BLUR7_RADIUS = 3,
    FV_BLUR7_PAD = 64,      /* elements of the scratch row beyond its width */
    FV_MOMENTS_RADIUS = 15, /* of the circular patch, pixels */
    FV_BRIEF_BITS = 256,
    FV_DESCRIPTOR_BYTES = 32
};

/* One row of the 7x7 Gaussian with sigma 2, in the integer weights w = 18 34 48 56 48 34 18 (sum
 * 256) that OpenCV's bit-exact cv::GaussianBlur uses: out[x] = (sum over i, j of w[i] w[j]
 * rows[i][x + j - 3] + 32768)
 * >> 16, with columns outside the image reflected without repeating the edge. rows[0..6] are the
 * seven image rows around the output row (the caller reflects at top and bottom; rows may repeat),
 * `width` readable bytes each, width >= 4. `scratch`: width + FV_BLUR7_PAD elements, 64-byte
 * aligned, contents undefined afterwards.
 */
typedef void fv_k_blur7_row_u8_fn(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                                  uint16_t *scratch);

/* First moments of the grey levels in the circle of radius 15 around each of `count` pixels,
 * centres[k] = the offset in bytes of pixel k from `image`: m[2k] = sum of u I(u, v),  m[2k + 1] =
 * sum of v I(u, v),  |v| <= 15, |u| <= half_width[|v|] with half_width = 15 15 15 15 14 14 14 13 13
 * 12 11 10 9 8 6 3 (OpenCV's circle, symmetric in u and v). Reads rows -15..15 and, in each,
 * columns -16..16 around the centre. */
typedef void fv_k_moments_u8_fn(int32_t *m, const uint8_t *image, ptrdiff_t stride,
                                const int32_t *centres, int32_t count);

/* 256 comparisons around a pixel. Sample i lies at the byte offset along * positions[2i] + across *
 * positions[2i + 1] from `centre`; |along|, |across| < 32768. Bit i (bit i % 8 of byte i / 8) is
 * set where sample i < sample 256 + i. Reads up to 3 bytes after each sample. */
typedef void fv_k_brief_u8_fn(uint8_t descriptor[FV_DESCRIPTOR_BYTES], const uint8_t *centre,
                              const int8_t positions[4 * FV_BRIEF_BITS], int32_t along,
                              int32_t across);

/* Half widths of the rows of the circle of radius 15, from the middle row outwards. */
extern const uint8_t fv_moments_half_width[FV_MOMENTS_RADIUS + 1];

#endif
