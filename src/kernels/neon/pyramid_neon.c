#include "kernels/kernels.h"

#include <arm_neon.h>

void fv_k_blend_rows_u8__neon(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                              int32_t weight_b)
{
    const uint8x16_t wb = vdupq_n_u8((uint8_t)weight_b), wa = vdupq_n_u8((uint8_t)(128 - weight_b));
    for (int32_t i = 0; i < count; i += 16) {
        const uint8x16_t pa = vld1q_u8(a + i), pb = vld1q_u8(b + i);
        const uint16x8_t low =
            vmlal_u8(vmull_u8(vget_low_u8(pa), vget_low_u8(wa)), vget_low_u8(pb), vget_low_u8(wb));
        const uint16x8_t high = vmlal_high_u8(vmull_high_u8(pa, wa), pb, wb);
        vst1q_u8(out + i, vrshrn_high_n_u16(vrshrn_n_u16(low, 7), high, 7));
    }
}

/* 15 outputs of which the first has phase 0, from 18 inputs; the 16th is right as well, but steps
 * of 15 keep the phase. */
static const uint8_t first_of_15[16] = {0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 12, 13, 14, 15, 16, 18};
static const uint8_t weight_of_15[16] = {13, 38,  64, 90, 115, 13, 38,  64,
                                         90, 115, 13, 38, 64,  90, 115, 13};

void fv_k_shrink_row_u8__neon(uint8_t *out, const uint8_t *in, int32_t count)
{
    const uint8x16_t first = vld1q_u8(first_of_15), second = vaddq_u8(first, vdupq_n_u8(1));
    const uint8x16_t wb = vld1q_u8(weight_of_15), wa = vsubq_u8(vdupq_n_u8(128), wb);
    for (int32_t i = 0; i < count; i += 15) {
        const uint8_t *from = in + i / 5 * 6;
        const uint8x16x2_t pixels = {{vld1q_u8(from), vld1q_u8(from + 16)}};
        const uint8x16_t pa = vqtbl2q_u8(pixels, first), pb = vqtbl2q_u8(pixels, second);
        const uint16x8_t low =
            vmlal_u8(vmull_u8(vget_low_u8(pa), vget_low_u8(wa)), vget_low_u8(pb), vget_low_u8(wb));
        const uint16x8_t high = vmlal_high_u8(vmull_high_u8(pa, wa), pb, wb);
        vst1q_u8(out + i, vrshrn_high_n_u16(vrshrn_n_u16(low, 7), high, 7));
    }
}
