#include "kernels/kernels.h"

#include <arm_neon.h>

void fv_k_grey_shift_u16__neon(uint8_t *grey, const uint16_t *source, int32_t count, int32_t shift)
{
    const int16x8_t by = vdupq_n_s16((int16_t)-shift);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        const uint8x8_t a = vqmovn_u16(vshlq_u16(vld1q_u16(source + i), by));
        const uint8x8_t b = vqmovn_u16(vshlq_u16(vld1q_u16(source + i + 8), by));
        vst1q_u8(grey + i, vcombine_u8(a, b));
    }
    fv_k_grey_shift_u16__c(grey + i, source + i, count - i, shift);
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
