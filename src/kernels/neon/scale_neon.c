#include <arm_neon.h>

/* Upper halves of the eight products. */
static inline uint16x8_t high(uint16x8_t a, uint16x8_t b)
{
    const uint32x4_t low = vmull_u16(vget_low_u16(a), vget_low_u16(b));
    const uint32x4_t up = vmull_high_u16(a, b);
    return vuzp2q_u16(vreinterpretq_u16_u32(low), vreinterpretq_u16_u32(up));
}

#define SIGNED(v) vreinterpretq_s16_u16(v)
#define UNSIGNED(v) vreinterpretq_u16_s16(v)

#define FV_NAME(kernel) fv_k_##kernel##__neon
#define VECTOR uint16x8_t
#define LANES 8
#define LOAD(p) vld1q_u16((const uint16_t *)(const void *)(p))
#define STORE(p, v) vst1q_u16((uint16_t *)(void *)(p), v)
#define EACH(n) vdupq_n_u16((uint16_t)(n))
#define ADD(a, b) vaddq_u16(a, b)
#define SUB(a, b) vsubq_u16(a, b)
#define OR(a, b) vorrq_u16(a, b)
#define AND(a, b) vandq_u16(a, b)
#define HIGH(a, b) high(a, b)
#define MIN_U(a, b) vminq_u16(a, b)
#define MIN_S(a, b) UNSIGNED(vminq_s16(SIGNED(a), SIGNED(b)))
#define MAX_S(a, b) UNSIGNED(vmaxq_s16(SIGNED(a), SIGNED(b)))
#define ABOVE(a, b) vcgtq_s16(SIGNED(a), SIGNED(b))
#define UNLESS(a, b) vbicq_u16(b, a)
#include "kernels/scale_vectors.h"
