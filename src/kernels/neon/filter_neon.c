#include "kernels/kernels.h"

#include <arm_neon.h>

/* ---- Gaussian -------------------------------------------------------------------------------- */

/* Sums down the columns x to x + 15. */
static inline void gauss_columns(uint16_t *column, const uint8_t *const *row, int32_t x,
                                 const uint16_t *weights, int32_t radius)
{
    const uint8x16_t centre = vld1q_u8(row[radius] + x);
    uint16x8_t low = vmulq_n_u16(vmovl_u8(vget_low_u8(centre)), weights[0]);
    uint16x8_t high = vmulq_n_u16(vmovl_high_u8(centre), weights[0]);
    for (int32_t i = 1; i <= radius; i++) {
        const uint8x16_t a = vld1q_u8(row[radius - i] + x), b = vld1q_u8(row[radius + i] + x);
        low = vmlaq_n_u16(low, vaddl_u8(vget_low_u8(a), vget_low_u8(b)), weights[i]);
        high = vmlaq_n_u16(high, vaddl_high_u8(a, b), weights[i]);
    }
    vst1q_u16(column + x, low);
    vst1q_u16(column + x + 8, high);
}

static inline uint16x8_t gauss_eight(const uint16_t *column, const uint16_t *weights,
                                     int32_t radius)
{
    const uint16x8_t centre = vld1q_u16(column);
    uint32x4_t low = vmull_n_u16(vget_low_u16(centre), weights[0]),
               high = vmull_high_n_u16(centre, weights[0]);
    for (int32_t i = 1; i <= radius; i++) {
        const uint16x8_t a = vld1q_u16(column - i), b = vld1q_u16(column + i);
        low = vmlal_n_u16(low, vget_low_u16(a), weights[i]);
        high = vmlal_high_n_u16(high, a, weights[i]);
        low = vmlal_n_u16(low, vget_low_u16(b), weights[i]);
        high = vmlal_high_n_u16(high, b, weights[i]);
    }
    return vrshrn_high_n_u32(vrshrn_n_u32(low, 16), high, 16);
}

static inline void gauss_sixteen(uint8_t *out, const uint16_t *column, const uint16_t *weights,
                                 int32_t radius)
{
    const uint8x16_t low = vreinterpretq_u8_u16(gauss_eight(column, weights, radius));
    const uint8x16_t high = vreinterpretq_u8_u16(gauss_eight(column + 8, weights, radius));
    vst1q_u8(out, vuzp1q_u8(low, high));
}

