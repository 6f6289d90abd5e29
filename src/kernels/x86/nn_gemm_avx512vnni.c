#include "kernels/x86/nn_gemm_avx512.h"

void fv_k_nn_gemm_u8__avx512vnni(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                                 uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    gemm_u8(g, a, lda, out, ldo, m);
}

void fv_k_nn_gemm_i32__avx512vnni(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                                  int32_t *out, ptrdiff_t ldo, int32_t m)
{
    const int32_t blocks = (g->n + 15) / 16;
    int32_t sums[4] = {0};
    struct tile_job j = {.g = g, .row_sums = sums};
    for (int32_t i = 0; i < m; i += 4) {
        const int32_t rows = m - i < 4 ? m - i : 4;
        const uint8_t *in[4];
        if (g->row_sum_factor != 0) sum_rows(g, a + i * lda, lda, rows, sums);
        for (int32_t r = 0; r < 4; r++)
            in[r] = a + (i + (r < rows ? r : rows - 1)) * lda;
        j.in = in;
        for (int32_t b = 0; b < blocks; b++) {
            __m512i acc[4];
            j.weights = g->weights + (ptrdiff_t)b * g->k4 * 64;
            j.bias = g->bias + 16 * b;
            accumulate(&j, 4, 1, 0, 0, acc);
            for (int32_t r = 0; r < rows; r++)
                _mm512_storeu_si512(out + (i + r) * ldo + 16 * b, acc[r]);
        }
    }
}

void fv_k_nn_apart_u8__avx512vnni(const struct fv_nn_gemm *g, const int32_t *offsets,
                                  const struct fv_nn_rows *rows, int32_t count)
{
    apart_u8(g, offsets, rows, count);
}
