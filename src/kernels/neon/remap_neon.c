#include "kernels/kernels.h"

#include <arm_neon.h>

/* Bytes picked from a row of the window; `pick` of 16 and above gives 0. */
static inline uint8x16_t remap_pick(const uint8_t *row, uint8x16_t pick)
{
    return vqtbl1q_u8(vld1q_u8(row), pick);
}

/* 64 times the blend of horizontal neighbours, which lie side by side. */
static inline int16x8_t remap_along(uint8x16_t pairs, uint8x8_t fx)
{
    const uint8x8_t left = vget_low_u8(vuzp1q_u8(pairs, pairs)),
                    right = vget_low_u8(vuzp2q_u8(pairs, pairs));
    return vreinterpretq_s16_u16(vmlal_u8(vmull_u8(left, vsub_u8(vdup_n_u8(64), fx)), right, fx));
}

static inline uint8x8_t remap_eight(const uint8_t *window, ptrdiff_t stride,
                                    const struct fv_remap_block *block)
{
    const uint8x8_t at = vld1_u8(block->at);
    const uint8x16_t twice = vcombine_u8(vzip1_u8(at, at), vzip2_u8(at, at));
    const uint8x16_t next = vreinterpretq_u8_u16(vdupq_n_u16(0x100));
    const uint8x16_t pick =
        vaddq_u8(vandq_u8(twice, vdupq_n_u8(FV_REMAP_OUTSIDE | FV_REMAP_COLUMN)), next);
    const uint8x16_t row_1 = vtstq_u8(twice, vdupq_n_u8(FV_REMAP_ROW_1));
    const uint8x16_t row_2 = vtstq_u8(twice, vdupq_n_u8(FV_REMAP_ROW_2));
    uint8x16_t row[FV_REMAP_WINDOW_ROWS];
    for (int i = 0; i < FV_REMAP_WINDOW_ROWS; i++)
        row[i] = remap_pick(window + i * stride, pick);
    const uint8x16_t above = vbslq_u8(row_2, row[2], vbslq_u8(row_1, row[1], row[0]));
    const uint8x16_t below = vbslq_u8(row_2, row[3], vbslq_u8(row_1, row[2], row[1]));

    const uint8x8_t fx = vld1_u8(block->fx);
    const int16x8_t top = remap_along(above, fx), bottom = remap_along(below, fx);
    const int16x8_t fy =
        vreinterpretq_s16_u16(vshll_n_u8(vld1_u8(block->fy), 8)); /* 256 fy, doubled below */
    const int16x8_t sum = vaddq_s16(top, vqrdmulhq_s16(vsubq_s16(bottom, top), vaddq_s16(fy, fy)));
    return vqrshrun_n_s16(sum, 6);
}

void fv_k_remap_row_u8__neon(uint8_t *out, const uint8_t *source, ptrdiff_t stride,
                             const struct fv_remap_block *blocks, int32_t count,
                             const struct fv_remap_pixel *scattered)
{
    for (int32_t k = 0; k < count; k++, out += FV_REMAP_BLOCK) {
        const struct fv_remap_block *block = &blocks[k];
        if (block->y == FV_REMAP_SCATTERED)
            fv_k_remap_row_u8__c(out, source, stride, block, 1, scattered);
        else
            vst1_u8(out, remap_eight(source + block->y * stride + block->x, stride, block));
    }
}