/* The compiler makes one of it for each radius. */
static inline void gauss_row(uint8_t *out, const uint8_t *const *rows, int32_t width,
                             const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    const uint8_t *row[2 * FV_GAUSS_RADIUS_MAX + 1];
    uint16_t weight[FV_GAUSS_RADIUS_MAX + 1];
    uint16_t *column = scratch + 8;
    const int32_t last = width - 16; /* the last vectors overlap the ones before */
    for (int32_t i = 0; i <= 2 * radius; i++)
        row[i] = rows[i];
    for (int32_t i = 0; i <= radius; i++)
        weight[i] = weights[i];
    int32_t x = 0;
    for (; x < last - 16; x += 32) {
        gauss_columns(column, row, x, weight, radius);
        gauss_columns(column, row, x + 16, weight, radius);
    }
    if (x < last) gauss_columns(column, row, x, weight, radius);
    gauss_columns(column, row, last, weight, radius);
    for (int32_t i = 1; i <= radius; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (x = 0; x < last - 16; x += 32) {
        gauss_sixteen(out + x, column + x, weight, radius);
        gauss_sixteen(out + x + 16, column + x + 16, weight, radius);
    }
    if (x < last) gauss_sixteen(out + x, column + x, weight, radius);
    gauss_sixteen(out + last, column + last, weight, radius);
}

void fv_k_gauss_row_u8__neon(uint8_t *out, const uint8_t *const *rows, int32_t width,
                             const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    if (width < 16)
        fv_k_gauss_row_u8__c(out, rows, width, weights, radius, scratch);
    else if (radius == 1)
        gauss_row(out, rows, width, weights, 1, scratch);
    else if (radius == 2)
        gauss_row(out, rows, width, weights, 2, scratch);
    else
        gauss_row(out, rows, width, weights, 3, scratch);
}

/* ---- median ---------------------------------------------------------------------------------- */

/* The three pixels of each column in order. */
struct sorted {
    uint8x16_t low, middle, high;
};

static inline struct sorted sorted_at(const uint8_t *const *rows, int32_t x)
{
    const uint8x16_t a = vld1q_u8(rows[0] + x), b = vld1q_u8(rows[1] + x),
                     c = vld1q_u8(rows[2] + x);
    const uint8x16_t less = vminq_u8(a, b), more = vmaxq_u8(a, b), later = vmaxq_u8(less, c);
    return (struct sorted){vminq_u8(less, c), vminq_u8(more, later), vmaxq_u8(more, later)};
}

static inline uint8x16_t middle_of(uint8x16_t a, uint8x16_t b, uint8x16_t c)
{
    return vmaxq_u8(vminq_u8(a, b), vminq_u8(vmaxq_u8(a, b), c));
}

/* Sixteen pixels from their columns, those before and those after. */
static inline void median_sixteen(uint8_t *out, const struct sorted *before,
                                  const struct sorted *at, const struct sorted *after)
{
    const uint8x16_t low = vmaxq_u8(vmaxq_u8(vextq_u8(before->low, at->low, 15), at->low),
                                    vextq_u8(at->low, after->low, 1));
    const uint8x16_t middle = middle_of(vextq_u8(before->middle, at->middle, 15), at->middle,
                                        vextq_u8(at->middle, after->middle, 1));
    const uint8x16_t high = vminq_u8(vminq_u8(vextq_u8(before->high, at->high, 15), at->high),
                                     vextq_u8(at->high, after->high, 1));
    vst1q_u8(out, middle_of(low, middle, high));
}

static inline struct sorted every_lane(const struct sorted *from, int lane)
{
    const uint8x16_t at = vdupq_n_u8((uint8_t)lane);
    return (struct sorted){vqtbl1q_u8(from->low, at), vqtbl1q_u8(from->middle, at),
                           vqtbl1q_u8(from->high, at)};
}

/* The last 32 columns first: of these the first is right where it is that of the row, and else it
 * is written again. */
void fv_k_median3_row_u8__neon(uint8_t *out, const uint8_t *const *rows, int32_t width)
{
    if (width < 32) {
        fv_k_median3_row_u8__c(out, rows, width);
        return;
    }
    const uint8_t *const row[3] = {rows[0], rows[1], rows[2]};
    struct sorted a = sorted_at(row, width - 32), b = sorted_at(row, width - 16);
    struct sorted c = every_lane(&a, 0);
    median_sixteen(out + width - 32, &c, &a, &b);
    c = every_lane(&b, 15);
    median_sixteen(out + width - 16, &a, &b, &c);
    int32_t x = 0;
    b = sorted_at(row, 0);
    a = every_lane(&b, 0);
    for (; x + 64 <= width; x += 48) { /* three at a time, so that none moves */
        c = sorted_at(row, x + 16);
        median_sixteen(out + x, &a, &b, &c);
        a = sorted_at(row, x + 32);
        median_sixteen(out + x + 16, &b, &c, &a);
        b = sorted_at(row, x + 48);
        median_sixteen(out + x + 32, &c, &a, &b);
    }
    for (; x + 32 <= width; x += 16) {
        c = sorted_at(row, x + 16);
        median_sixteen(out + x, &a, &b, &c);
        a = b;
        b = c;
    }
}

/* ---- two pictures or tables to one ----------------------------------------------------------- */

/* (2 x 128 d weight + 2^15) >> 16 is (d weight + 128) >> 8. */
static inline uint8x8_t mix_eight(uint8x8_t a, uint8x8_t b, int16_t weight)
{
    const int16x8_t apart = vshlq_n_s16(vreinterpretq_s16_u16(vsubl_u8(a, b)), 7);
    const int16x8_t part = vqrdmulhq_n_s16(apart, weight);
    return vqmovun_s16(vreinterpretq_s16_u16(vaddw_u8(vreinterpretq_u16_s16(part), b)));
}

void fv_k_mix_u8__neon(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                       int32_t weight)
{
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        const uint8x16_t va = vld1q_u8(a + i), vb = vld1q_u8(b + i);
        vst1q_u8(out + i,
                 vcombine_u8(mix_eight(vget_low_u8(va), vget_low_u8(vb), (int16_t)weight),
                             mix_eight(vget_high_u8(va), vget_high_u8(vb), (int16_t)weight)));
    }
    fv_k_mix_u8__c(out + i, a + i, b + i, count - i, weight);
}

/* a 256 + ((b - a) weight + 8) >> 4, which needs 16 bits in the end alone. */
static inline uint16x8_t blend_eight(uint8x8_t a, uint8x8_t b, int16_t weight)
{
    const int16x8_t apart = vreinterpretq_s16_u16(vsubl_u8(b, a));
    const int16x4_t low = vrshrn_n_s32(vmull_n_s16(vget_low_s16(apart), weight), 4);
    const int16x8_t part = vrshrn_high_n_s32(low, vmull_high_n_s16(apart, weight), 4);
    return vaddq_u16(vshll_n_u8(a, 8), vreinterpretq_u16_s16(part));
}

void fv_k_contrast_blend_u16__neon(uint16_t out[256], const uint8_t a[256], const uint8_t b[256],
                                   int32_t weight)
{
    for (int32_t i = 0; i < 256; i += 16) {
        const uint8x16_t va = vld1q_u8(a + i), vb = vld1q_u8(b + i);
        vst1q_u16(out + i, blend_eight(vget_low_u8(va), vget_low_u8(vb), (int16_t)weight));
        vst1q_u16(out + i + 8, blend_eight(vget_high_u8(va), vget_high_u8(vb), (int16_t)weight));
    }
}

void fv_k_range_u8__neon(uint8_t range[2], const uint8_t *in, int32_t count)
{
    uint8x16_t low = vdupq_n_u8(range[0]), high = vdupq_n_u8(range[1]);
    int32_t i = 0;
    for (; i + 64 <= count; i += 64) {
        const uint8x16x4_t v = vld1q_u8_x4(in + i);
        low = vminq_u8(vminq_u8(vminq_u8(v.val[0], v.val[1]), vminq_u8(v.val[2], v.val[3])), low);
        high = vmaxq_u8(vmaxq_u8(vmaxq_u8(v.val[0], v.val[1]), vmaxq_u8(v.val[2], v.val[3])), high);
    }
    for (; i + 16 <= count; i += 16) {
        low = vminq_u8(low, vld1q_u8(in + i));
        high = vmaxq_u8(high, vld1q_u8(in + i));
    }
    range[0] = vminvq_u8(low);
    range[1] = vmaxvq_u8(high);
    fv_k_range_u8__c(range, in + i, count - i);
}
