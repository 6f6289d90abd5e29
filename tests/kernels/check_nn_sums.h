/* Sums of the matrix product where rounding by real numbers (nn/real.h) is hardest. */
#ifndef FOVEA_TESTS_KERNELS_CHECK_NN_SUMS_H
#define FOVEA_TESTS_KERNELS_CHECK_NN_SUMS_H

#include "kernels/check.h"

/* What rounding down in place of to nearest is for: both variants beside each other, at the hardest
 * rise of each channel. */
void check_hard_sums(struct check *check, fv_k_nn_gemm_u8_fn *reference,
                     fv_k_nn_gemm_u8_fn *variant);

#endif
