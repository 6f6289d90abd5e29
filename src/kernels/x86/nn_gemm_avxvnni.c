#define DOT _mm256_dpbusd_avx_epi32
#include "kernels/x86/nn_gemm_vnni256.h"

void fv_k_nn_gemm_u8__avxvnni(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                              uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_u8(g, a, lda, out, ldo, m);
}

void fv_k_nn_gemm_i32__avxvnni(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                               int32_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_i32(g, a, lda, out, ldo, m);
}
