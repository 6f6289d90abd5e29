#include "kernels/x86/nn_gemm_avx512.h"

void fv_k_nn_gemm_u8__avx512icl(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                                uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_u8(g, a, lda, out, ldo, m);
}

void fv_k_nn_apart_u8__avx512icl(const struct fv_nn_gemm *g, const int32_t *offsets,
                                 const struct fv_nn_rows *rows, int32_t count)
{
    apart_u8(g, offsets, rows, count);
}
