/* Scaling of accumulators by multiplier 2^(shift - 31), as gemmlowp's reference does it: the
 * product's high half rounded half up, then a division by a power of two rounded half away from
 * zero. Both roundings in one 64-bit expression: floor((floor((p + 2^30) / 2^31) + 2^(e-1) - [p <
 * 0]) / 2^e) = (p + 2^30 + 2^(30+e) - [p < 0] 2^31) >> (31 + e). */
#ifndef FOVEA_KERNELS_NN_REQUANTIZE_H
#define FOVEA_KERNELS_NN_REQUANTIZE_H

#include <stdint.h>

static inline int32_t fv_nn_requantize(int32_t value, int32_t multiplier, int32_t shift)
{
    const int64_t p = (int64_t)value * multiplier;
    if (shift >= 0) return (int32_t)((p + (INT64_C(1) << (30 - shift))) >> (31 - shift));
    const int64_t half = (INT64_C(1) << 30) + (INT64_C(1) << (30 - shift));
    return (int32_t)((p + half - (p < 0 ? INT64_C(1) << 31 : 0)) >> (31 - shift));
}

static inline int32_t fv_nn_clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

/* The byte that leaves a layer: cut to 16 bits (which changes nothing that the final range lets
 * through), moved, clamped. */
static inline uint8_t fv_nn_output(int32_t scaled, int32_t zero, int32_t low, int32_t high)
{
    return (uint8_t)fv_nn_clamp(fv_nn_clamp(scaled, -32768, 32767) + zero, low, high);
}

/* Sum modulo 2^32: what every variant computes, and no undefined overflow for models with absurd
 * multipliers. */
static inline int32_t fv_nn_sum(int32_t a, int32_t b)
{
    return (int32_t)((uint32_t)a + (uint32_t)b);
}

#endif
