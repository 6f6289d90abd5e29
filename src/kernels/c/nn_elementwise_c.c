#include <string.h>

#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"

void fv_k_nn_table_u8__c(const uint8_t *table, const uint8_t *in, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        out[i] = table[in[i]];
}

static void add_row(const struct fv_nn_add *p, const uint8_t *a, const uint8_t *b, uint8_t *out,
                    int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t x = fv_nn_requantize((a[i] - p->zero_a) * (1 << 20), p->m_a, p->s_a);
        const int32_t y = fv_nn_requantize((b[i] - p->zero_b) * (1 << 20), p->m_b, p->s_b);
        const int32_t sum = fv_nn_requantize(fv_nn_sum(x, y), p->m_out, p->s_out);
        out[i] = fv_nn_output(sum, p->zero_out, p->act_min, p->act_max);
    }
}

void fv_k_nn_add_u8__c(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b,
                       ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    for (int32_t r = 0; r < rows; r++)
        add_row(p, a + r * lda, b + r * ldb, out + r * ldo, count);
}

static void sub_row(const struct fv_nn_add *p, const uint8_t *a, const uint8_t *b, uint8_t *out,
                    int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t x = fv_nn_requantize((a[i] - p->zero_a) * (1 << 20), p->m_a, p->s_a);
        const int32_t y = fv_nn_requantize((b[i] - p->zero_b) * (1 << 20), p->m_b, p->s_b);
        const int32_t difference = (int32_t)((uint32_t)x - (uint32_t)y);
        const int32_t scaled = fv_nn_requantize(difference, p->m_out, p->s_out);
        out[i] = fv_nn_output(scaled, p->zero_out, p->act_min, p->act_max);
    }
}

void fv_k_nn_sub_u8__c(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b,
                       ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    for (int32_t r = 0; r < rows; r++)
        sub_row(p, a + r * lda, b + r * ldb, out + r * ldo, count);
}

static void mul_row(const struct fv_nn_add *p, const uint8_t *a, const uint8_t *b, uint8_t *out,
                    int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t product = (a[i] - p->zero_a) * (b[i] - p->zero_b);
        const int32_t scaled = fv_nn_requantize(product, p->m_out, p->s_out);
        out[i] = fv_nn_output(scaled, p->zero_out, p->act_min, p->act_max);
    }
}

void fv_k_nn_mul_u8__c(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b,
                       ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    for (int32_t r = 0; r < rows; r++)
        mul_row(p, a + r * lda, b + r * ldb, out + r * ldo, count);
}

static void prelu_row(const struct fv_nn_add *p, const uint8_t *a, const uint8_t *b, uint8_t *out,
                      int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const int32_t x = a[i] - p->zero_a;
        const int32_t scaled = x >= 0
                                   ? fv_nn_requantize(x, p->m_a, p->s_a)
                                   : fv_nn_requantize(x * (b[i] - p->zero_b), p->m_out, p->s_out);
        out[i] = fv_nn_output(scaled, p->zero_out, p->act_min, p->act_max);
    }
}

void fv_k_nn_prelu_u8__c(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                         const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows,
                         int32_t count)
{
    for (int32_t r = 0; r < rows; r++)
        prelu_row(p, a + r * lda, b + r * ldb, out + r * ldo, count);
}

void fv_k_nn_min_u8__c(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        out[i] = a[i] < b[i] ? a[i] : b[i];
}

void fv_k_nn_max_u8__c(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        out[i] = a[i] > b[i] ? a[i] : b[i];
}

void fv_k_nn_transpose_u8__c(const uint8_t *in, ptrdiff_t ldi, uint8_t *out, ptrdiff_t ldo,
                             int32_t rows, int32_t columns)
{
    for (int32_t c = 0; c < columns; c++) {
        for (int32_t r = 0; r < rows; r++)
            out[c * ldo + r] = in[r * ldi + c];
    }
}

void fv_k_nn_blend_u8__c(const struct fv_nn_blend *p, const uint8_t *top, const uint8_t *bottom,
                         int32_t weight, uint8_t *out)
{
    const int32_t one = 1 << p->bits, half = (1 << 2 * p->bits) >> 1;
    const int32_t middle = half == 0 ? 0 : p->middle << 2 * p->bits;
    for (int32_t x = 0; x < p->out_w; x++, out += p->out_stride) {
        const int32_t *entry = p->columns + (ptrdiff_t)3 * x;
        const ptrdiff_t low = (ptrdiff_t)entry[0] * p->in_stride,
                        high = (ptrdiff_t)entry[1] * p->in_stride;
        for (int32_t c = 0; c < p->channels; c++) {
            const int32_t left = top[low + c] * (one - weight) + bottom[low + c] * weight;
            const int32_t right = top[high + c] * (one - weight) + bottom[high + c] * weight;
            const int32_t sum = left * (one - entry[2]) + right * entry[2];
            out[c] = (uint8_t)((sum + half - (sum < middle)) >> 2 * p->bits);
        }
    }
}

void fv_k_nn_argmax_u8__c(const uint8_t *in, int32_t axis, int32_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i++, in += axis) {
        out[i] = 0;
        for (int32_t k = 1; k < axis; k++) {
            if (in[k] > in[out[i]]) out[i] = k;
        }
    }
}

/* Short runs are many, and a call of memcpy for each costs more than the bytes: pieces of 16 are
 * moved inline. */
void fv_k_nn_gather_u8__c(const uint8_t *in, ptrdiff_t step, uint8_t *out, ptrdiff_t pitch,
                          int32_t run, int32_t count)
{
    for (int32_t i = 0; i < count; i++, in += step, out += pitch) {
        for (int32_t at = 0; at < run; at += 16)
            memcpy(out + at, in + at, 16);
    }
}
