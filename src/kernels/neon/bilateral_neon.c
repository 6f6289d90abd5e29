#include "kernels/bilateral_ends.h"

#include <arm_neon.h>

/* Low and high bytes of the weights, which TBL looks up in registers. */
struct byte_tables {
    uint8_t low[3][256], high[3][256];
};

static void split(struct byte_tables *tables, const uint16_t weights[3][256])
{
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 256; i += 16) {
            const uint8x16x2_t bytes = vld2q_u8((const uint8_t *)(weights[k] + i));
            vst1q_u8(tables->low[k] + i, bytes.val[0]);
            vst1q_u8(tables->high[k] + i, bytes.val[1]);
        }
}

/* Sums of 16 pixels: those of the lower and of the upper eight; of these again by halves. */
struct sums {
    uint16x8_t norm[2];
    uint32x4_t sum[4];
};

/* Entries of a table of 256 bytes. Where an index lies outside of a part, TBL gives 0 and TBX keeps
 * what was there. */
static inline uint8x16_t look_up(const uint8_t table[256], uint8x16_t index)
{
    const uint8x16_t part = vdupq_n_u8(64);
    uint8x16_t found = vqtbl4q_u8(vld1q_u8_x4(table), index);
    for (int i = 64; i < 256; i += 64) {
        index = vsubq_u8(index, part);
        found = vqtbx4q_u8(found, vld1q_u8_x4(table + i), index);
    }
    return found;
}

static inline void add_weighted(struct sums *sums, int half, uint16x8_t pixel, uint16x8_t weight)
{
    sums->norm[half] = vaddq_u16(sums->norm[half], weight);
    sums->sum[2 * half] = vmlal_u16(sums->sum[2 * half], vget_low_u16(pixel), vget_low_u16(weight));
    sums->sum[2 * half + 1] = vmlal_high_u16(sums->sum[2 * half + 1], pixel, weight);
}

static inline void add_tap(struct sums *sums, const uint8_t *from, uint8x16_t centre,
                           const uint8_t low[256], const uint8_t high[256])
{
    const uint8x16_t p = vld1q_u8(from), apart = vabdq_u8(p, centre);
    const uint8x16_t a = look_up(low, apart), b = look_up(high, apart);
    add_weighted(sums, 0, vmovl_u8(vget_low_u8(p)), vreinterpretq_u16_u8(vzip1q_u8(a, b)));
    add_weighted(sums, 1, vmovl_high_u8(p), vreinterpretq_u16_u8(vzip2q_u8(a, b)));
}

/* (sum + norm / 2) / norm rounded down (bilateral_ends.h). */
static inline uint32x4_t divided(uint32x4_t sum, uint32x4_t norm)
{
    const uint32x4_t dividend = vsraq_n_u32(sum, norm, 1);
    return vcvtq_u32_f32(vdivq_f32(vcvtq_f32_u32(dividend), vcvtq_f32_u32(norm)));
}

static inline uint16x8_t divided_eight(const struct sums *sums, int half)
{
    const uint16x8_t norm = sums->norm[half];
    return vmovn_high_u32(vmovn_u32(divided(sums->sum[2 * half], vmovl_u16(vget_low_u16(norm)))),
                          divided(sums->sum[2 * half + 1], vmovl_high_u16(norm)));
}

static inline uint8x16_t sixteen(const uint8_t *const rows[5], int32_t x,
                                 const struct byte_tables *tables)
{
    /* row and column of the taps of each distance */
    static const int8_t taps[3][4][2] = {{{2, -1}, {2, 1}, {1, 0}, {3, 0}},
                                         {{1, -1}, {1, 1}, {3, -1}, {3, 1}},
                                         {{2, -2}, {2, 2}, {0, 0}, {4, 0}}};
    const uint8x16_t centre = vld1q_u8(rows[2] + x);
    const uint16x8_t full = vdupq_n_u16(FV_BILATERAL_WEIGHT_MAX), none = vdupq_n_u16(0);
    struct sums sums = {{none, none},
                        {vdupq_n_u32(0), vdupq_n_u32(0), vdupq_n_u32(0), vdupq_n_u32(0)}};
    add_weighted(&sums, 0, vmovl_u8(vget_low_u8(centre)), full);
    add_weighted(&sums, 1, vmovl_high_u8(centre), full);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 4; i++)
            add_tap(&sums, rows[taps[k][i][0]] + x + taps[k][i][1], centre, tables->low[k],
                    tables->high[k]);
    return vmovn_high_u16(vmovn_u16(divided_eight(&sums, 0)), divided_eight(&sums, 1));
}

void fv_k_bilateral_row_u8__neon(uint8_t *out, const uint8_t *const *rows, int32_t width,
                                 const uint16_t weights[3][256])
{
    if (width < 20) {
        fv_k_bilateral_row_u8__c(out, rows, width, weights);
        return;
    }
    struct byte_tables tables;
    const uint8_t *const five[5] = {rows[0], rows[1], rows[2], rows[3], rows[4]};
    const int32_t last = width - 18; /* its vector overlaps the one before */
    split(&tables, weights);
    bilateral_ends(out, rows, width, weights);
    for (int32_t x = 2; x < last; x += 16)
        vst1q_u8(out + x, sixteen(five, x, &tables));
    vst1q_u8(out + last, sixteen(five, last, &tables));
}
