/* Fixed-point arithmetic of the softmax kernels, as gemmlowp has it. */
#ifndef FOVEA_KERNELS_NN_SOFTMAX_H
#define FOVEA_KERNELS_NN_SOFTMAX_H

#include <stdint.h>

/* gemmlowp's high product: floor((a b + 2^30) / 2^31), saturated in its one overflowing case. */
static inline int32_t fv_nn_high_product(int32_t a, int32_t b)
{
    if (a == INT32_MIN && b == INT32_MIN) return INT32_MAX;
    return (int32_t)(((int64_t)a * b + (INT64_C(1) << 30)) >> 31);
}

static inline int32_t fv_nn_divide_by_power(int32_t value, int32_t exponent)
{
    if (exponent == 0) return value;
    const int64_t half = INT64_C(1) << (exponent - 1);
    return (int32_t)((value + half - (value < 0 ? 1 : 0)) >> exponent);
}

static inline int32_t fv_nn_saturate(int64_t value)
{
    return value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : (int32_t)value;
}

/* 1 / (1 + x) for x in [0, 1), Q0.31: Newton-Raphson from 48/17 - 32/17 d as in gemmlowp. */
static inline int32_t fv_nn_one_over_one_plus(int32_t x)
{
    const int64_t sum = (int64_t)x + INT32_MAX;
    const int32_t half = (int32_t)((sum + (sum >= 0 ? 1 : -1)) / 2);
    int32_t y = (int32_t)(INT64_C(1515870810) + fv_nn_high_product(half, -1010580540)); /* Q2.29 */
    for (int i = 0; i < 3; i++) {
        const int32_t product = fv_nn_high_product(half, y);
        const int32_t error = (int32_t)((INT64_C(1) << 29) - product);
        y = (int32_t)((uint32_t)y +
                      (uint32_t)fv_nn_saturate((int64_t)fv_nn_high_product(y, error) * 4));
    }
    return fv_nn_saturate((int64_t)y * 2);
}

/* 1 / sum with sum in Q12.19: mantissa in Q0.31 and how many bits the sum exceeds one. */
static inline int32_t fv_nn_reciprocal(int32_t sum, int32_t *bits_over_unit)
{
    const int32_t zeros = sum <= 0 ? 0 : __builtin_clz((uint32_t)sum);
    *bits_over_unit = 12 - zeros;
    const uint32_t mantissa = ((uint32_t)sum << zeros) - (1u << 31);
    return fv_nn_one_over_one_plus((int32_t)mantissa);
}

#endif
