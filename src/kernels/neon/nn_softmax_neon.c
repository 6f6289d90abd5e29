#include <arm_neon.h>
#include <stdint.h>
#include <string.h>

#define FV_INLINE static inline __attribute__((always_inline))

enum { LANES = 4 };
typedef int32x4_t lanes;

FV_INLINE lanes all_of(int32_t value)
{
    return vdupq_n_s32(value);
}

FV_INLINE lanes load(const int32_t *from)
{
    return vld1q_s32(from);
}

FV_INLINE void store(int32_t *to, lanes v)
{
    vst1q_s32(to, v);
}

FV_INLINE lanes plus(lanes a, lanes b)
{
    return vaddq_s32(a, b);
}

FV_INLINE lanes minus(lanes a, lanes b)
{
    return vsubq_s32(a, b);
}

FV_INLINE lanes smaller(lanes a, lanes b)
{
    return vminq_s32(a, b);
}

FV_INLINE lanes larger(lanes a, lanes b)
{
    return vmaxq_s32(a, b);
}

FV_INLINE lanes above_zero(lanes v)
{
    return vmaxq_s32(v, vdupq_n_s32(0));
}

/* To the right, of unsigned words. */
FV_INLINE lanes shifted(lanes v, int32_t bits)
{
    return vreinterpretq_s32_u32(vshlq_u32(vreinterpretq_u32_s32(v), vdupq_n_s32(-bits)));
}

FV_INLINE lanes shifted_each(lanes v, lanes bits)
{
    return vreinterpretq_s32_u32(vshlq_u32(vreinterpretq_u32_s32(v), vnegq_s32(bits)));
}

FV_INLINE lanes high_product(lanes a, lanes b)
{
    return vqrdmulhq_s32(a, b);
}

/* Of at least 16 bytes. */
FV_INLINE int32_t largest_of_many(const uint8_t *in, int32_t depth)
{
    uint8x16_t most = vld1q_u8(in + depth - 16);
    for (int32_t i = 0; i + 16 <= depth; i += 16)
        most = vmaxq_u8(most, vld1q_u8(in + i));
    return vmaxvq_u8(most);
}

/* Of four bytes, by their distances from the largest. */
FV_INLINE lanes exponentials(const int32_t *exps, const uint8_t *in, int32_t largest)
{
    const int32_t *from = exps + largest;
    const int32_t values[4] = {*(from - in[0]), *(from - in[1]), *(from - in[2]), *(from - in[3])};
    return vld1q_s32(values);
}

FV_INLINE int32_t sum_of(lanes v)
{
    return vaddvq_s32(v);
}

/* Four words, none above 2^15, cut to 255. */
FV_INLINE void store_bytes_of(uint8_t *to, lanes v)
{
    const uint16x4_t words = vqmovun_s32(v);
    const uint8x8_t bytes = vqmovn_u16(vcombine_u16(words, words));
    const uint32_t four = vget_lane_u32(vreinterpret_u32_u8(bytes), 0);
    memcpy(to, &four, sizeof four);
}

#include "kernels/nn_softmax_lanes.h"

void fv_k_nn_softmax_u8__neon(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                              int32_t rows)
{
    softmax(exps, in, out, depth, rows);
}
