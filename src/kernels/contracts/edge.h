/* Contracts of the kernels that differentiate rows of grey pixels and thin edges (fovea/edges.h).
 *
 * Common to all: no alignment needed; nothing is read or written outside the stated ranges; inputs
 * and outputs do not overlap; every variant gives the same bits. rows[0], rows[1], rows[2]: the row
 * above, the row itself and the row below, `width` readable bytes each, chosen by the caller at top
 * and bottom; width >= 2. Columns outside are those reflected without repeating the edge, or with
 * `repeat` != 0 the edge. */
#ifndef FOVEA_KERNELS_CONTRACTS_EDGE_H
#define FOVEA_KERNELS_CONTRACTS_EDGE_H

#include <stdint.h>

/* out[x] = s[x + 1] - s[x - 1], s = side rows[0] + centre rows[1] + side rows[2]; side and centre
 * in [0, 10]. */
typedef void fv_k_derivative_x_row_s16_fn(int16_t *out, const uint8_t *const *rows, int32_t width,
                                          int32_t side, int32_t centre, int32_t repeat);

/* out[x] = side d[x - 1] + centre d[x] + side d[x + 1], d = rows[2] - rows[0]. */
typedef void fv_k_derivative_y_row_s16_fn(int16_t *out, const uint8_t *const *rows, int32_t width,
                                          int32_t side, int32_t centre, int32_t repeat);

/* out[x] = 4-neighbours - 4 centre (corners = 0), or 2 (corners) - 8 centre (corners != 0); columns
 * reflected. */
typedef void fv_k_laplacian_row_s16_fn(int16_t *out, const uint8_t *const *rows, int32_t width,
                                       int32_t corners);

/* out[x] = |dx| + |dy|, or with squared != 0 dx dx + dy dy, x < width; |dx|, |dy| <= 8160. */
typedef void fv_k_magnitude_row_s32_fn(int32_t *out, const int16_t *dx, const int16_t *dy,
                                       int32_t width, int32_t squared);

/* Non-maximum suppression of a row of Canny's detector. magnitude[0 .. 2]: the row above, the row
 * and the row below; elements -1 .. width are readable. |dx|, |dy| <= 1020. With v =
 * magnitude[1][x] a pixel stays when v > low and, with t = 13573 |dx| (tan 22.5 degrees in
 * 1/32768): |dy| 32768 < t:               v > left and v >= right; |dy| 32768 > t + 65536 |dx|:  v
 * > above and v >= below; else, signs of dx, dy equal:  v > above left and v > below right; else:
 * v > above right and v > below left. Bit 63 - x % 64 of weak[x / 64] is set where it stays, of
 * strong[x / 64] where also v > high; bits past the width are 0. low >= 0. */
typedef void fv_k_thin_row_s32_fn(uint64_t *weak, uint64_t *strong, const int32_t *const *magnitude,
                                  const int16_t *dx, const int16_t *dy, int32_t width, int32_t low,
                                  int32_t high);

#endif
