/* Softmax, arg max, rows of unit length and products of two computed matrices. */
#include <string.h>

#include "kernels/nn_requantize.h"
#include "kernels/nn_softmax.h"
#include "nn/run.h"

void fv_nn_op_softmax(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_softmax *p = &call->op->u.softmax;
    const int32_t *exps = (const int32_t *)(const void *)(call->model->base + p->table);
    const ptrdiff_t at = (ptrdiff_t)begin * p->depth;
    call->kernels->nn_softmax_u8(exps, call->in[0] + at, call->out[0] + at, p->depth, end - begin);
}

/* Multiplier and shift of 1 / sqrt(value), by five steps of Newton's method with 3 integer bits, as
 * LiteRT has it (GetInvSqrtQuantizedMultiplierExp); 0 counts as 1. */
static void inverse_root(int32_t value, int32_t *multiplier, int32_t *shift)
{
    enum { HALF_THREE = (1 << 28) + (1 << 27), HALF_ROOT_TWO = 1518500250 };
    *multiplier = INT32_MAX;
    *shift = 0;
    if (value <= 1) return;
    int32_t down = 11, x = 1 << 28;
    for (; value >= 1 << 29; value /= 4)
        down++;
    const int32_t pairs = (__builtin_clz((uint32_t)value) - 1) / 2 - 1;
    down -= pairs;
    const int32_t half = fv_nn_divide_by_power((value << 2 * pairs) >> 1, 1);
    for (int i = 0; i < 5; i++) {
        const int32_t square = fv_nn_high_product(x, x);
        const int32_t cube = fv_nn_saturate((int64_t)fv_nn_high_product(square, x) * 64);
        const int32_t more = fv_nn_high_product(HALF_THREE, x),
                      less = fv_nn_high_product(half, cube);
        x = fv_nn_saturate(((int64_t)more - less) * 8);
    }
    x = fv_nn_high_product(x, HALF_ROOT_TWO);
    *multiplier = down < 0 ? (int32_t)((uint32_t)x << -down) : x;
    *shift = down < 0 ? 0 : -down;
}

void fv_nn_op_normalise(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_normalise *p = &call->op->u.normalise;
    for (int32_t row = begin; row < end; row++) {
        const uint8_t *in = call->in[0] + (ptrdiff_t)row * p->depth;
        uint8_t *out = call->out[0] + (ptrdiff_t)row * p->depth;
        int32_t sum = 0, multiplier, shift;
        for (int32_t i = 0; i < p->depth; i++)
            sum += (in[i] - p->zero_in) * (in[i] - p->zero_in);
        inverse_root(sum, &multiplier, &shift);
        for (int32_t i = 0; i < p->depth; i++) {
            const int32_t x = in[i] - p->zero_in;
            const int32_t scaled = p->is_signed ? fv_nn_requantize(x, multiplier, shift + 7)
                                                : fv_nn_requantize(x * 128, multiplier, shift);
            out[i] = (uint8_t)fv_nn_clamp(scaled + 128, 0, 255);
        }
    }
}

/* The largest along the last axis, which is packed. */
static void arg_max_rows(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_arg_max *p = &call->op->u.arg_max;
    int32_t best[64];
    for (int32_t row = begin, count; row < end; row += count) {
        count = end - row < 64 ? end - row : 64;
        call->kernels->nn_argmax_u8(call->in[0] + (ptrdiff_t)row * p->axis, p->axis, best, count);
        for (int32_t i = 0; i < count; i++) {
            if (p->element_bytes == 8)
                ((int64_t *)(void *)call->out[0])[row + i] = best[i];
            else
                ((int32_t *)(void *)call->out[0])[row + i] = best[i];
        }
    }
}

void fv_nn_op_arg_max(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_arg_max *p = &call->op->u.arg_max;
    if (p->inner == 1 && !p->minimum) {
        arg_max_rows(call, begin, end);
        return;
    }
    for (int32_t row = begin; row < end; row++) {
        for (int32_t i = 0; i < p->inner; i++) {
            const uint8_t *in = call->in[0] + (ptrdiff_t)row * p->axis * p->inner + i;
            int32_t best = 0, value = in[0];
            for (int32_t k = 1; k < p->axis; k++) {
                const int32_t v = in[(ptrdiff_t)k * p->inner];
                if (p->minimum ? v < value : v > value) {
                    best = k;
                    value = v;
                }
            }
            const ptrdiff_t at = (ptrdiff_t)row * p->inner + i;
            if (p->element_bytes == 8)
                ((int64_t *)(void *)call->out[0])[at] = best;
            else
                ((int32_t *)(void *)call->out[0])[at] = best;
        }
    }
}

