#include "kernels/neon/squares_neon.h"

static inline void products(int32x4_t sum[QUERIES], const int8_t *const *query, const uint8_t *from,
                            int32_t words)
{
    int32x4_t low[QUERIES], high[QUERIES]; /* two sums of pairs of each train */
    for (int i = 0; i < QUERIES; i++)
        low[i] = high[i] = vdupq_n_s32(0);
    for (int32_t w = 0; w < words; w++) {
        const int8x16_t t = trains_of(from + 64 * (int64_t)w);
        for (int i = 0; i < QUERIES; i++) {
            const int8x16_t q = word_of(query[i], w);
            low[i] = vpadalq_s16(low[i], vmull_s8(vget_low_s8(t), vget_low_s8(q)));
            high[i] = vpadalq_s16(high[i], vmull_high_s8(t, q));
        }
    }
    for (int i = 0; i < QUERIES; i++)
        sum[i] = vpaddq_s32(low[i], high[i]);
}

void fv_k_squares_two_u8__neon(int32_t *nearest, int32_t *second, uint32_t *index,
                               const int8_t *queries, int32_t query_count, const uint8_t *trains,
                               const int32_t *bias, int32_t groups, int32_t words)
{
    fv_squares_two(nearest, second, index, queries, query_count, trains, bias, groups, words);
}
