/* What the NEON network kernels share: exact requantisation, packing, tables. Included by files of
 * one instruction set each; everything is inlined there. */
#ifndef FOVEA_KERNELS_NEON_NN_NEON_H
#define FOVEA_KERNELS_NEON_NN_NEON_H

#include <arm_neon.h>
#include <stdbool.h>
#include <string.h>

#include "kernels/kernels.h"

#define FV_INLINE static inline __attribute__((always_inline))

/* Constants of 16 channels. sqrdmulh is gemmlowp's high product; srshl rounds halves up, so one is
 * taken off negative values first where the shift is to the right. */
struct scale16 {
    int32x4_t multiplier[4], left[4], right[4];
    bool up; /* some channel is shifted to the left */
};

FV_INLINE void load_scale(struct scale16 *s, const int32_t *multiplier, const int32_t *shift)
{
    const int32x4_t zero = vdupq_n_s32(0);
    int32x4_t most = zero;
    for (int i = 0; i < 4; i++) {
        const int32x4_t h = vld1q_s32(shift + 4 * i);
        most = vmaxq_s32(most, h);
        s->multiplier[i] = vld1q_s32(multiplier + 4 * i);
        s->left[i] = vmaxq_s32(h, zero);
        s->right[i] = vminq_s32(h, zero);
    }
    s->up = vmaxvq_s32(most) > 0;
}

FV_INLINE int32x4_t requantize_down(int32x4_t acc, int32x4_t multiplier, int32x4_t right)
{
    const int32x4_t high = vqrdmulhq_s32(acc, multiplier);
    const int32x4_t fix = vshrq_n_s32(vandq_s32(high, right), 31);
    return vrshlq_s32(vqaddq_s32(high, fix), right);
}

/* Of values that a shift to the left by `left` leaves in 32 bits. */
FV_INLINE int32x4_t requantize(int32x4_t acc, int32x4_t multiplier, int32x4_t left, int32x4_t right)
{
    return requantize_down(vshlq_s32(acc, left), multiplier, right);
}

/* Of any values, in 64 bits, by shifts of at least 0. */
FV_INLINE int32x4_t requantize_up(int32x4_t acc, int32x4_t multiplier, int32x4_t left)
{
    const int32x4_t shift = vsubq_s32(left, vdupq_n_s32(31));
    const int64x2_t low = vmull_s32(vget_low_s32(acc), vget_low_s32(multiplier)),
                    high = vmull_high_s32(acc, multiplier);
    return vmovn_high_s64(vmovn_s64(vrshlq_s64(low, vmovl_s32(vget_low_s32(shift)))),
                          vrshlq_s64(high, vmovl_high_s32(shift)));
}

FV_INLINE void requantize16(int32x4_t v[4], const struct scale16 *s)
{
    for (int i = 0; i < 4; i++) {
        const int32x4_t down = requantize_down(v[i], s->multiplier[i], s->right[i]);
        v[i] = s->up ? vbslq_s32(vcgtzq_s32(s->left[i]),
                                 requantize_up(v[i], s->multiplier[i], s->left[i]), down)
                     : down;
    }
}

/* How results become bytes. */
struct output {
    int16x8_t zero;
    uint8x16_t low, high;
    const uint8_t *table;
    uint8x16x4_t part[4];
};

FV_INLINE void init_output(struct output *o, int32_t zero, int32_t low, int32_t high,
                           const uint8_t *table)
{
    o->zero = vdupq_n_s16((int16_t)zero);
    o->low = vdupq_n_u8((uint8_t)low);
    o->high = vdupq_n_u8((uint8_t)high);
    o->table = table;
    for (int i = 0; i < 4 && table != NULL; i++)
        o->part[i] = vld1q_u8_x4(table + 64 * i);
}

FV_INLINE uint8x16_t look_up(const struct output *o, uint8x16_t index)
{
    uint8x16_t out = vqtbl4q_u8(o->part[0], index);
    out = vqtbx4q_u8(out, o->part[1], vsubq_u8(index, vdupq_n_u8(64)));
    out = vqtbx4q_u8(out, o->part[2], vsubq_u8(index, vdupq_n_u8(128)));
    return vqtbx4q_u8(out, o->part[3], vsubq_u8(index, vdupq_n_u8(192)));
}

/* 16 scaled values to bytes, of which `width` are stored. */
FV_INLINE void store16(const struct output *o, const int32x4_t v[4], uint8_t *out, int32_t width)
{
    const int16x8_t a = vqaddq_s16(vcombine_s16(vqmovn_s32(v[0]), vqmovn_s32(v[1])), o->zero);
    const int16x8_t b = vqaddq_s16(vcombine_s16(vqmovn_s32(v[2]), vqmovn_s32(v[3])), o->zero);
    uint8x16_t bytes = vcombine_u8(vqmovun_s16(a), vqmovun_s16(b));
    bytes = vminq_u8(vmaxq_u8(bytes, o->low), o->high);
    if (o->table != NULL) bytes = look_up(o, bytes);
    if (width == 16) {
        vst1q_u8(out, bytes);
        return;
    }
    uint8_t part[16];
    vst1q_u8(part, bytes);
    memcpy(out, part, (size_t)width);
}

#endif
