/* Contracts of the kernels that turn captured pixels into grey levels, one row at a time.
 *
 * Common to all: `count` >= 0 pixels; no alignment needed; nothing is read or written outside the
 * stated ranges; source and destination do not overlap; every variant gives the same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_GREY_H
#define FOVEA_KERNELS_CONTRACTS_GREY_H

#include <stdint.h>

/* grey[i] = min(word[i] >> shift, 255), shift in [0, 8]; the words are 16 bits, little-endian, at
 * source[2 i]. */
typedef void fv_k_grey_shift_u16_fn(uint8_t *grey, const uint8_t *source, int32_t count,
                                    int32_t shift);

/* grey[i] = source[2 i + offset], offset 0 or 1; reads source[0 .. 2 count - 1]. */
typedef void fv_k_grey_pick_u8_fn(uint8_t *grey, const uint8_t *source, int32_t count,
                                  int32_t offset);

/* grey[i] = (first s[3 i] + 19235 s[3 i + 1] + third s[3 i + 2] + 16384) >> 15, first + third =
 * 13533; reads s[0 .. 3 count - 1]. */
typedef void fv_k_grey_mix_u8_fn(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first,
                                 int32_t third);

/* The binomial filter over three rows of a mosaic: with v[x] = above[x] + 2 row[x] + below[x],
 * v[-1] = v[1] and v[count] = v[count - 2]: grey[x] = (v[x - 1] + 2 v[x] + v[x + 1] + 8) >> 4.
 * count >= 2. */
typedef void fv_k_grey_bayer_u8_fn(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                                   const uint8_t *below, int32_t count);

#endif
