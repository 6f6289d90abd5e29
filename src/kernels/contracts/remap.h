/* Contract of the kernel that resamples an image along a fixed map (rectification).
 *
 * The map is cut into blocks of eight output pixels. Nearly always their source pixels lie in a
 * window of 16 columns and 4 rows, so a block is eight table look-ups into a window that is loaded
 * as a whole: contiguous loads and in-register shuffles instead of a gather per pixel. Fractions
 * are 1/64 pixel (OpenCV's remap has 1/32). */
#ifndef FOVEA_KERNELS_CONTRACTS_REMAP_H
#define FOVEA_KERNELS_CONTRACTS_REMAP_H

#include <stddef.h>
#include <stdint.h>

enum {
    FV_REMAP_BLOCK = 8,
    FV_REMAP_WINDOW_COLUMNS = 16,
    FV_REMAP_WINDOW_ROWS = 4,
    FV_REMAP_COLUMN =
        0x0f, /* of `at`: column of the upper left source pixel within the window, 0..14 */
    FV_REMAP_ROW_1 = 0x10,   /* of `at`: its row within the window is 1 or 2 */
    FV_REMAP_ROW_2 = 0x20,   /* of `at`: its row is 2 (then FV_REMAP_ROW_1 is set as well) */
    FV_REMAP_OUTSIDE = 0x80, /* of `at`: looks outside the source image; the output is 0 */
    FV_REMAP_SCATTERED = -1  /* of `y`: the block does not fit a window */
};

/* A window block: x, y is the top left corner of the window in the source. A scattered block (y ==
 * FV_REMAP_SCATTERED): `first` is the index of its first entry in the table of scattered pixels. */
struct fv_remap_block {
    int16_t x, y;
    union {
        uint8_t at[FV_REMAP_BLOCK];
        uint32_t first;
    };
    uint8_t fx[FV_REMAP_BLOCK], fy[FV_REMAP_BLOCK]; /* 0..63 */
};

struct fv_remap_pixel {
    int16_t x, y; /* upper left source pixel; x < 0: outside, the output is 0 */
    uint8_t fx, fy;
};

/* One row of `blocks` x 8 output pixels. With a, b the upper and c, d the lower two of the four
 * source pixels: top = 64 a + fx (b - a),  bottom = 64 c + fx (d - c), out = (top + (((bottom -
 * top) fy + 32) >> 6)
 * + 32) >> 6. Reads only whole windows, which lie inside the source, and the pixels of scattered
 * entries. Every variant gives the same bits. No alignment needed. */
typedef void fv_k_remap_row_u8_fn(uint8_t *out, const uint8_t *source, ptrdiff_t stride,
                                  const struct fv_remap_block *blocks, int32_t count,
                                  const struct fv_remap_pixel *scattered);

#endif
