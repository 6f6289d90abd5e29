/* Two nearest of many descriptors of bytes, around the products of four trains with two queries,
 * which each file defines for its instruction set: `products`. Trains are taken as t - 128: then
 * both factors are signed, and 128 times the sum of the query is added at the end. */
#ifndef FOVEA_KERNELS_NEON_SQUARES_NEON_H
#define FOVEA_KERNELS_NEON_SQUARES_NEON_H

#include <arm_neon.h>
#include <string.h>

#include "kernels/kernels.h"
#include "kernels/squares_lanes.h"

enum { QUERIES = 2, LANES = 4 };

/* sum[i] = products of query[i] with the four trains that begin at `from`, 64 bytes from word to
 * word. */
static inline void products(int32x4_t sum[QUERIES], const int8_t *const *query, const uint8_t *from,
                            int32_t words);

struct lanes {
    int32x4_t best, next, at;
};

static inline void update(struct lanes *lanes, int32x4_t bias, int32x4_t product, int32x4_t at)
{
    const int32x4_t v = vsubq_s32(bias, vshlq_n_s32(product, 1));
    const uint32x4_t nearer = vcltq_s32(v, lanes->best);
    lanes->next = vminq_s32(lanes->next, vmaxq_s32(lanes->best, v));
    lanes->best = vminq_s32(lanes->best, v);
    lanes->at = vbslq_s32(nearer, at, lanes->at);
}

static inline int8x16_t word_of(const int8_t *query, int32_t w)
{
    int32_t word;
    memcpy(&word, query + 4 * (int64_t)w, sizeof word);
    return vreinterpretq_s8_s32(vdupq_n_s32(word));
}

static inline int8x16_t trains_of(const uint8_t *from)
{
    return vreinterpretq_s8_u8(veorq_u8(vld1q_u8(from), vdupq_n_u8(128)));
}

static inline int32_t sum_of(const int8_t *query, int32_t words)
{
    int32_t sum = 0;
    for (int32_t i = 0; i < 4 * words; i++)
        sum += query[i];
    return sum;
}

static inline void fv_squares_two(int32_t *nearest, int32_t *second, uint32_t *index,
                                  const int8_t *queries, int32_t query_count, const uint8_t *trains,
                                  const int32_t *bias, int32_t groups, int32_t words)
{
    static const int32_t counting[LANES] = {0, 1, 2, 3};
    const int32x4_t first = vld1q_s32(counting);
    for (int32_t q = 0; q < query_count; q += QUERIES) {
        const int8_t *query[QUERIES]; /* missing ones repeat the last */
        struct lanes lanes[QUERIES];
        int32x4_t more[QUERIES];
        for (int i = 0; i < QUERIES; i++) {
            const int32_t of = q + i < query_count ? q + i : query_count - 1;
            query[i] = queries + (int64_t)of * 4 * words;
            more[i] = vdupq_n_s32(128 * sum_of(query[i], words));
            lanes[i].best = lanes[i].next = vdupq_n_s32(INT32_MAX);
            lanes[i].at = first;
        }
        for (int32_t part = 0; part < 4 * groups; part++) {
            int32x4_t sum[QUERIES];
            products(sum, query, trains + (int64_t)(part / 4) * 64 * words + (part & 3) * 16,
                     words);
            const int32x4_t at = vaddq_s32(first, vdupq_n_s32(LANES * part));
            const int32x4_t of = vld1q_s32(bias + (int64_t)LANES * part);
            for (int i = 0; i < QUERIES; i++)
                update(&lanes[i], of, vaddq_s32(sum[i], more[i]), at);
        }
        for (int i = 0; i < QUERIES && q + i < query_count; i++) {
            int32_t best[LANES], next[LANES], at[LANES];
            vst1q_s32(best, lanes[i].best);
            vst1q_s32(next, lanes[i].next);
            vst1q_s32(at, lanes[i].at);
            squares_finish(best, next, at, LANES, nearest + q + i, second + q + i, index + q + i);
        }
    }
}

#endif
