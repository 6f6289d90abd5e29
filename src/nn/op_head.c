/* Softmax, arg max and products of two computed matrices. */
#include "kernels/nn_requantize.h"
#include "nn/run.h"

/* gemmlowp's high product: floor((a b + 2^30) / 2^31), saturated in its one overflowing case. */
static int32_t high_product(int32_t a, int32_t b)
{
    if (a == INT32_MIN && b == INT32_MIN) return INT32_MAX;
    return (int32_t)(((int64_t)a * b + (INT64_C(1) << 30)) >> 31);
}

static int32_t divide_by_power(int32_t value, int32_t exponent)
{
    if (exponent == 0) return value;
    const int64_t half = INT64_C(1) << (exponent - 1);
    return (int32_t)((value + half - (value < 0 ? 1 : 0)) >> exponent);
}

static int32_t saturate(int64_t value)
{
    return value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : (int32_t)value;
}

/* 1 / (1 + x) for x in [0, 1), Q0.31: Newton-Raphson from 48/17 - 32/17 d as in gemmlowp. */
static int32_t one_over_one_plus(int32_t x)
{
    const int64_t sum = (int64_t)x + INT32_MAX;
    const int32_t half = (int32_t)((sum + (sum >= 0 ? 1 : -1)) / 2);
    int32_t y = (int32_t)(INT64_C(1515870810) + high_product(half, -1010580540)); /* Q2.29 */
    for (int i = 0; i < 3; ++i) {
        const int32_t product = high_product(half, y);
        const int32_t error = (int32_t)((INT64_C(1) << 29) - product);
        y = (int32_t)((uint32_t)y + (uint32_t)saturate((int64_t)high_product(y, error) * 4));
    }
    return saturate((int64_t)y * 2);
}

/* 1 / sum with sum in Q12.19: mantissa in Q0.31 and how many bits the sum exceeds one. */
static int32_t reciprocal(int32_t sum, int32_t *bits_over_unit)
{
    const int32_t zeros = sum <= 0 ? 0 : __builtin_clz((uint32_t)sum);
    *bits_over_unit = 12 - zeros;
    const uint32_t mantissa = ((uint32_t)sum << zeros) - (1u << 31);
    return one_over_one_plus((int32_t)mantissa);
}

void fv_nn_op_softmax(const struct fv_nn_call *call, int32_t begin, int32_t end)
{
    const struct fv_op_softmax *p = &call->op->u.softmax;
    const int32_t *exps = (const int32_t *)(const void *)(call->model->base + p->table);
    for (int32_t row = begin; row < end; ++row) {
        const uint8_t *in = call->in[0] + (ptrdiff_t)row * p->depth;
        uint8_t *out = call->out[0] + (ptrdiff_t)row * p->depth;
        int32_t largest = 0;
        for (int32_t i = 0; i < p->depth; ++i) largest = in[i] > largest ? in[i] : largest;
        uint32_t sum = 0;
        for (int32_t i = 0; i < p->depth; ++i) {
            const int32_t e = exps[largest - in[i]];
            if (e >= 0) sum += (uint32_t)divide_by_power(e, 12);
        }
        int32_t over;
        const int32_t scale = reciprocal((int32_t)sum, &over);
        const int32_t exponent = fv_nn_clamp(over + 31 - 8, 0, 31);
        for (int32_t i = 0; i < p->depth; ++i) {
            const int32_t e = exps[largest - in[i]];
            out[i] = e < 0 ? 0 : (uint8_t)fv_nn_clamp(divide_by_power(high_product(scale, e), exponent), 0, 255);
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
