#include "kernels/kernels.h"

#include <arm_neon.h>

/* The weights halved, 9 17 24 28 24 17 9: then a sum down a column has 15 bits, two of them still
 * fit a word, and what the contract rounds off by 16 bits is rounded off by 14 here. */
static inline void blur7_columns(const uint8_t *const rows[7], int32_t x, uint16_t *column)
{
    uint8x16_t r[7];
    for (int i = 0; i < 7; i++)
        r[i] = vld1q_u8(rows[i] + x);
    uint16x8_t low = vmull_u8(vget_low_u8(r[3]), vdup_n_u8(28)),
               high = vmull_high_u8(r[3], vdupq_n_u8(28));
    low = vmlaq_n_u16(low, vaddl_u8(vget_low_u8(r[0]), vget_low_u8(r[6])), 9);
    high = vmlaq_n_u16(high, vaddl_high_u8(r[0], r[6]), 9);
    low = vmlaq_n_u16(low, vaddl_u8(vget_low_u8(r[1]), vget_low_u8(r[5])), 17);
    high = vmlaq_n_u16(high, vaddl_high_u8(r[1], r[5]), 17);
    low = vmlaq_n_u16(low, vaddl_u8(vget_low_u8(r[2]), vget_low_u8(r[4])), 24);
    high = vmlaq_n_u16(high, vaddl_high_u8(r[2], r[4]), 24);
    vst1q_u16(column + x, low);
    vst1q_u16(column + x + 8, high);
}

/* Eight outputs in the low bytes of words. */
static inline uint16x8_t blur7_eight(const uint16_t *column)
{
    const uint16x8_t outer = vaddq_u16(vld1q_u16(column - 3), vld1q_u16(column + 3));
    const uint16x8_t middle = vaddq_u16(vld1q_u16(column - 2), vld1q_u16(column + 2));
    const uint16x8_t inner = vaddq_u16(vld1q_u16(column - 1), vld1q_u16(column + 1));
    const uint16x8_t centre = vld1q_u16(column);
    uint32x4_t low = vmull_n_u16(vget_low_u16(centre), 28), high = vmull_high_n_u16(centre, 28);
    low = vmlal_n_u16(low, vget_low_u16(outer), 9);
    high = vmlal_high_n_u16(high, outer, 9);
    low = vmlal_n_u16(low, vget_low_u16(middle), 17);
    high = vmlal_high_n_u16(high, middle, 17);
    low = vmlal_n_u16(low, vget_low_u16(inner), 24);
    high = vmlal_high_n_u16(high, inner, 24);
    return vrshrn_high_n_u32(vrshrn_n_u32(low, 14), high, 14);
}

static inline void blur7_sixteen(uint8_t *out, const uint16_t *column)
{
    const uint8x16_t a = vreinterpretq_u8_u16(blur7_eight(column));
    vst1q_u8(out, vuzp1q_u8(a, vreinterpretq_u8_u16(blur7_eight(column + 8))));
}

void fv_k_blur7_row_u8__neon(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                             uint16_t *scratch)
{
    if (width < 16) {
        fv_k_blur7_row_u8__c(out, rows, width, scratch);
        return;
    }
    const uint8_t *const row[7] = {rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]};
    uint16_t *column = scratch + 8;
    const int32_t last = width - 16; /* the last vectors overlap the ones before */
    for (int32_t x = 0; x < last; x += 16)
        blur7_columns(row, x, column);
    blur7_columns(row, last, column);
    for (int32_t i = 1; i <= FV_BLUR7_RADIUS; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0; x < last; x += 16)
        blur7_sixteen(out + x, column + x);
    blur7_sixteen(out + last, column + last);
}

/* Products with |u| in unsigned words. Over 15 rows of the circle the weights of one lane add up to
 * at most 174 (the columns 5 and 13), and 174 x 255 fits; over 31 rows they would not, so the upper
 * and the lower half have their own sums. Left and right are subtracted at the end. */
struct fv_moment_words {
    uint16x8_t left, right; /* sums of |u| I, lanes folded in two */
};

static inline uint16x8_t moments_rows(struct fv_moment_words *words, const uint8_t *row,
                                      uint8x16_t left_mask, uint8x16_t right_mask,
                                      uint8x16_t left_u, uint8x16_t right_u)
{
    const uint8x16_t left = vandq_u8(vld1q_u8(row - 16), left_mask);
    const uint8x16_t right = vandq_u8(vld1q_u8(row), right_mask);
    words->left = vmlal_u8(words->left, vget_low_u8(left), vget_low_u8(left_u));
    words->right = vmlal_u8(words->right, vget_low_u8(right), vget_low_u8(right_u));
    const uint16x8_t left_far = vmull_high_u8(left, left_u),
                     right_far = vmull_high_u8(right, right_u);
    words->left = vaddq_u16(words->left, left_far);
    words->right = vaddq_u16(words->right, right_far);
    return vaddq_u16(vpaddlq_u8(left), vpaddlq_u8(right));
}

