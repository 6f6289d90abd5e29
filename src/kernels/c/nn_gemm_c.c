#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"

static int32_t accumulate(const struct fv_nn_gemm *g, const uint8_t *row, int32_t row_sum,
                          int32_t channel)
{
    const int8_t *w = g->weights + ((ptrdiff_t)(channel / 16) * g->k4 * 16 + channel % 16) * 4;
    uint32_t sum = (uint32_t)g->bias[channel] + (uint32_t)g->row_sum_factor * (uint32_t)row_sum;
    for (int32_t k = 0; k < g->k; k++)
        sum += (uint32_t)(row[k] * w[(ptrdiff_t)(k / 4) * 64 + k % 4]);
    return (int32_t)sum;
}

static int32_t sum_of(const struct fv_nn_gemm *g, const uint8_t *row)
{
    int32_t sum = 0;
    if (g->row_sum_factor == 0) return 0;
    for (int32_t k = 0; k < g->k; k++)
        sum += row[k];
    return sum;
}

static uint8_t output_of(const struct fv_nn_gemm *g, int32_t acc, int32_t channel)
{
    const int32_t scaled = fv_nn_requantize(acc, g->multiplier[channel], g->shift[channel]);
    const uint8_t value = fv_nn_output(scaled, g->zero_out, g->act_min, g->act_max);
    return g->table == NULL ? value : g->table[value];
}

void fv_k_nn_gemm_u8__c(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, uint8_t *out,
                        ptrdiff_t ldo, int32_t m)
{
    for (int32_t i = 0; i < m; i++) {
        const int32_t row_sum = sum_of(g, a + i * lda);
        for (int32_t c = 0; c < g->n; c++) {
            const int32_t acc = accumulate(g, a + i * lda, row_sum, c);
            out[i * ldo + c] = output_of(g, acc, c);
        }
    }
}

void fv_k_nn_gemm_i32__c(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t *out,
                         ptrdiff_t ldo, int32_t m)
{
    for (int32_t i = 0; i < m; i++) {
        const int32_t row_sum = sum_of(g, a + i * lda);
        for (int32_t c = 0; c < (g->n + 15) / 16 * 16; c++)
            out[i * ldo + c] = accumulate(g, a + i * lda, row_sum, c);
    }
}

/* Accumulator of one row and channel whose groups of inputs lie apart. */
static int32_t accumulate_apart(const struct fv_nn_gemm *g, const uint8_t *in,
                                const int32_t *offsets, int32_t channel)
{
    const int8_t *w = g->weights + ((ptrdiff_t)(channel / 16) * g->k4 * 16 + channel % 16) * 4;
    uint32_t sum = (uint32_t)g->bias[channel];
    for (int32_t j = 0; j < g->k4; j++, w += 64) {
        for (int32_t i = 0; i < 4; i++)
            sum += (uint32_t)(in[offsets[j] + i] * w[i]);
    }
    return (int32_t)sum;
}

void fv_k_nn_apart_u8__c(const struct fv_nn_gemm *g, const uint8_t *const *in,
                         const int32_t *offsets, uint8_t *const *out, int32_t m)
{
    for (int32_t i = 0; i < m; i++) {
        for (int32_t c = 0; c < g->n; c++)
            out[i][c] = output_of(g, accumulate_apart(g, in[i], offsets, c), c);
    }
}
