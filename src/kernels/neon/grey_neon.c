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

/* Eight of the weighted sums, rounded. */
static inline uint16x8_t mixed(uint16x8_t a, uint16x8_t g, uint16x8_t b, uint16_t first,
                               uint16_t third)
{
    uint32x4_t low = vmull_n_u16(vget_low_u16(a), first), high = vmull_high_n_u16(a, first);
    low = vmlal_n_u16(vmlal_n_u16(low, vget_low_u16(g), 19235), vget_low_u16(b), third);
    high = vmlal_high_n_u16(vmlal_high_n_u16(high, g, 19235), b, third);
    return vrshrn_high_n_u32(vrshrn_n_u32(low, 15), high, 15);
}

void fv_k_grey_mix_u8__neon(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first,
                            int32_t third)
{
    const uint16_t one = (uint16_t)first, three = (uint16_t)third;
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        const uint8x16x3_t s = vld3q_u8(source + 3 * i);
        const uint16x8_t low =
            mixed(vmovl_u8(vget_low_u8(s.val[0])), vmovl_u8(vget_low_u8(s.val[1])),
                  vmovl_u8(vget_low_u8(s.val[2])), one, three);
        const uint16x8_t high = mixed(vmovl_high_u8(s.val[0]), vmovl_high_u8(s.val[1]),
                                      vmovl_high_u8(s.val[2]), one, three);
        vst1q_u8(grey + i, vuzp1q_u8(vreinterpretq_u8_u16(low), vreinterpretq_u8_u16(high)));
    }
    fv_k_grey_mix_u8__c(grey + i, source + 3 * i, count - i, first, third);
}

/* Sums down sixteen columns. */
static inline uint16x8x2_t columns(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    const uint8x16_t a = vld1q_u8(above), r = vld1q_u8(row), b = vld1q_u8(below);
    return (uint16x8x2_t){
        {vaddq_u16(vaddl_u8(vget_low_u8(a), vget_low_u8(b)), vshll_n_u8(vget_low_u8(r), 1)),
         vaddq_u16(vaddl_high_u8(a, b), vshll_high_n_u8(r, 1))}};
}

/* Eight outputs: `left` holds the columns from one before the first output on, `next` the eight
 * after those. */
static inline uint16x8_t binomial(uint16x8_t left, uint16x8_t next)
{
    const uint16x8_t middle = vextq_u16(left, next, 1), right = vextq_u16(left, next, 2);
    return vaddq_u16(vaddq_u16(left, right), vaddq_u16(middle, middle));
}

/* Sixteen outputs from x on; reads the columns x - 1 .. x + 22. */
static inline void bayer_sixteen(uint8_t *grey, uint16x8_t left, uint16x8x2_t next)
{
    vst1q_u8(grey, vrshrn_high_n_u16(vrshrn_n_u16(binomial(left, next.val[0]), 4),
                                     binomial(next.val[0], next.val[1]), 4));
}

void fv_k_grey_bayer_u8__neon(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                              const uint8_t *below, int32_t count)
{
    if (count < 24) {
        fv_k_grey_bayer_u8__c(grey, above, row, below, count);
        return;
    }
    const int32_t last = count - 23;
    int32_t x = 1;
    uint16x8_t left = columns(above, row, below).val[0];
    for (; x <= last; x += 16) {
        const uint16x8x2_t next = columns(above + x + 7, row + x + 7, below + x + 7);
        bayer_sixteen(grey + x, left, next);
        left = next.val[1];
    }
    /* Up to 21 outputs are left of those with two neighbours: one vector more that overlaps, and
     * the others one by one. */
    if (x > last && x < count - 7) {
        left = columns(above + last - 1, row + last - 1, below + last - 1).val[0];
        bayer_sixteen(grey + last, left,
                      columns(above + last + 7, row + last + 7, below + last + 7));
        x = last + 16;
    }
    fv_k_grey_bayer_ends(grey, above, row, below, count, x);
}
