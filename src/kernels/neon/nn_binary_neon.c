/* Element-wise differences, products and PRELU of bytes. */
#include "kernels/neon/nn_neon.h"

enum function { SUB, MUL, PRELU };

/* One factor for all lanes. */
struct factor {
    int32x4_t multiplier, left, right;
};

struct job {
    struct factor a, b, out;
    uint8x8_t zero_a, zero_b;
    struct output output;
};

static struct factor factor_of(int32_t multiplier, int32_t shift)
{
    return (struct factor){vdupq_n_s32(multiplier), vdupq_n_s32(shift > 0 ? shift : 0),
                           vdupq_n_s32(shift < 0 ? shift : 0)};
}

FV_INLINE int32x4_t scaled(int32x4_t value, const struct factor *f)
{
    return requantize(value, f->multiplier, f->left, f->right);
}

/* The results of four elements without their zero points. */
FV_INLINE int32x4_t four(const struct job *j, int16x4_t x, int16x4_t y,
                         const enum function function)
{
    const int32x4_t wide = vmovl_s16(x);
    if (function == SUB) {
        const int32x4_t u = scaled(vshlq_n_s32(wide, 20), &j->a),
                        v = scaled(vshlq_n_s32(vmovl_s16(y), 20), &j->b);
        return scaled(vsubq_s32(u, v), &j->out);
    }
    const int32x4_t product = scaled(vmull_s16(x, y), &j->out);
    if (function == MUL) return product;
    return vbslq_s32(vcltzq_s32(wide), product, scaled(wide, &j->a));
}

FV_INLINE void sixteen(const struct job *j, const uint8_t *from_a, const uint8_t *from_b,
                       uint8_t *out, int32_t width, const enum function function)
{
    const uint8x16_t a = vld1q_u8(from_a), b = vld1q_u8(from_b);
    const int16x8_t x[2] = {vreinterpretq_s16_u16(vsubl_u8(vget_low_u8(a), j->zero_a)),
                            vreinterpretq_s16_u16(vsubl_u8(vget_high_u8(a), j->zero_a))};
    const int16x8_t y[2] = {vreinterpretq_s16_u16(vsubl_u8(vget_low_u8(b), j->zero_b)),
                            vreinterpretq_s16_u16(vsubl_u8(vget_high_u8(b), j->zero_b))};
    int32x4_t results[4];
    for (int i = 0; i < 2; i++) {
        results[2 * i] = four(j, vget_low_s16(x[i]), vget_low_s16(y[i]), function);
        results[2 * i + 1] = four(j, vget_high_s16(x[i]), vget_high_s16(y[i]), function);
    }
    store16(&j->output, results, out, width);
}

/* Left shifts that no value leaves 32 bits by; plain C does the others, of which no real model has
 * one. */
static int fits(const struct fv_nn_add *p, const enum function function)
{
    return p->s_out <= (function == SUB ? 0 : 14) && (function != PRELU || p->s_a <= 14);
}

FV_INLINE void binary(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b,
                      ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count,
                      const enum function function)
{
    struct job j = {.a = factor_of(p->m_a, p->s_a),
                    .b = factor_of(p->m_b, p->s_b),
                    .out = factor_of(p->m_out, p->s_out),
                    .zero_a = vdup_n_u8((uint8_t)p->zero_a),
                    .zero_b = vdup_n_u8((uint8_t)p->zero_b)};
    init_output(&j.output, p->zero_out, p->act_min, p->act_max, NULL);
    for (int32_t r = 0; r < rows; r++, a += lda, b += ldb, out += ldo) {
        int32_t i = 0;
        for (; i + 16 <= count; i += 16)
            sixteen(&j, a + i, b + i, out + i, 16, function);
        if (i == count) continue;
        uint8_t rest_a[16] = {0}, rest_b[16] = {0};
        memcpy(rest_a, a + i, (size_t)(count - i));
        memcpy(rest_b, b + i, (size_t)(count - i));
        sixteen(&j, rest_a, rest_b, out + i, count - i, function);
    }
}

void fv_k_nn_sub_u8__neon(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    if (fits(p, SUB))
        binary(p, a, lda, b, ldb, out, ldo, rows, count, SUB);
    else
        fv_k_nn_sub_u8__c(p, a, lda, b, ldb, out, ldo, rows, count);
}

void fv_k_nn_mul_u8__neon(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    if (fits(p, MUL))
        binary(p, a, lda, b, ldb, out, ldo, rows, count, MUL);
    else
        fv_k_nn_mul_u8__c(p, a, lda, b, ldb, out, ldo, rows, count);
}

void fv_k_nn_prelu_u8__neon(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                            const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                            int32_t rows, int32_t count)
{
    if (fits(p, PRELU))
        binary(p, a, lda, b, ldb, out, ldo, rows, count, PRELU);
    else
        fv_k_nn_prelu_u8__c(p, a, lda, b, ldb, out, ldo, rows, count);
}
