#include "kernels/neon/squares_bound_neon.h"

/* Pairs are even: four values of a train, from two pairs, are one step. */
static inline void products(int16x8x2_t sums[N], const int8_t *queries, const uint8_t *from,
                            int32_t pairs)
{
    int32x4_t four[N][4]; /* of four trains */
    for (int q = 0; q < N; q++)
        for (int k = 0; k < 4; k++)
            four[q][k] = vdupq_n_s32(0);
    for (int32_t p = 0; p < pairs; p += 2, from += 4 * FV_BOUND_GROUP) {
        int8x16_t trains[4];
        for (int k = 0; k < 2; k++) {
            const int16x8_t a = vreinterpretq_s16_s8(trains_of(from + 16 * k));
            const int16x8_t b = vreinterpretq_s16_s8(trains_of(from + 2 * FV_BOUND_GROUP + 16 * k));
            trains[2 * k] = vreinterpretq_s8_s16(vzip1q_s16(a, b));
            trains[2 * k + 1] = vreinterpretq_s8_s16(vzip2q_s16(a, b));
        }
        for (int q = 0; q < N; q++) {
            int32_t word;
            memcpy(&word, queries + ((int64_t)q * pairs + p) * 2, sizeof word);
            const int8x16_t of = vreinterpretq_s8_s32(vdupq_n_s32(word));
            for (int k = 0; k < 4; k++)
                four[q][k] = vdotq_s32(four[q][k], trains[k], of);
        }
    }
    for (int q = 0; q < N; q++)
        for (int k = 0; k < 2; k++)
            sums[q].val[k] = vuzp1q_s16(vreinterpretq_s16_s32(four[q][2 * k]),
                                        vreinterpretq_s16_s32(four[q][2 * k + 1]));
}

static inline uint32x4_t add_squares(uint32x4_t sums, uint8x16_t apart)
{
    return vdotq_u32(sums, apart, apart);
}

void fv_k_squares_bound_s16__dotprod(int16_t *rows, int32_t stride, int16_t *least,
                                     const int8_t *queries, const uint8_t *trains,
                                     const int16_t *half, int32_t groups, int32_t pairs)
{
    fv_squares_bound(rows, stride, least, queries, trains, half, groups, pairs);
}

void fv_k_squares_some_u8__dotprod(int32_t *distances, const uint8_t *query,
                                   const uint8_t *descriptors, int32_t bytes,
                                   const uint16_t *indices, int32_t count)
{
    fv_squares_some(distances, query, descriptors, bytes, indices, count);
}
