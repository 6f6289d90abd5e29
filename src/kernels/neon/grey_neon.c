#include "kernels/contracts/grey_ends.h"
#include "kernels/kernels.h"

#include <arm_neon.h>

static inline uint16x8_t words(const uint8_t *bytes)
{
    return vreinterpretq_u16_u8(vld1q_u8(bytes));
}

void fv_k_grey_shift_u16__neon(uint8_t *grey, const uint8_t *source, int32_t count, int32_t shift)
{
    const int16x8_t by = vdupq_n_s16((int16_t)-shift);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        const uint8x8_t a = vqmovn_u16(vshlq_u16(words(source + 2 * i), by));
        const uint8x8_t b = vqmovn_u16(vshlq_u16(words(source + 2 * i + 16), by));
        vst1q_u8(grey + i, vcombine_u8(a, b));
    }
    fv_k_grey_shift_u16__c(grey + i, source + 2 * i, count - i, shift);
}

void fv_k_grey_pick_u8__neon(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        const uint8x16x2_t pair = vld2q_u8(source + 2 * i);
        vst1q_u8(grey + i, offset == 0 ? pair.val[0] : pair.val[1]);
    }
    fv_k_grey_pick_u8__c(grey + i, source + 2 * i, count - i, offset);
}

void fv_k_grey_mix_u8__neon(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first, int32_t third)
{
    int32_t i = 0;
    for (; i + 8 <= count; i += 8) {
        const uint8x8x3_t s = vld3_u8(source + 3 * i);
        const uint16x8_t a = vmovl_u8(s.val[0]), g = vmovl_u8(s.val[1]), b = vmovl_u8(s.val[2]);
        uint32x4_t low = vmull_n_u16(vget_low_u16(a), (uint16_t)first);
        uint32x4_t high = vmull_high_n_u16(a, (uint16_t)first);
        low = vmlal_n_u16(vmlal_n_u16(low, vget_low_u16(g), 19235), vget_low_u16(b), (uint16_t)third);
        high = vmlal_high_n_u16(vmlal_high_n_u16(high, g, 19235), b, (uint16_t)third);
        vst1_u8(grey + i, vmovn_u16(vrshrn_high_n_u32(vrshrn_n_u32(low, 15), high, 15)));
    }
    fv_k_grey_mix_u8__c(grey + i, source + 3 * i, count - i, first, third);
}

static inline uint16x8_t column(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    return vaddq_u16(vaddl_u8(vld1_u8(above), vld1_u8(below)), vshll_n_u8(vld1_u8(row), 1));
}

void fv_k_grey_bayer_u8__neon(uint8_t *grey, const uint8_t *above, const uint8_t *row, const uint8_t *below,
                              int32_t count)
{
    int32_t x = 1;
    for (; x + 9 <= count; x += 8) {
        const uint16x8_t left = column(above + x - 1, row + x - 1, below + x - 1);
        const uint16x8_t middle = column(above + x, row + x, below + x);
        const uint16x8_t right = column(above + x + 1, row + x + 1, below + x + 1);
        const uint16x8_t sum = vaddq_u16(vaddq_u16(left, right), vshlq_n_u16(middle, 1));
        vst1_u8(grey + x, vrshrn_n_u16(sum, 4));
    }
    fv_k_grey_bayer_ends(grey, above, row, below, count, x);
}
