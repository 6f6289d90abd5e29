#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"

void fv_k_nn_table_u8__c(const uint8_t *table, const uint8_t *in, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; ++i) out[i] = table[in[i]];
}

void fv_k_nn_add_u8__c(const struct fv_nn_add *p, const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; ++i) {
        const int32_t x = fv_nn_requantize((a[i] - p->zero_a) * (1 << 20), p->m_a, p->s_a);
        const int32_t y = fv_nn_requantize((b[i] - p->zero_b) * (1 << 20), p->m_b, p->s_b);
        const int32_t sum = fv_nn_requantize(fv_nn_sum(x, y), p->m_out, p->s_out);
        out[i] = fv_nn_output(sum, p->zero_out, p->act_min, p->act_max);
    }
}

void fv_k_nn_max_u8__c(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; ++i) out[i] = a[i] > b[i] ? a[i] : b[i];
}

void fv_k_nn_transpose_u8__c(const uint8_t *in, ptrdiff_t ldi, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t columns)
{
    for (int32_t c = 0; c < columns; ++c) {
        for (int32_t r = 0; r < rows; ++r) out[c * ldo + r] = in[r * ldi + c];
    }
}