/* The scratch of a product: the second matrix packed as weights, then bias, multiplier and shift by
 * column.
 */
static struct fv_nn_gemm gemm_of(const struct fv_op_matmul *p, uint8_t *scratch)
{
    const ptrdiff_t n16 = (p->n + 15) / 16 * 16, k4 = (p->k + 3) / 4;
    int32_t *words = (int32_t *)(void *)(scratch + n16 * k4 * 4);
    return (struct fv_nn_gemm){.k = p->k,
                               .k4 = (int32_t)k4,
                               .n = p->n,
                               .weights = (int8_t *)scratch,
                               .bias = words,
                               .multiplier = words + n16,
                               .shift = words + 2 * n16,
                               .zero_out = p->zero_out,
                               .act_max = 255,
                               .row_sum_factor = 128 - p->zero_b};
}

/* A group of four weights of each of `count` columns, of which `rows` are there; adds them to
 * `sum`. */
static inline void pack_group(const uint8_t *from, ptrdiff_t row, ptrdiff_t column, int32_t rows,
                              int32_t count, uint8_t *to, int32_t *sum)
{
    for (int32_t j = 0; j < count; j++, from += column, to += 4) {
        for (int32_t i = 0; i < rows; i++) {
            to[i] = from[i * row] ^ 128;
            sum[j] += from[i * row];
        }
        for (int32_t i = rows; i < 4; i++)
            to[i] = 0;
    }
}

/* Columns of `k` rows, row by row: what of a row comes later lies far away, as rows may be pages
 * apart. */
static void pack_by_rows(const struct fv_op_matmul *p, const uint8_t *b, int32_t count,
                         uint8_t *weights, int32_t *sum)
{
    enum { AHEAD = 32 };
    const ptrdiff_t row = p->b_row;
    for (int32_t k = 0; k < p->k; k += 4) {
        const uint8_t *from = b + k * row;
        for (int32_t i = AHEAD; i < AHEAD + 4 && k + i < p->k; i++)
            __builtin_prefetch(from + i * row);
        uint8_t *to = weights + (ptrdiff_t)k * 16;
        if (p->k - k < 4)
            pack_group(from, row, p->b_column, p->k - k, count, to, sum);
        else if (p->b_column == 1 && count == 16)
            pack_group(from, row, 1, 4, 16, to, sum);
        else
            pack_group(from, row, p->b_column, 4, count, to, sum);
    }
}

/* The same where the rows of a column are neighbours: 64 at a time. */
static void pack_by_columns(const struct fv_op_matmul *p, const uint8_t *b, int32_t count,
                            uint8_t *weights, int32_t *sum)
{
    for (int32_t first = 0; first < p->k; first += 64) {
        const int32_t past = p->k - first < 64 ? p->k : first + 64;
        for (int32_t j = 0; j < count; j++) {
            for (int32_t k = first; k < past; k += 4) {
                uint8_t *to = weights + (ptrdiff_t)k * 16 + j * 4;
                pack_group(b + (ptrdiff_t)j * p->b_column + k, 1, 1, past - k < 4 ? past - k : 4, 1,
                           to, sum + j);
            }
        }
    }
}

/* Pack `count` columns of the second matrix, of one block of 16, as signed weights w = b - 128.
 * With w' = zero_b - 128 the product is the sum over k of a w - w' a - zero_a (w - w'): the second
 * term is the kernel's row sum, the third the bias. */
static void pack_columns(const struct fv_nn_call *call, const uint8_t *b, int32_t first,
                         int32_t count)
{
    const struct fv_op_matmul *p = &call->op->u.matmul;
    uint8_t *scratch = call->scratch;
    const int32_t *bias =
        p->bias == 0 ? NULL : (const int32_t *)(const void *)(call->model->base + p->bias);
    const int32_t n16 = (p->n + 15) / 16 * 16, k4 = (p->k + 3) / 4;
    const int32_t used = p->n - first < count ? p->n - first : count;
    uint8_t *weights = scratch + (ptrdiff_t)(first / 16) * k4 * 64 + first % 16 * 4;
    int32_t *words = (int32_t *)(void *)(scratch + (ptrdiff_t)n16 * k4 * 4) + first;
    int32_t sum[16] = {0};
    (p->b_row == 1 ? pack_by_columns : pack_by_rows)(p, b + (ptrdiff_t)first * p->b_column, used,
                                                     weights, sum);
    for (int32_t j = 0; j < count; j++) {
        for (int32_t k = 0; k < k4 && j >= used; k++)
            memset(weights + (ptrdiff_t)k * 64 + j * 4, 0, 4);
        const uint32_t constant = bias == NULL || j >= used ? 0U : (uint32_t)bias[first + j];
        const uint32_t moved = (uint32_t)sum[j] - (uint32_t)p->zero_b * (uint32_t)p->k;
        words[j] = (int32_t)(constant - (j < used ? (uint32_t)p->zero_a * moved : 0U));
        words[n16 + j] = p->multiplier;
        words[2 * n16 + j] = p->shift;
    }
}

