#include "kernels/kernels.h"

#include <immintrin.h>
#include <string.h>

/* Eight queries at a time: each 64-bit lane holds one word of one query's descriptor, so that the
 * sums of a query stay in its lane and each train descriptor is broadcast. Three of the four
 * differing words go through a carry-save adder first, so that three bit counts do instead of four
 * (Harley and Seal; see Mula, Kurz and Lemire, "Faster population counts using AVX2 instructions",
 * 2016). */
static inline __m256i nibble_counts(__m256i words, __m256i table)
{
    const __m256i nibble = _mm256_set1_epi8(15);
    return _mm256_add_epi8(
        _mm256_shuffle_epi8(table, _mm256_and_si256(words, nibble)),
        _mm256_shuffle_epi8(table, _mm256_and_si256(_mm256_srli_epi16(words, 4), nibble)));
}

/* Distances of four queries, one per 64-bit lane. */
static inline __m256i hamming_four(const __m256i query[4], const __m256i train[4])
{
    const __m256i ones_table = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0,
                                                1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
    const __m256i twos_table = _mm256_add_epi8(ones_table, ones_table);
    const __m256i a = _mm256_xor_si256(query[0], train[0]),
                  b = _mm256_xor_si256(query[1], train[1]);
    const __m256i c = _mm256_xor_si256(query[2], train[2]),
                  d = _mm256_xor_si256(query[3], train[3]);
    const __m256i half = _mm256_xor_si256(a, b), ones = _mm256_xor_si256(half, c);
    const __m256i twos = _mm256_or_si256(_mm256_and_si256(a, b), _mm256_and_si256(half, c));
    const __m256i counts = _mm256_add_epi8(
        _mm256_add_epi8(nibble_counts(ones, ones_table), nibble_counts(d, ones_table)),
        nibble_counts(twos, twos_table));
    return _mm256_sad_epu8(counts, _mm256_setzero_si256());
}

void fv_k_hamming_two_u8__avx2(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                               int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    int32_t q = 0;
    for (; q + 8 <= query_count; q += 8) {
        uint64_t lanes[2][4][4]; /* query 2 i + g is lane i of group g */
        for (int i = 0; i < 8; i++)
            for (int w = 0; w < 4; w++)
                memcpy(&lanes[i & 1][w][i >> 1],
                       queries + FV_DESCRIPTOR_BYTES * (size_t)(q + i) + 8 * w, 8);
        __m256i even[4], odd[4];
        for (int w = 0; w < 4; w++) {
            even[w] = _mm256_loadu_si256((const __m256i *)lanes[0][w]);
            odd[w] = _mm256_loadu_si256((const __m256i *)lanes[1][w]);
        }
        __m256i best = _mm256_set1_epi32(-1), next = best;
        const uint8_t *at = trains;
        for (int32_t t = 0; t < train_count; t++, at += FV_DESCRIPTOR_BYTES) {
            __m256i train[4];
            for (int w = 0; w < 4; w++) {
                int64_t word;
                memcpy(&word, at + 8 * w, 8);
                train[w] = _mm256_set1_epi64x(word);
            }
            const __m256i distance = _mm256_or_si256(
                hamming_four(even, train), _mm256_slli_epi64(hamming_four(odd, train), 32));
            const __m256i match = _mm256_or_si256(_mm256_slli_epi32(distance, FV_MATCH_INDEX_BITS),
                                                  _mm256_set1_epi32(t));
            next = _mm256_min_epu32(next, _mm256_max_epu32(best, match));
            best = _mm256_min_epu32(best, match);
        }
        _mm256_storeu_si256((__m256i *)(nearest + q), best);
        _mm256_storeu_si256((__m256i *)(second + q), next);
    }
    /* Fewer than eight are left. In plain C each would cost as much as eight here: its baseline has
     * no instruction that counts bits. */
    fv_k_hamming_two_u8__sse4(nearest + q, second + q, queries + FV_DESCRIPTOR_BYTES * (size_t)q,
                              query_count - q, trains, train_count);
}
