/* Rounding of the matrix product's sums, exact and by real numbers (nn/real.h). */
#ifndef FOVEA_TESTS_KERNELS_CHECK_NN_SUMS_H
#define FOVEA_TESTS_KERNELS_CHECK_NN_SUMS_H

#include "kernels/check.h"

/* A product that is not changed any more can be rounded by real numbers, half of the time. */
void check_draw_real(struct check *check, struct fv_nn_gemm *gemm);

/* 69,632 sums in a row, each once, by one scale: all that lead to bytes, or those near some byte.
 */
void check_all_sums(struct check *check, fv_k_nn_gemm_u8_fn *reference,
                    fv_k_nn_gemm_u8_fn *variant);

/* What rounding down in place of to nearest is for: both variants beside each other, at the hardest
 * rise of each channel. */
void check_hard_sums(struct check *check, fv_k_nn_gemm_u8_fn *reference,
                     fv_k_nn_gemm_u8_fn *variant);

#endif