/* Rows of the result that are rounded once; the sums of FV_MODEL_CONV_PIXELS of them lie behind
 * what is packed. */
static void multiply_once(const struct fv_nn_call *call, const struct fv_nn_gemm *gemm,
                          const uint8_t *a, uint8_t *out, int32_t count)
{
    const struct fv_op_matmul *p = &call->op->u.matmul;
    const int32_t n16 = (p->n + 15) / 16 * 16;
    int32_t *sums = (int32_t *)(void *)(call->scratch + (ptrdiff_t)n16 * (gemm->k4 * 4 + 12));
    for (int32_t first = 0, some; first < count; first += some) {
        some = count - first < FV_MODEL_CONV_PIXELS ? count - first : FV_MODEL_CONV_PIXELS;
        call->kernels->nn_gemm_i32(gemm, a + (ptrdiff_t)first * p->a_row, p->a_row, sums, n16,
                                   some);
        for (int32_t i = 0; i < some; i++) {
            uint8_t *to = out + (ptrdiff_t)(first + i) * p->n;
            for (int32_t j = 0; j < gemm->n; j++) {
                const int32_t scaled =
                    fv_nn_scale_once(sums[(ptrdiff_t)i * n16 + j], p->multiplier, p->shift);
                to[j] = (uint8_t)fv_nn_clamp(scaled + p->zero_out, 0, 255);
            }
        }
    }
}

/* Part `part` of the columns alone: whole blocks of 16. */
static struct fv_nn_gemm columns_of(const struct fv_op_matmul *p, struct fv_nn_gemm gemm,
                                    int32_t part, int32_t *first)
{
    const int32_t blocks = (p->n + 15) / 16, parts = p->parts > 1 ? p->parts : 1;
    const int32_t from = (int32_t)fv_nn_part_first(blocks, part, parts),
                  end = (int32_t)fv_nn_part_first(blocks, part + 1, parts);
    *first = from * 16;
    gemm.n = (end * 16 < p->n ? end * 16 : p->n) - *first;
    gemm.weights += (ptrdiff_t)from * gemm.k4 * 64;
    gemm.bias += *first;
    gemm.multiplier += *first;
    gemm.shift += *first;
    return gemm;
}

/* By batch: a row for every `pack` columns that are packed, then, part by part of the columns, the
 * rows of the result. */
void fv_nn_op_matmul(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_matmul *p = &call->op->u.matmul;
    const struct fv_nn_gemm gemm = gemm_of(p, call->scratch);
    const int32_t pack = p->pack == 0 ? 16 : p->pack, packs = (p->n + 15) / 16 * 16 / pack;
    const int32_t per = packs + p->m * (p->parts > 1 ? p->parts : 1);
    for (int32_t row = begin, count; row < end; row += count) {
        const int32_t batch = row / per, b0 = batch / p->batch[1], b1 = batch % p->batch[1],
                      at = row % per;
        count = 1;
        if (at < packs) {
            pack_columns(
                call, call->in[1] + (ptrdiff_t)b0 * p->b_batch[0] + (ptrdiff_t)b1 * p->b_batch[1],
                at * pack, pack);
            continue;
        }
        const int32_t first = (at - packs) % p->m;
        count = p->m - first < end - row ? p->m - first : end - row;
        int32_t column;
        const struct fv_nn_gemm some = columns_of(p, gemm, (at - packs) / p->m, &column);
        const uint8_t *a = call->in[0] + (ptrdiff_t)b0 * p->a_batch[0] +
                           (ptrdiff_t)b1 * p->a_batch[1] + (ptrdiff_t)first * p->a_row;
        uint8_t *out = call->out[0] + ((ptrdiff_t)batch * p->m + first) * p->n + column;
        if (p->single_rounding)
            multiply_once(call, &some, a, out, count);
        else
            call->kernels->nn_gemm_u8(&some, a, p->a_row, out, p->n, count);
    }
}