static inline int32_t moments_side(const struct fv_moment_words *words)
{
    return (int32_t)vaddlvq_u16(words->right) - (int32_t)vaddlvq_u16(words->left);
}

void fv_k_moments_u8__neon(int32_t *m, const uint8_t *image, ptrdiff_t stride,
                           const int32_t *centres, int32_t count)
{
    static const uint8_t ramp[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const uint8x16_t right_u = vld1q_u8(ramp), left_u = vsubq_u8(vdupq_n_u8(16), right_u);
    uint8x16_t left_mask[FV_MOMENTS_RADIUS + 1], right_mask[FV_MOMENTS_RADIUS + 1];
    for (int v = 0; v <= FV_MOMENTS_RADIUS; v++) {
        const uint8x16_t half = vdupq_n_u8(fv_moments_half_width[v]);
        left_mask[v] = vcleq_u8(left_u, half);
        right_mask[v] = vcleq_u8(right_u, half);
    }
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *row = image + centres[k];
        const struct fv_moment_words none = {vdupq_n_u16(0), vdupq_n_u16(0)};
        struct fv_moment_words below = none, above = none;
        int32x4_t m01 = vdupq_n_s32(0);
        moments_rows(&below, row, left_mask[0], right_mask[0], left_u, right_u);
        int32_t m10 = moments_side(&below);
        below = none;
        for (int v = 1; v <= FV_MOMENTS_RADIUS; v++) {
            const uint16x8_t down = moments_rows(&below, row + v * stride, left_mask[v],
                                                 right_mask[v], left_u, right_u);
            const uint16x8_t up = moments_rows(&above, row - v * stride, left_mask[v],
                                               right_mask[v], left_u, right_u);
            const int16x8_t across = vreinterpretq_s16_u16(vsubq_u16(down, up));
            m01 = vmlal_n_s16(m01, vget_low_s16(across), (int16_t)v);
            m01 = vmlal_n_s16(m01, vget_high_s16(across), (int16_t)v);
        }
        m[2 * k] = m10 + moments_side(&below) + moments_side(&above);
        m[2 * k + 1] = vaddvq_s32(m01);
    }
}

/* Sampled into arrays first: the vector loads that compare come long after the byte stores that
 * they need. */
static inline void brief_sample(uint8_t samples[2 * FV_BRIEF_BITS], const uint8_t *centre,
                                const int8_t *positions, int16_t along, int16_t across)
{
    for (int i = 0; i < 2 * FV_BRIEF_BITS; i += 8) {
        const int8x8x2_t position = vld2_s8(positions + 2 * i);
        const int16x8_t x = vmovl_s8(position.val[0]), y = vmovl_s8(position.val[1]);
        int32_t offset[8];
        vst1q_s32(offset,
                  vmlal_n_s16(vmull_n_s16(vget_low_s16(x), along), vget_low_s16(y), across));
        vst1q_s32(offset + 4,
                  vmlal_n_s16(vmull_n_s16(vget_high_s16(x), along), vget_high_s16(y), across));
        for (int k = 0; k < 8; k++)
            samples[i + k] = centre[offset[k]];
    }
}

void fv_k_brief_u8__neon(uint8_t descriptor[FV_DESCRIPTOR_BYTES], const uint8_t *centre,
                         const int8_t positions[4 * FV_BRIEF_BITS], int32_t along, int32_t across)
{
    static const uint8_t bit_of_lane[16] = {1, 2, 4, 8, 16, 32, 64, 128,
                                            1, 2, 4, 8, 16, 32, 64, 128};
    const uint8x16_t bits = vld1q_u8(bit_of_lane);
    uint8_t samples[2 * FV_BRIEF_BITS];
    brief_sample(samples, centre, positions, (int16_t)along, (int16_t)across);
    for (int i = 0; i < FV_BRIEF_BITS; i += 16) {
        const uint8x16_t a = vld1q_u8(samples + i), b = vld1q_u8(samples + FV_BRIEF_BITS + i);
        const uint8x16_t less = vandq_u8(vcltq_u8(a, b), bits);
        descriptor[i / 8] = vaddv_u8(vget_low_u8(less));
        descriptor[i / 8 + 1] = vaddv_u8(vget_high_u8(less));
    }
}
