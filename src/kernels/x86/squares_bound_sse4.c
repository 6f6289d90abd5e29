#include <immintrin.h>
#include <string.h>

#include "kernels/kernels.h"

/* Sixteen trains at a time: half a group, as many as FV_BOUND_LANES. */
enum { MOST = 64, N = FV_BOUND_QUERIES, PART = FV_BOUND_GROUP / 2 };
_Static_assert((int)PART == (int)FV_BOUND_LANES, "the least of a part are those of the lanes");

static inline __m128i load(const void *from)
{
    return _mm_load_si128(from);
}

/* Two values of a query as many times as a vector holds them. */
static void widen(__m128i *pair, const int8_t *query, int32_t pairs, __m128i *zero)
{
    int32_t sum = 0;
    for (int32_t p = 0; p < pairs; p++) {
        uint16_t two;
        memcpy(&two, query + 2 * (int64_t)p, sizeof two);
        pair[p] = _mm_set1_epi16((int16_t)two);
        sum += query[2 * p] + query[2 * p + 1];
    }
    *zero = _mm_set1_epi16((int16_t)(-FV_BOUND_ZERO * sum));
}

void fv_k_squares_bound_s16__sse4(int16_t *rows, int32_t stride, int16_t *least,
                                  const int8_t *queries, const uint8_t *trains, const int16_t *half,
                                  int32_t groups, int32_t pairs)
{
    __m128i pair[N][MOST], zero[N], lanes[N][2];
    for (int q = 0; q < N; q++) {
        widen(pair[q], queries + (int64_t)q * 2 * pairs, pairs, &zero[q]);
        lanes[q][0] = lanes[q][1] = _mm_set1_epi16(INT16_MAX);
    }
    for (int32_t part = 0; part < 2 * groups; part++) {
        const uint8_t *from =
            trains + (int64_t)(part / 2) * 2 * FV_BOUND_GROUP * pairs + (part & 1) * 2 * PART;
        __m128i left[N], right[N];
        for (int q = 0; q < N; q++)
            left[q] = right[q] = zero[q];
        for (int32_t p = 0; p < pairs; p++, from += 2 * FV_BOUND_GROUP) {
            const __m128i a = load(from), b = load(from + 16);
            for (int q = 0; q < N; q++) {
                left[q] = _mm_add_epi16(left[q], _mm_maddubs_epi16(a, pair[q][p]));
                right[q] = _mm_add_epi16(right[q], _mm_maddubs_epi16(b, pair[q][p]));
            }
        }
        const int16_t *of = half + (int64_t)part * PART;
        for (int q = 0; q < N; q++) {
            int16_t *row = rows + (int64_t)q * stride + (int64_t)part * PART;
            const __m128i a = _mm_sub_epi16(load(of), left[q]);
            const __m128i b = _mm_sub_epi16(load(of + 8), right[q]);
            _mm_store_si128((void *)row, a);
            _mm_store_si128((void *)(row + 8), b);
            lanes[q][0] = _mm_min_epi16(lanes[q][0], a);
            lanes[q][1] = _mm_min_epi16(lanes[q][1], b);
        }
    }
    for (int q = 0; q < N; q++) {
        _mm_storeu_si128((void *)(least + (int64_t)q * FV_BOUND_LANES), lanes[q][0]);
        _mm_storeu_si128((void *)(least + (int64_t)q * FV_BOUND_LANES + 8), lanes[q][1]);
    }
}

int32_t fv_k_squares_below_s16__sse4(uint16_t *indices, const int16_t *row, int32_t count,
                                     int16_t limit)
{
    const __m128i most = _mm_set1_epi16(limit);
    int32_t found = 0;
    for (int32_t i = 0; i < count; i += 16) {
        const __m128i above = _mm_packs_epi16(_mm_cmpgt_epi16(load(row + i), most),
                                              _mm_cmpgt_epi16(load(row + i + 8), most));
        for (uint32_t mask = ~(uint32_t)_mm_movemask_epi8(above) & 0xffff; mask != 0;
             mask &= mask - 1)
            indices[found++] = (uint16_t)(i + __builtin_ctz(mask));
    }
    return found;
}

static inline __m128i widened(const uint8_t *from)
{
    return _mm_cvtepu8_epi16(_mm_loadl_epi64((const void *)from));
}

static inline __attribute__((always_inline)) void compare(int32_t *distances, const uint8_t *query,
                                                          const uint8_t *descriptors, int32_t bytes,
                                                          const uint16_t *indices, int32_t count)
{
    enum { VECTORS = 16 };
    const int32_t full = bytes / 8;
    __m128i wide[VECTORS];
    for (int32_t v = 0; v < full; v++)
        wide[v] = widened(query + 8 * (int64_t)v);
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *other = descriptors + (int64_t)bytes * indices[k];
        __m128i sums = _mm_setzero_si128();
        int32_t sum = 0;
        for (int32_t v = 0; v < full; v++) {
            const __m128i apart = _mm_sub_epi16(widened(other + 8 * (int64_t)v), wide[v]);
            sums = _mm_add_epi32(sums, _mm_madd_epi16(apart, apart));
        }
        for (int32_t i = 8 * full; i < bytes; i++)
            sum += (query[i] - other[i]) * (query[i] - other[i]);
        const __m128i two = _mm_add_epi32(sums, _mm_shuffle_epi32(sums, 0x4e));
        distances[k] = sum + _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 0xb1)));
    }
}

void fv_k_squares_some_u8__sse4(int32_t *distances, const uint8_t *query,
                                const uint8_t *descriptors, int32_t bytes, const uint16_t *indices,
                                int32_t count)
{
    if (bytes == 128)
        compare(distances, query, descriptors, 128, indices, count);
    else
        compare(distances, query, descriptors, bytes, indices, count);
}
