#include "kernels/x86/hamming_avx512.h"

/* As the AVX-512 variant, with VPOPCNTDQ counting whole words. */
static inline __m512i hamming_eight(const __m512i query[4], const __m512i train[4])
{
    __m512i count[4];
    for (int w = 0; w < 4; w++)
        count[w] = _mm512_popcnt_epi64(_mm512_xor_si512(query[w], train[w]));
    return _mm512_add_epi64(_mm512_add_epi64(count[0], count[1]),
                            _mm512_add_epi64(count[2], count[3]));
}

void fv_k_hamming_two_u8__avx512icl(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                                    int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    fv_hamming_two(nearest, second, queries, query_count, trains, train_count);
}
