#include "kernels/neon/squares_bound_neon.h"

static inline void products(int16x8x2_t sums[N], const int8_t *queries, const uint8_t *from,
                            int32_t pairs)
{
    int16x8_t both[N][4]; /* both values of four trains */
    for (int q = 0; q < N; q++)
        for (int k = 0; k < 4; k++)
            both[q][k] = vdupq_n_s16(0);
    for (int32_t p = 0; p < pairs; p++, from += 2 * FV_BOUND_GROUP) {
        const int8x16_t a = trains_of(from), b = trains_of(from + 16);
        for (int q = 0; q < N; q++) {
            int16_t two;
            memcpy(&two, queries + ((int64_t)q * pairs + p) * 2, sizeof two);
            const int8x16_t of = vreinterpretq_s8_s16(vdupq_n_s16(two));
            both[q][0] = vmlal_s8(both[q][0], vget_low_s8(a), vget_low_s8(of));
            both[q][1] = vmlal_high_s8(both[q][1], a, of);
            both[q][2] = vmlal_s8(both[q][2], vget_low_s8(b), vget_low_s8(of));
            both[q][3] = vmlal_high_s8(both[q][3], b, of);
        }
    }
    for (int q = 0; q < N; q++)
        for (int k = 0; k < 2; k++)
            sums[q].val[k] = vpaddq_s16(both[q][2 * k], both[q][2 * k + 1]);
}

static inline uint32x4_t add_squares(uint32x4_t sums, uint8x16_t apart)
{
    sums = vpadalq_u16(sums, vmull_u8(vget_low_u8(apart), vget_low_u8(apart)));
    return vpadalq_u16(sums, vmull_high_u8(apart, apart));
}

void fv_k_squares_bound_s16__neon(int16_t *rows, int32_t stride, int16_t *least,
                                  const int8_t *queries, const uint8_t *trains, const int16_t *half,
                                  int32_t groups, int32_t pairs)
{
    fv_squares_bound(rows, stride, least, queries, trains, half, groups, pairs);
}

int32_t fv_k_squares_below_s16__neon(uint16_t *indices, const int16_t *row, int32_t count,
                                     int16_t limit)
{
    const int16x8_t most = vdupq_n_s16(limit);
    int32_t found = 0;
    for (int32_t i = 0; i < count; i += 16) {
        const uint8x8_t a = vmovn_u16(vcleq_s16(vld1q_s16(row + i), most));
        const uint8x16_t both = vmovn_high_u16(a, vcleq_s16(vld1q_s16(row + i + 8), most));
        /* four bits of each */
        const uint8x8_t bits = vshrn_n_u16(vreinterpretq_u16_u8(both), 4);
        uint64_t mask = vget_lane_u64(vreinterpret_u64_u8(bits), 0) & 0x1111111111111111u;
        for (; mask != 0; mask &= mask - 1)
            indices[found++] = (uint16_t)(i + __builtin_ctzll(mask) / 4);
    }
    return found;
}

void fv_k_squares_some_u8__neon(int32_t *distances, const uint8_t *query,
                                const uint8_t *descriptors, int32_t bytes, const uint16_t *indices,
                                int32_t count)
{
    fv_squares_some(distances, query, descriptors, bytes, indices, count);
}
