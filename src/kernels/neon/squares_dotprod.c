#include "kernels/neon/squares_neon.h"

static inline void products(int32x4_t sum[QUERIES], const int8_t *const *query, const uint8_t *from,
                            int32_t words)
{
    for (int i = 0; i < QUERIES; i++)
        sum[i] = vdupq_n_s32(0);
    for (int32_t w = 0; w < words; w++) {
        const int8x16_t t = trains_of(from + 64 * (int64_t)w);
        for (int i = 0; i < QUERIES; i++)
            sum[i] = vdotq_s32(sum[i], t, word_of(query[i], w));
    }
}

void fv_k_squares_two_u8__dotprod(int32_t *nearest, int32_t *second, uint32_t *index,
                                  const int8_t *queries, int32_t query_count, const uint8_t *trains,
                                  const int32_t *bias, int32_t groups, int32_t words)
{
    fv_squares_two(nearest, second, index, queries, query_count, trains, bias, groups, words);
}
