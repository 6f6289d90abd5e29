/* Slopes by channel of bytes, in float32. */
#include "kernels/neon/nn_neon.h"

enum { SLOPES_LANES = 8 };

struct job {
    int16x8_t zero_in, zero_out;
    float32x4_t rising;
};

/* The results of four bytes, without the output's zero point. */
FV_INLINE int32x4_t four(const struct job *j, int16x4_t x, const float *slopes)
{
    const int32x4_t words = vmovl_s16(x);
    const float32x4_t slope = vbslq_f32(vcltzq_s32(words), vld1q_f32(slopes), j->rising);
    return vcvtnq_s32_f32(vmulq_f32(vcvtq_f32_s32(words), slope));
}

/* Words saturate to 16 bits first: what they lose lies beyond a byte with any zero point. */
FV_INLINE uint8x8_t eight(const struct job *j, uint8x8_t bytes, const float *slopes)
{
    const int16x8_t x = vsubq_s16(vreinterpretq_s16_u16(vmovl_u8(bytes)), j->zero_in);
    const int16x8_t y = vcombine_s16(vqmovn_s32(four(j, vget_low_s16(x), slopes)),
                                     vqmovn_s32(four(j, vget_high_s16(x), slopes + 4)));
    return vqmovun_s16(vqaddq_s16(y, j->zero_out));
}

#include "kernels/nn_slopes_rows.h"

FV_INLINE struct job job_of(const struct fv_nn_slopes *p, float rising)
{
    return (struct job){vdupq_n_s16((int16_t)p->zero_in), vdupq_n_s16((int16_t)p->zero_out),
                        vdupq_n_f32(rising)};
}

FV_INLINE void vector(const struct job *job, const uint8_t *in, const float *slopes, uint8_t *out)
{
    vst1_u8(out, eight(job, vld1_u8(in), slopes));
}

void fv_k_nn_slopes_u8__neon(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                             uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    slopes_rows(p, in, ldi, out, ldo, rows, count);
}
