/* Contract of the kernel that scores the surroundings of found corners, for their sub-pixel
 * positions.
 */
#ifndef FOVEA_KERNELS_CONTRACTS_CORNER_H
#define FOVEA_KERNELS_CONTRACTS_CORNER_H

#include <stddef.h>
#include <stdint.h>

enum {
    FV_CORNER_ROWS = 5,
    FV_CORNER_COLUMNS = 8, /* the first five are of use; eight fill a register */
    FV_CORNER_SCORES = FV_CORNER_ROWS * FV_CORNER_COLUMNS,
    FV_CORNER_MARGIN_PX = 8
};

/* scores[40 k + 8 v + u] = strength of the pixel (u - 2, v - 2) away from pixel k of `count`, which
 * lies centres[k] bytes from `image`: the largest t such that 9 contiguous of the 16 pixels of the
 * FAST circle (contracts/fast.h) all differ from it by t or more in the same direction; 0 where
 * there is none. One more than the FAST score, and not cut at a threshold. Reads 5 rows up and
 * down, 5 columns to the left and 8 to the right of each pixel. Every variant gives the same bits.
 */
typedef void fv_k_corner_scores_u8_fn(uint8_t *scores, const uint8_t *image, ptrdiff_t stride_bytes,
                                      const int32_t *centres, int32_t count);

/* The FAST circle: columns, then rows, clockwise from below. */
extern const int8_t fv_corner_circle[2][16];

#endif
