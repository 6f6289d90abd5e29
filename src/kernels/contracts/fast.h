/* Contracts of the corner kernels: FAST-9/16 (Rosten and Drummond, ECCV 2006), one row at a time.
 *
 * The circle is the 16 pixels at distance 3 from the centre (Bresenham). A pixel is a corner at
 * threshold t when 9 contiguous of them are all brighter than centre + t, or all darker than centre
 * - t; its score is the largest such t, which is also OpenCV's. Every variant gives the same bits.
 */
#ifndef FOVEA_KERNELS_CONTRACTS_FAST_H
#define FOVEA_KERNELS_CONTRACTS_FAST_H

#include <stddef.h>
#include <stdint.h>

/* scores[i] = score of the pixel at `pixels + i` when it is a corner at thresholds[i] [1, 254],
 * else 0; i in [0, count). Reads three rows and columns to all sides of the pixels, and up to 64
 * bytes further right in each of these seven rows and of the thresholds; may write up to 63 bytes
 * past scores[count - 1] with undefined values. No alignment needed. */
typedef void fv_k_fast_score_u8_fn(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                                   const uint8_t *thresholds, int32_t count);

/* Non-maximum suppression: the columns x in [from, to), ascending, with row[x] > 0 and greater than
 * its eight neighbours in `above`, `row` and `below`; returns how many (at most (to - from + 1) /
 * 2). Reads columns from - 1 to `to` of the three rows, and up to 64 bytes further, whose values do
 * not matter; writes nothing but the stated columns. */
typedef int32_t fv_k_fast_peaks_u8_fn(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                      const uint8_t *below, int32_t from, int32_t to);

#endif
