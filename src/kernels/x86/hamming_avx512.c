#include "kernels/x86/hamming_avx512.h"

/* As the AVX2 variant with sixteen queries; the carry-save adder is two ternary operations. */
static inline __m512i nibble_counts(__m512i words, __m512i table)
{
    const __m512i nibble = _mm512_set1_epi8(15);
    return _mm512_add_epi8(
        _mm512_shuffle_epi8(table, _mm512_and_si512(words, nibble)),
        _mm512_shuffle_epi8(table, _mm512_and_si512(_mm512_srli_epi16(words, 4), nibble)));
}

static inline __m512i hamming_eight(const __m512i query[4], const __m512i train[4])
{
    const __m512i ones_table =
        _mm512_broadcast_i32x4(_mm_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4));
    const __m512i twos_table = _mm512_add_epi8(ones_table, ones_table);
    const __m512i a = _mm512_xor_si512(query[0], train[0]),
                  b = _mm512_xor_si512(query[1], train[1]);
    const __m512i c = _mm512_xor_si512(query[2], train[2]),
                  d = _mm512_xor_si512(query[3], train[3]);
    const __m512i ones = _mm512_ternarylogic_epi64(a, b, c, 0x96); /* odd number of ones */
    const __m512i twos = _mm512_ternarylogic_epi64(a, b, c, 0xe8); /* majority */
    const __m512i counts = _mm512_add_epi8(
        _mm512_add_epi8(nibble_counts(ones, ones_table), nibble_counts(d, ones_table)),
        nibble_counts(twos, twos_table));
    return _mm512_sad_epu8(counts, _mm512_setzero_si512());
}

void fv_k_hamming_two_u8__avx512(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                                 int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    fv_hamming_two(nearest, second, queries, query_count, trains, train_count);
}
