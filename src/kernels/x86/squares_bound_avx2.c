#include <immintrin.h>
#include <string.h>

#include "kernels/kernels.h"

static inline __m256i load(const void *from)
{
    return _mm256_load_si256(from);
}

enum { MOST = 64, N = FV_BOUND_QUERIES };

/* Two values of a query as one of 32 bits that has them twice, so that a broadcast is one load. */
static void widen(int32_t twice[MOST], const int8_t *query, int32_t pairs, int32_t *sum)
{
    *sum = 0;
    for (int32_t p = 0; p < pairs; p++) {
        const uint32_t two = (uint8_t)query[2 * p] | (uint32_t)(uint8_t)query[2 * p + 1] << 8;
        twice[p] = (int32_t)(two | two << 16);
        *sum += query[2 * p] + query[2 * p + 1];
    }
}

void fv_k_squares_bound_s16__avx2(int16_t *rows, int32_t stride, int16_t *least,
                                  const int8_t *queries, const uint8_t *trains, const int16_t *half,
                                  int32_t groups, int32_t pairs)
{
    int32_t twice[N][MOST], sum[N];
    __m256i lanes[N], zero[N];
    for (int q = 0; q < N; q++) {
        widen(twice[q], queries + (int64_t)q * 2 * pairs, pairs, &sum[q]);
        zero[q] = _mm256_set1_epi16((int16_t)(-FV_BOUND_ZERO * sum[q]));
        lanes[q] = _mm256_set1_epi16(INT16_MAX);
    }
    for (int32_t g = 0; g < groups; g++) {
        __m256i left[N], right[N];
        for (int q = 0; q < N; q++)
            left[q] = right[q] = zero[q];
        for (int32_t p = 0; p < pairs; p += 2, trains += 4 * FV_BOUND_GROUP) {
            const __m256i a = load(trains), b = load(trains + 32);
            const __m256i c = load(trains + 64), d = load(trains + 96);
            for (int q = 0; q < N; q++) {
                __m256i of = _mm256_set1_epi32(twice[q][p]);
                const __m256i then = _mm256_set1_epi32(twice[q][p + 1]);
                __asm__ volatile("" : "+x"(of)); /* one query after the other: no spilling */
                left[q] =
                    _mm256_add_epi16(left[q], _mm256_add_epi16(_mm256_maddubs_epi16(a, of),
                                                               _mm256_maddubs_epi16(c, then)));
                right[q] =
                    _mm256_add_epi16(right[q], _mm256_add_epi16(_mm256_maddubs_epi16(b, of),
                                                                _mm256_maddubs_epi16(d, then)));
                __asm__ volatile("" : "+x"(left[q]), "+x"(right[q]));
            }
        }
        const int32_t at = g * FV_BOUND_GROUP;
        const __m256i half_left = load(half + at), half_right = load(half + at + 16);
        for (int q = 0; q < N; q++) {
            const __m256i a = _mm256_sub_epi16(half_left, left[q]);
            const __m256i b = _mm256_sub_epi16(half_right, right[q]);
            _mm256_store_si256((void *)(rows + (int64_t)q * stride + at), a);
            _mm256_store_si256((void *)(rows + (int64_t)q * stride + at + 16), b);
            lanes[q] = _mm256_min_epi16(lanes[q], _mm256_min_epi16(a, b));
        }
    }
    for (int q = 0; q < N; q++)
        _mm256_storeu_si256((void *)(least + (int64_t)q * FV_BOUND_LANES), lanes[q]);
}

/* Where some of 32 are found: which, and the index of the first. */
struct masks {
    uint32_t mask[64];
    int32_t first[64];
    int32_t count;
};

static void look(struct masks *masks, const int16_t *row, int32_t from, int32_t to, int16_t limit)
{
    const __m256i most = _mm256_set1_epi16(limit);
    masks->count = 0;
    for (int32_t i = from; i < to; i += 32) {
        const __m256i a = _mm256_cmpgt_epi16(load(row + i), most);
        const __m256i b = _mm256_cmpgt_epi16(load(row + i + 16), most);
        /* packed, the halves of a and b alternate */
        const __m256i both = _mm256_permute4x64_epi64(_mm256_packs_epi16(a, b), 0xd8);
        const uint32_t mask = ~(uint32_t)_mm256_movemask_epi8(both);
        masks->mask[masks->count] = mask;
        masks->first[masks->count] = i;
        masks->count += mask != 0;
    }
}

/* A processor does not foresee where some are found, nor how many: no branches on either, but for
 * more than two of 32. */
int32_t fv_k_squares_below_s16__avx2(uint16_t *indices, const int16_t *row, int32_t count,
                                     int16_t limit)
{
    enum { BLOCK = 64 * 32 };
    int32_t found = 0;
    for (int32_t from = 0; from < count; from += BLOCK) {
        struct masks masks;
        look(&masks, row, from, from + BLOCK < count ? from + BLOCK : count, limit);
        for (int32_t k = 0; k < masks.count; k++) {
            uint32_t mask = masks.mask[k];
            const int32_t first = masks.first[k];
            const int32_t one = first + __builtin_ctz(mask);
            mask &= mask - 1;
            const int32_t two = first + (int32_t)_tzcnt_u32(mask);
            indices[found] = (uint16_t)one;
            if (found + 1 < count) indices[found + 1] = (uint16_t)two;
            found += 1 + (mask != 0);
            for (mask &= mask - 1; mask != 0; mask &= mask - 1)
                indices[found++] = (uint16_t)(first + __builtin_ctz(mask));
        }
    }
    return found;
}

static inline __attribute__((always_inline)) void compare(int32_t *distances, const uint8_t *query,
                                                          const uint8_t *descriptors, int32_t bytes,
                                                          const uint16_t *indices, int32_t count)
{
    enum { VECTORS = 8 };
    const int32_t full = bytes / 16;
    __m256i wide[VECTORS];
    for (int32_t v = 0; v < full; v++)
        wide[v] = _mm256_cvtepu8_epi16(_mm_loadu_si128((const void *)(query + 16 * (int64_t)v)));
    for (int32_t k = 0; k < count; k++) {
        /* far apart, and more than the caches nearby hold */
        const uint8_t *then = descriptors + (int64_t)bytes * indices[k + 8 < count ? k + 8 : k];
        _mm_prefetch(then, _MM_HINT_T0);
        _mm_prefetch(then + 64, _MM_HINT_T0);
        const uint8_t *other = descriptors + (int64_t)bytes * indices[k];
        __m256i sums = _mm256_setzero_si256();
        int32_t sum = 0;
        for (int32_t v = 0; v < full; v++) {
            const __m256i apart = _mm256_sub_epi16(
                _mm256_cvtepu8_epi16(_mm_loadu_si128((const void *)(other + 16 * (int64_t)v))),
                wide[v]);
            sums = _mm256_add_epi32(sums, _mm256_madd_epi16(apart, apart));
        }
        for (int32_t i = 16 * full; i < bytes; i++)
            sum += (query[i] - other[i]) * (query[i] - other[i]);
        const __m128i four =
            _mm_add_epi32(_mm256_castsi256_si128(sums), _mm256_extracti128_si256(sums, 1));
        const __m128i two = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4e));
        distances[k] = sum + _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 0xb1)));
    }
}

void fv_k_squares_some_u8__avx2(int32_t *distances, const uint8_t *query,
                                const uint8_t *descriptors, int32_t bytes, const uint16_t *indices,
                                int32_t count)
{
    if (bytes == 128)
        compare(distances, query, descriptors, 128, indices, count);
    else
        compare(distances, query, descriptors, bytes, indices, count);
}
