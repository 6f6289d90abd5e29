#include "kernels/neon/nn_neon.h"

void fv_k_nn_table_u8__neon(const uint8_t *table, const uint8_t *in, uint8_t *out, int32_t count)
{
    struct output o;
    init_output(&o, 0, 0, 255, table);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16)
        vst1q_u8(out + i, look_up(&o, vld1q_u8(in + i)));
    fv_k_nn_table_u8__c(table, in + i, out + i, count - i);
}

/* One factor of a sum for all lanes. */
struct factor {
    int32x4_t zero, multiplier, left, right;
};

static struct factor factor_of(int32_t zero, int32_t multiplier, int32_t shift)
{
    return (struct factor){vdupq_n_s32(zero), vdupq_n_s32(multiplier),
                           vdupq_n_s32(shift > 0 ? shift : 0), vdupq_n_s32(shift < 0 ? shift : 0)};
}

FV_INLINE int32x4_t term(int32x4_t value, const struct factor *f)
{
    return requantize(vshlq_n_s32(vsubq_s32(value, f->zero), 20), f->multiplier, f->left, f->right);
}

FV_INLINE void widen(const uint8_t *from, int32x4_t out[4])
{
    const uint8x16_t v = vld1q_u8(from);
    const uint16x8_t low = vmovl_u8(vget_low_u8(v)), high = vmovl_u8(vget_high_u8(v));
    out[0] = vreinterpretq_s32_u32(vmovl_u16(vget_low_u16(low)));
    out[1] = vreinterpretq_s32_u32(vmovl_u16(vget_high_u16(low)));
    out[2] = vreinterpretq_s32_u32(vmovl_u16(vget_low_u16(high)));
    out[3] = vreinterpretq_s32_u32(vmovl_u16(vget_high_u16(high)));
}

void fv_k_nn_add_u8__neon(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    const struct factor fa = factor_of(p->zero_a, p->m_a, p->s_a),
                        fb = factor_of(p->zero_b, p->m_b, p->s_b);
    const struct factor fo = factor_of(0, p->m_out, p->s_out);
    struct output o;
    init_output(&o, p->zero_out, p->act_min, p->act_max, NULL);
    for (int32_t r = 0; r < rows; r++, a += lda, b += ldb, out += ldo) {
        for (int32_t i = 0; i < count; i += 16) {
            const int32_t width = count - i < 16 ? count - i : 16;
            uint8_t rest[2][16] = {{0}};
            const uint8_t *from[2] = {a + i, b + i};
            for (int k = 0; k < 2 && width < 16; k++)
                from[k] = memcpy(rest[k], from[k], (size_t)width);
            int32x4_t x[4], y[4];
            widen(from[0], x);
            widen(from[1], y);
            for (int k = 0; k < 4; k++) {
                const int32x4_t sum = vaddq_s32(term(x[k], &fa), term(y[k], &fb));
                x[k] = requantize(sum, fo.multiplier, fo.left, fo.right);
            }
            store16(&o, x, out + i, width);
        }
    }
}
