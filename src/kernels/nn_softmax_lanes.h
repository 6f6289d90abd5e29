/* Softmax of packed bytes for vectors of LANES 32-bit words. A file of one instruction set defines
 * LANES, `lanes` (the vector) and the functions that this page calls, and then includes it. The
 * reciprocals of LANES rows are computed beside each other: of short rows they are most of the
 * work. */
#ifndef FOVEA_KERNELS_NN_SOFTMAX_LANES_H
#define FOVEA_KERNELS_NN_SOFTMAX_LANES_H

#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"
#include "kernels/nn_softmax.h"

/* The largest of a row. */
FV_INLINE int32_t largest_of(const uint8_t *in, int32_t depth)
{
    int32_t largest = 0;
    if (depth < 16) {
        for (int32_t i = 0; i < depth; i++)
            largest = in[i] > largest ? in[i] : largest;
        return largest;
    }
    return largest_of_many(in, depth);
}

/* What one element adds to its row's sum: (e + 2^11) >> 12, of those that are not left out. */
FV_INLINE int32_t term(int32_t e)
{
    return e < 0 ? 0 : (int32_t)(((uint32_t)e + (1 << 11)) >> 12);
}

/* Modulo 2^32, as the sum may pass 2^31. */
FV_INLINE int32_t row_sum(const int32_t *exps, const uint8_t *in, int32_t depth, int32_t largest)
{
    const lanes half = all_of(1 << 11);
    lanes sums = all_of(0);
    int32_t i = 0;
    for (; i + LANES <= depth; i += LANES) {
        const lanes e = above_zero(exponentials(exps, in + i, largest));
        sums = plus(sums, shifted(plus(e, half), 12));
    }
    uint32_t sum = (uint32_t)sum_of(sums);
    for (; i < depth; i++)
        sum += (uint32_t)term(exps[largest - in[i]]);
    return (int32_t)sum;
}

/* fv_nn_reciprocal of the sums of LANES rows, of which each is at least 2^19: no step saturates but
 * the last, where the mantissa is 0. */
FV_INLINE void reciprocals(const int32_t *sums, int32_t *scales, int32_t *exponents)
{
    int32_t mantissas[LANES];
    for (int r = 0; r < LANES; r++) {
        const int32_t zeros = sums[r] <= 0 ? 0 : __builtin_clz((uint32_t)sums[r]);
        mantissas[r] = (int32_t)(((uint32_t)sums[r] << zeros) - (1u << 31));
        exponents[r] = fv_nn_clamp(12 - zeros + 31 - 8, 0, 31);
    }
    const lanes half = plus(shifted(load(mantissas), 1), all_of(1 << 30));
    lanes y = plus(all_of(1515870810), high_product(half, all_of(-1010580540)));
    for (int i = 0; i < 3; i++) {
        const lanes error = minus(all_of(1 << 29), high_product(half, y));
        const lanes step = high_product(y, error);
        y = plus(y, plus(plus(step, step), plus(step, step)));
    }
    const lanes capped = smaller(y, all_of(1 << 30)); /* twice that is 2^31: one is taken off */
    const lanes twice = plus(capped, capped);
    store(scales, minus(twice, shifted(twice, 31)));
}

FV_INLINE void row_out(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                       int32_t largest, int32_t scale, int32_t exponent)
{
    const lanes factor = all_of(scale), bias = all_of((int32_t)((1u << exponent) >> 1));
    int32_t i = 0;
    for (; i + LANES <= depth; i += LANES) {
        const lanes e = exponentials(exps, in + i, largest);
        /* what is left out is -1, so that its product is below zero or zero */
        const lanes value = plus(above_zero(high_product(e, factor)), bias);
        store_bytes_of(out + i, shifted(value, exponent));
    }
    for (; i < depth; i++) {
        const int32_t e = exps[largest - in[i]];
        const int32_t value =
            e < 0 ? 0 : fv_nn_divide_by_power(fv_nn_high_product(scale, e), exponent);
        out[i] = (uint8_t)(value > 255 ? 255 : value);
    }
}

/* LANES rows that are shorter than two vectors, of which the first `count` are there: a lane holds
 * a row, so that the steps of all are done beside each other. */
FV_INLINE void narrow_rows(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                           int32_t count)
{
    int32_t values[2 * LANES][LANES], sums[LANES], scales[LANES], exponents[LANES], halves[LANES];
    lanes largest = all_of(0), sum = all_of(0);
    for (int32_t c = 0; c < depth; c++) {
        for (int32_t r = 0; r < LANES; r++)
            values[c][r] = r < count ? in[r * depth + c] : 0;
        largest = larger(largest, load(values[c]));
    }
    for (int32_t c = 0; c < depth; c++) {
        store(values[c], minus(largest, load(values[c])));
        for (int32_t r = 0; r < LANES; r++)
            values[c][r] = exps[values[c][r]];
        sum = plus(sum, shifted(plus(above_zero(load(values[c])), all_of(1 << 11)), 12));
    }
    store(sums, sum);
    reciprocals(sums, scales, exponents);
    for (int32_t r = 0; r < LANES; r++)
        halves[r] = (int32_t)((1u << exponents[r]) >> 1);
    const lanes factor = load(scales), right = load(exponents), bias = load(halves);
    for (int32_t c = 0; c < depth; c++) {
        const lanes value = plus(above_zero(high_product(load(values[c]), factor)), bias);
        store(values[c], smaller(shifted_each(value, right), all_of(255)));
        for (int32_t r = 0; r < count; r++)
            out[r * depth + c] = (uint8_t)values[c][r];
    }
}

FV_INLINE void softmax(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                       int32_t rows)
{
    for (int32_t first = 0; first < rows; first += LANES) {
        const int32_t count = rows - first < LANES ? rows - first : LANES;
        if (depth < 2 * LANES) {
            const ptrdiff_t at = (ptrdiff_t)first * depth;
            narrow_rows(exps, in + at, out + at, depth, count);
            continue;
        }
        int32_t largest[LANES], sums[LANES], scales[LANES], exponents[LANES];
        for (int32_t r = 0; r < LANES; r++) {
            const uint8_t *row = in + (ptrdiff_t)(first + r) * depth;
            largest[r] = r < count ? largest_of(row, depth) : 0;
            sums[r] = r < count ? row_sum(exps, row, depth, largest[r]) : 1 << 19;
        }
        reciprocals(sums, scales, exponents);
        for (int32_t r = 0; r < count; r++) {
            const ptrdiff_t at = (ptrdiff_t)(first + r) * depth;
            row_out(exps, in + at, out + at, depth, largest[r], scales[r], exponents[r]);
        }
    }
}

#endif
