/* Contracts of the kernels that measure corners by the derivatives around them (features/harris.h).
 *
 * No alignment needed; nothing is read or written outside the stated ranges; inputs and outputs do
 * not overlap; every variant gives the same bits. Responses are single precision floats, handed on
 * as their bits: of positive ones the larger has the larger bits, and negative ones are below 0. */
#ifndef FOVEA_KERNELS_CONTRACTS_RESPONSE_H
#define FOVEA_KERNELS_CONTRACTS_RESPONSE_H

#include <stdint.h>

/* One row of responses from Sobel derivatives (|d| <= 1020) of the rows above, at and below,
 * `width` elements each. With a, b, c the sums of dx dx, dx dy, dy dy over the 3 x 3 pixels around
 * x, exact as floats, and every operation below rounded to single precision, in this order:
 *
 *     harris_k < 0:   (a + c) - sqrt((a - c) (a - c) + (2 b) (2 b))   twice the least eigenvalue
 *     otherwise:      (a c - b b) - harris_k ((a + c) (a + c))
 *
 * 0 at the first and the last x; width >= 3. Returns the largest of `most` and all bits. `sums`: 3
 * x width elements of scratch. */
typedef int32_t fv_k_response_row_f32_fn(int32_t *out, const int16_t *const *dx,
                                         const int16_t *const *dy, int32_t width, float harris_k,
                                         int32_t *sums, int32_t most);

/* marks[x] = 1 where the bits rows[1][x] are above `threshold` and at least those of the eight
 * neighbours, else 0; 0 at the first and the last x; width >= 3. `most`: width elements of scratch.
 */
typedef void fv_k_response_peaks_row_s32_fn(int32_t *marks, const int32_t *const *rows,
                                            int32_t width, int32_t threshold, int32_t *most);

#endif
