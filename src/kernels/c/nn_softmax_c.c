#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"
#include "kernels/nn_softmax.h"

static void row(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth)
{
    int32_t largest = 0, over;
    for (int32_t i = 0; i < depth; i++)
        largest = in[i] > largest ? in[i] : largest;
    uint32_t sum = 0;
    for (int32_t i = 0; i < depth; i++) {
        const int32_t e = exps[largest - in[i]];
        if (e >= 0) sum += (uint32_t)fv_nn_divide_by_power(e, 12);
    }
    const int32_t scale = fv_nn_reciprocal((int32_t)sum, &over);
    const int32_t exponent = fv_nn_clamp(over + 31 - 8, 0, 31);
    for (int32_t i = 0; i < depth; i++) {
        const int32_t e = exps[largest - in[i]];
        out[i] = e < 0 ? 0
                       : (uint8_t)fv_nn_clamp(
                             fv_nn_divide_by_power(fv_nn_high_product(scale, e), exponent), 0, 255);
    }
}

void fv_k_nn_softmax_u8__c(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                           int32_t rows)
{
    for (int32_t r = 0; r < rows; r++)
        row(exps, in + (ptrdiff_t)r * depth, out + (ptrdiff_t)r * depth, depth);
}
