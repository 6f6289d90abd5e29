#include <immintrin.h>
#include <string.h>

#include "kernels/kernels.h"
#include "kernels/squares_lanes.h"

enum { QUERIES = 4, LANES = 16 };

struct lanes {
    __m512i best, next, at;
};

static inline void update(struct lanes *lanes, __m512i bias, __m512i product, __m512i at)
{
    const __m512i v = _mm512_sub_epi32(bias, _mm512_slli_epi32(product, 1));
    const __mmask16 nearer = _mm512_cmplt_epi32_mask(v, lanes->best);
    lanes->next = _mm512_min_epi32(lanes->next, _mm512_max_epi32(lanes->best, v));
    lanes->best = _mm512_min_epi32(lanes->best, v);
    lanes->at = _mm512_mask_mov_epi32(lanes->at, nearer, at);
}

static inline __m512i word_of(const int8_t *query, int32_t w)
{
    int32_t word;
    memcpy(&word, query + 4 * (int64_t)w, sizeof word);
    return _mm512_set1_epi32(word);
}

/* Products of four queries with the trains of two groups. */
static inline void products(__m512i out[2][QUERIES], const int8_t *const *query,
                            const uint8_t *group, int32_t words, int32_t two)
{
    for (int i = 0; i < QUERIES; i++)
        out[0][i] = out[1][i] = _mm512_setzero_si512();
    const uint8_t *beside = two ? group + (int64_t)64 * words : group;
    for (int32_t w = 0; w < words; w++) {
        const __m512i a = _mm512_load_si512(group + 64 * (int64_t)w);
        const __m512i b = _mm512_load_si512(beside + 64 * (int64_t)w);
        for (int i = 0; i < QUERIES; i++) {
            const __m512i q = word_of(query[i], w);
            out[0][i] = _mm512_dpbusd_epi32(out[0][i], a, q);
            out[1][i] = _mm512_dpbusd_epi32(out[1][i], b, q);
        }
    }
}

void fv_k_squares_two_u8__avx512vnni(int32_t *nearest, int32_t *second, uint32_t *index,
                                     const int8_t *queries, int32_t query_count,
                                     const uint8_t *trains, const int32_t *bias, int32_t groups,
                                     int32_t words)
{
    const __m512i first = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (int32_t q = 0; q < query_count; q += QUERIES) {
        const int8_t *query[QUERIES]; /* missing ones repeat the last */
        struct lanes lanes[QUERIES];
        for (int i = 0; i < QUERIES; i++) {
            const int32_t of = q + i < query_count ? q + i : query_count - 1;
            query[i] = queries + (int64_t)of * 4 * words;
            lanes[i].best = lanes[i].next = _mm512_set1_epi32(INT32_MAX);
            lanes[i].at = first;
        }
        for (int32_t g = 0; g < groups; g += 2) {
            const int32_t two = g + 1 < groups;
            __m512i product[2][QUERIES];
            products(product, query, trains + (int64_t)g * 64 * words, words, two);
            for (int32_t k = 0; k <= two; k++) {
                const __m512i at = _mm512_add_epi32(first, _mm512_set1_epi32(LANES * (g + k)));
                const __m512i of = _mm512_load_si512(bias + (int64_t)LANES * (g + k));
                for (int i = 0; i < QUERIES; i++)
                    update(&lanes[i], of, product[k][i], at);
            }
        }
        for (int i = 0; i < QUERIES && q + i < query_count; i++) {
            int32_t best[LANES], next[LANES], at[LANES];
            _mm512_storeu_si512(best, lanes[i].best);
            _mm512_storeu_si512(next, lanes[i].next);
            _mm512_storeu_si512(at, lanes[i].at);
            squares_finish(best, next, at, LANES, nearest + q + i, second + q + i, index + q + i);
        }
    }
}
