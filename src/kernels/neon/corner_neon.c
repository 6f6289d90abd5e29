#include "kernels/kernels.h"

#include <arm_neon.h>

/* As the SSE4 variant. */
static inline void corner_arcs(const uint8x16_t ring[16], uint8x16_t *brightest,
                               uint8x16_t *darkest)
{
    uint8x16_t low[16], high[16], low_4[16], high_4[16];
    for (int i = 0; i < 16; i++) {
        low[i] = vminq_u8(ring[i], ring[(i + 1) % 16]);
        high[i] = vmaxq_u8(ring[i], ring[(i + 1) % 16]);
    }
    for (int i = 0; i < 16; i++) {
        low_4[i] = vminq_u8(low[i], low[(i + 2) % 16]);
        high_4[i] = vmaxq_u8(high[i], high[(i + 2) % 16]);
    }
    *brightest = vdupq_n_u8(0);
    *darkest = vdupq_n_u8(255);
    for (int i = 0; i < 16; i++) {
        const uint8x16_t low_8 = vminq_u8(low_4[i], low_4[(i + 4) % 16]);
        const uint8x16_t high_8 = vmaxq_u8(high_4[i], high_4[(i + 4) % 16]);
        *brightest = vmaxq_u8(*brightest, vminq_u8(low_8, ring[(i + 8) % 16]));
        *darkest = vminq_u8(*darkest, vmaxq_u8(high_8, ring[(i + 8) % 16]));
    }
}

/* Scores of two rows of eight pixels, `apart` bytes from each other. */
static inline uint8x16_t corner_two_rows(const uint8_t *row, ptrdiff_t apart,
                                         const ptrdiff_t offsets[16])
{
    uint8x16_t ring[16], brightest, darkest;
    for (int i = 0; i < 16; i++)
        ring[i] = vcombine_u8(vld1_u8(row + offsets[i]), vld1_u8(row + offsets[i] + apart));
    const uint8x16_t centre = vcombine_u8(vld1_u8(row), vld1_u8(row + apart));
    corner_arcs(ring, &brightest, &darkest);
    return vmaxq_u8(vqsubq_u8(brightest, centre), vqsubq_u8(centre, darkest));
}

void fv_k_corner_scores_u8__neon(uint8_t *scores, const uint8_t *image, ptrdiff_t stride_bytes,
                                 const int32_t *centres, int32_t count)
{
    ptrdiff_t offsets[16];
    for (int i = 0; i < 16; i++)
        offsets[i] = fv_corner_circle[1][i] * stride_bytes + fv_corner_circle[0][i];
    for (int32_t k = 0; k < count; k++, scores += FV_CORNER_SCORES) {
        const uint8_t *row = image + centres[k] - 2 * stride_bytes - 2;
        for (int v = 0; v < 4; v += 2)
            vst1q_u8(scores + 8 * v,
                     corner_two_rows(row + v * stride_bytes, stride_bytes, offsets));
        vst1_u8(scores + 32, vget_low_u8(corner_two_rows(row + 4 * stride_bytes, 0, offsets)));
    }
}
