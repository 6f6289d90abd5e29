#include "kernels/kernels.h"

#include <arm_neon.h>

/* Left and right of the centre have weights |u| of their own, and are subtracted at the end; pixels
 * outside the circle have weight 0. */
struct fv_moments_weights {
    uint8x16_t left, right;       /* |u| */
    uint8x16_t left_in, right_in; /* 1 within the circle */
};

static inline uint32x4_t moments_row(uint32x4_t *left, uint32x4_t *right, const uint8_t *row,
                                     const struct fv_moments_weights *weights)
{
    const uint8x16_t a = vld1q_u8(row - 16), b = vld1q_u8(row);
    *left = vdotq_u32(*left, a, weights->left);
    *right = vdotq_u32(*right, b, weights->right);
    return vdotq_u32(vdotq_u32(vdupq_n_u32(0), a, weights->left_in), b, weights->right_in);
}

void fv_k_moments_u8__dotprod(int32_t *m, const uint8_t *image, ptrdiff_t stride,
                              const int32_t *centres, int32_t count)
{
    static const uint8_t ramp[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const uint8x16_t right_u = vld1q_u8(ramp), left_u = vsubq_u8(vdupq_n_u8(16), right_u),
                     one = vdupq_n_u8(1);
    struct fv_moments_weights weights[FV_MOMENTS_RADIUS + 1];
    for (int v = 0; v <= FV_MOMENTS_RADIUS; v++) {
        const uint8x16_t half = vdupq_n_u8(fv_moments_half_width[v]);
        const uint8x16_t left_in = vcleq_u8(left_u, half), right_in = vcleq_u8(right_u, half);
        weights[v] =
            (struct fv_moments_weights){vandq_u8(left_u, left_in), vandq_u8(right_u, right_in),
                                        vandq_u8(one, left_in), vandq_u8(one, right_in)};
    }
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *row = image + centres[k];
        uint32x4_t left = vdupq_n_u32(0), right = left,
                   across = left; /* `across` modulo 2^32: may be negative */
        moments_row(&left, &right, row, &weights[0]);
        for (int v = 1; v <= FV_MOMENTS_RADIUS; v++) {
            const uint32x4_t down = moments_row(&left, &right, row + v * stride, &weights[v]);
            const uint32x4_t up = moments_row(&left, &right, row - v * stride, &weights[v]);
            across = vmlaq_n_u32(across, vsubq_u32(down, up), (uint32_t)v);
        }
        m[2 * k] = (int32_t)vaddvq_u32(vsubq_u32(right, left));
        m[2 * k + 1] = (int32_t)vaddvq_u32(across);
    }
}
