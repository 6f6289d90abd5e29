/* Contract of the kernel of SURF (features/surf.h). */
#ifndef FOVEA_KERNELS_CONTRACTS_SURF_H
#define FOVEA_KERNELS_CONTRACTS_SURF_H

#include <stdint.h>

/* Rows of an integral image that the boxes of a filter of side L end at, with l = L / 3: above the
 * row with the offsets 1 - l, l, -(L / 2), L / 2 + 1, -(l / 2), l / 2 + 1, -l, 0, 1, l + 1. */
enum { FV_SURF_BOX_ROWS = 10, FV_SURF_SIDE_MAX = 195, FV_SURF_GREY = 128 };

/* Determinants of the Hessian by boxes in one row (Bay et al., CVIU 110, 2008). rows[k][x] is the
 * sum of all pixels above and left of column x, in 1/FV_SURF_GREY grey level, modulo 2^32; x = 0 is
 * the first determinant's column. With S(k, m) = rows[m] - rows[k], h = L / 2, n = l / 2 and sums
 * modulo 2^32, which are read as signed numbers:
 *
 *     xx = S(0, 1)[x + h + 1] - S(0, 1)[x - h] - 3 (S(0, 1)[x + n + 1] - S(0, 1)[x - n])
 *     yy = T[x + l] - T[x - l + 1],  T = S(2, 3) - 3 S(4, 5)
 *     xy = (U[x] - U[x - l]) - (U[x + l + 1] - U[x + 1]),  U = S(6, 7) - S(8, 9)
 *     out[i] = Dxx Dyy - .81 Dxy^2 at x = i step, each D = sum / (FV_SURF_GREY L^2)
 *
 * in single precision: each sum is rounded, times the rounded factor, and the operations stand in
 * this order. `side` L is odd and a multiple of 3 of at most FV_SURF_SIDE_MAX, `step` and `count`
 * at least 1; rows are read in [-h, (count - 1) step + h + 1]. `sums`: three times as many elements
 * of scratch. */
typedef void fv_k_surf_row_f32_fn(float *out, const uint32_t *const *rows, int32_t side,
                                  int32_t step, int32_t count, uint32_t *sums);

#endif
