#include <immintrin.h>
#include <string.h>

#include "kernels/kernels.h"
#include "kernels/squares_lanes.h"

enum { QUERIES = 2, LANES = 4 };

struct lanes {
    __m128i best, next, at;
};

static inline void update(struct lanes *lanes, __m128i bias, __m128i product, __m128i at)
{
    const __m128i v = _mm_sub_epi32(bias, _mm_slli_epi32(product, 1));
    const __m128i nearer = _mm_cmpgt_epi32(lanes->best, v);
    lanes->next = _mm_min_epi32(lanes->next, _mm_max_epi32(lanes->best, v));
    lanes->best = _mm_min_epi32(lanes->best, v);
    lanes->at = _mm_blendv_epi8(lanes->at, at, nearer);
}

/* Bytes 0 and 2, and bytes 1 and 3, of each word of a query as 16 bits. */
static inline void widen(const int8_t *query, int32_t words, int32_t even[], int32_t odd[])
{
    for (int32_t w = 0; w < words; w++) {
        const int8_t *b = query + 4 * (int64_t)w;
        even[w] = (int32_t)((uint16_t)b[0] | (uint32_t)(uint16_t)b[2] << 16);
        odd[w] = (int32_t)((uint16_t)b[1] | (uint32_t)(uint16_t)b[3] << 16);
    }
}

void fv_k_squares_two_u8__sse4(int32_t *nearest, int32_t *second, uint32_t *index,
                               const int8_t *queries, int32_t query_count, const uint8_t *trains,
                               const int32_t *bias, int32_t groups, int32_t words)
{
    const __m128i first = _mm_setr_epi32(0, 1, 2, 3);
    const __m128i low = _mm_set1_epi16(255);
    for (int32_t q = 0; q < query_count; q += QUERIES) {
        int32_t even[QUERIES][FV_SQUARES_WORDS_MAX], odd[QUERIES][FV_SQUARES_WORDS_MAX];
        struct lanes lanes[QUERIES];
        for (int i = 0; i < QUERIES; i++) { /* missing ones repeat the last */
            const int32_t of = q + i < query_count ? q + i : query_count - 1;
            widen(queries + (int64_t)of * 4 * words, words, even[i], odd[i]);
            lanes[i].best = lanes[i].next = _mm_set1_epi32(INT32_MAX);
            lanes[i].at = first;
        }
        for (int32_t part = 0; part < 4 * groups; part++) {
            const uint8_t *from = trains + (int64_t)(part / 4) * 64 * words + (part & 3) * 16;
            __m128i sum[QUERIES] = {_mm_setzero_si128(), _mm_setzero_si128()};
            for (int32_t w = 0; w < words; w++) {
                const __m128i t =
                    _mm_load_si128((const __m128i *)(const void *)(from + 64 * (int64_t)w));
                const __m128i a = _mm_and_si128(t, low), b = _mm_srli_epi16(t, 8);
                for (int i = 0; i < QUERIES; i++)
                    sum[i] = _mm_add_epi32(
                        sum[i], _mm_add_epi32(_mm_madd_epi16(a, _mm_set1_epi32(even[i][w])),
                                              _mm_madd_epi16(b, _mm_set1_epi32(odd[i][w]))));
            }
            const __m128i at = _mm_add_epi32(first, _mm_set1_epi32(LANES * part));
            const __m128i of =
                _mm_load_si128((const __m128i *)(const void *)(bias + (int64_t)LANES * part));
            for (int i = 0; i < QUERIES; i++)
                update(&lanes[i], of, sum[i], at);
        }
        for (int i = 0; i < QUERIES && q + i < query_count; i++) {
            int32_t best[LANES], next[LANES], at[LANES];
            _mm_storeu_si128((__m128i *)(void *)best, lanes[i].best);
            _mm_storeu_si128((__m128i *)(void *)next, lanes[i].next);
            _mm_storeu_si128((__m128i *)(void *)at, lanes[i].at);
            squares_finish(best, next, at, LANES, nearest + q + i, second + q + i, index + q + i);
        }
    }
}
