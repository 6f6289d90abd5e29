#include "kernels/kernels.h"

void fv_k_blend_rows_u8__c(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                           int32_t weight_b)
{
    for (int32_t i = 0; i < count; i++)
        out[i] = (uint8_t)((a[i] * (128 - weight_b) + b[i] * weight_b + 64) >> 7);
}

void fv_k_shrink_row_u8__c(uint8_t *out, const uint8_t *in, int32_t count)
{
    static const uint8_t weight[5] = {13, 38, 64, 90, 115};
    for (int32_t i = 0; i < count; i++) {
        const int32_t j = i + i / 5, w = weight[i % 5];
        out[i] = (uint8_t)((in[j] * (128 - w) + in[j + 1] * w + 64) >> 7);
    }
}
