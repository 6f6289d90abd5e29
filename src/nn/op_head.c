/* Softmax, arg max and products of two computed matrices. */
#include "kernels/nn_requantize.h"
#include "nn/run.h"

void fv_nn_op_softmax(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_softmax *p = &call->op->u.softmax;
    const int32_t *exps = (const int32_t *)(const void *)(call->model->base + p->table);
    const ptrdiff_t at = (ptrdiff_t)begin * p->depth;
    call->kernels->nn_softmax_u8(exps, call->in[0] + at, call->out[0] + at, p->depth, end - begin);
}

/* The largest along the last axis, which is packed. */
static void arg_max_rows(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_arg_max *p = &call->op->u.arg_max;
    int32_t best[64];
    for (int32_t row = begin, count; row < end; row += count) {
        count = end - row < 64 ? end - row : 64;
        call->kernels->nn_argmax_u8(call->in[0] + (ptrdiff_t)row * p->axis, p->axis, best, count);
        for (int32_t i = 0; i < count; ++i) {
            if (p->element_bytes == 8) ((int64_t *)(void *)call->out[0])[row + i] = best[i];
            else ((int32_t *)(void *)call->out[0])[row + i] = best[i];
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
    for (int32_t row = begin; row < end; ++row) {
        for (int32_t i = 0; i < p->inner; ++i) {
            const uint8_t *in = call->in[0] + (ptrdiff_t)row * p->axis * p->inner + i;
            int32_t best = 0, value = in[0];
            for (int32_t k = 1; k < p->axis; ++k) {
                const int32_t v = in[(ptrdiff_t)k * p->inner];
                if (p->minimum ? v < value : v > value) {
                    best = k;
                    value = v;
                }
            }
            const ptrdiff_t at = (ptrdiff_t)row * p->inner + i;
            if (p->element_bytes == 8) ((int64_t *)(void *)call->out[0])[at] = best;
            else ((int32_t *)(void *)call->out[0])[at] = best;
        }
    }
}

void fv_nn_op_matmul(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_matmul *p = &call->op->u.matmul;
    for (int32_t row = begin; row < end; ++row) {
        const int32_t i = row % p->m, b1 = row / p->m % p->batch[1], b0 = row / p->m / p->batch[1];
        const uint8_t *a = call->in[0] + (ptrdiff_t)b0 * p->a_batch[0] + (ptrdiff_t)b1 * p->a_batch[1] + (ptrdiff_t)i * p->a_row;
        const uint8_t *b = call->in[1] + (ptrdiff_t)b0 * p->b_batch[0] + (ptrdiff_t)b1 * p->b_batch[1];
        uint8_t *out = call->out[0] + (ptrdiff_t)row * p->n;
        for (int32_t j = 0; j < p->n; ++j) {
            uint32_t sum = 0;
            for (int32_t k = 0; k < p->k; ++k) {
                const int32_t x = a[(ptrdiff_t)k * p->a_column] - p->zero_a;
                const int32_t y = b[(ptrdiff_t)k * p->b_row + (ptrdiff_t)j * p->b_column] - p->zero_b;
                sum += (uint32_t)(x * y);
            }
            const int32_t scaled = fv_nn_requantize((int32_t)sum, p->multiplier, p->shift);
            out[j] = (uint8_t)fv_nn_clamp(fv_nn_sum(scaled, p->zero_out), 0, 255);
        }
    }
}
