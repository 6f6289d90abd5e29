#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"

enum { BLOCK = 16 }; /* channels whose weights lie together */

static void begin(const struct fv_nn_gemm *g, int32_t block, uint32_t more, uint32_t acc[BLOCK])
{
    for (int32_t c = 0; c < BLOCK; c++)
        acc[c] = (uint32_t)g->bias[block * BLOCK + c] + more;
}

/* Four inputs times their weights of each channel of the block. */
static inline void add_four(uint32_t *restrict acc, const uint8_t *four, const int8_t *w)
{
    const int32_t x0 = four[0], x1 = four[1], x2 = four[2], x3 = four[3];
    for (int32_t c = 0; c < BLOCK; c++)
        acc[c] +=
            (uint32_t)(x0 * w[4 * c] + x1 * w[4 * c + 1] + x2 * w[4 * c + 2] + x3 * w[4 * c + 3]);
}

/* Accumulators of a row and the channels of a block; past k the weights are zero. */
static void accumulate(const struct fv_nn_gemm *g, const uint8_t *row, int32_t row_sum,
                       int32_t block, uint32_t acc[BLOCK])
{
    const int8_t *w = g->weights + (ptrdiff_t)block * g->k4 * 4 * BLOCK;
    begin(g, block, (uint32_t)g->row_sum_factor * (uint32_t)row_sum, acc);
    for (int32_t j = 0; j < g->k4; j++)
        add_four(acc, row + (ptrdiff_t)j * 4, w + (ptrdiff_t)j * 4 * BLOCK);
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
    uint32_t acc[BLOCK];
    for (int32_t i = 0; i < m; i++) {
        const int32_t row_sum = sum_of(g, a + i * lda);
        for (int32_t c = 0; c < g->n; c++) {
            if (c % BLOCK == 0) accumulate(g, a + i * lda, row_sum, c / BLOCK, acc);
            out[i * ldo + c] = output_of(g, (int32_t)acc[c % BLOCK], c);
        }
    }
}

void fv_k_nn_gemm_i32__c(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t *out,
                         ptrdiff_t ldo, int32_t m)
{
    for (int32_t i = 0; i < m; i++) {
        const int32_t row_sum = sum_of(g, a + i * lda);
        for (int32_t block = 0; block < (g->n + BLOCK - 1) / BLOCK; block++)
            accumulate(g, a + i * lda, row_sum, block,
                       (uint32_t *)out + i * ldo + (ptrdiff_t)block * BLOCK);
    }
}

/* Accumulators of a row whose groups of inputs lie apart. */
static void accumulate_apart(const struct fv_nn_gemm *g, const uint8_t *in, const int32_t *offsets,
                             int32_t block, uint32_t acc[BLOCK])
{
    const int8_t *w = g->weights + (ptrdiff_t)block * g->k4 * 4 * BLOCK;
    begin(g, block, 0, acc);
    for (int32_t j = 0; j < g->k4; j++)
        add_four(acc, in + offsets[j], w + (ptrdiff_t)j * 4 * BLOCK);
}

void fv_k_nn_apart_u8__c(const struct fv_nn_gemm *g, const int32_t *offsets,
                         const struct fv_nn_rows *rows, int32_t count)
{
    uint32_t acc[BLOCK];
    for (const struct fv_nn_rows *r = rows; r < rows + count; r++) {
        for (int32_t i = 0; i < r->count; i++) {
            const uint8_t *in = r->in + i * r->in_step;
            for (int32_t c = 0; c < g->n; c++) {
                if (c % BLOCK == 0) accumulate_apart(g, in, offsets, c / BLOCK, acc);
                r->out[i * r->out_step + c] = output_of(g, (int32_t)acc[c % BLOCK], c);
            }
        }
    }
}
