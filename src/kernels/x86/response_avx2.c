#include <stdint.h>

#include <immintrin.h>

/* Products of two rows at once, and of the third. */
static inline __m256i three_products(__m256i p01, __m256i q01, __m256i p2, __m256i q2)
{
    return _mm256_add_epi32(_mm256_madd_epi16(p01, q01), _mm256_madd_epi16(p2, q2));
}

static inline __m256i sixteen_at(const int16_t *row)
{
    return _mm256_loadu_si256((const __m256i *)row);
}

static inline void column_sums(int32_t *restrict out, const int16_t *const *p,
                               const int16_t *const *q, int32_t width)
{
    const __m256i zero = _mm256_setzero_si256();
    int32_t x = 0;
    for (; x + 16 <= width; x += 16) {
        const __m256i p0 = sixteen_at(p[0] + x), p1 = sixteen_at(p[1] + x),
                      p2 = sixteen_at(p[2] + x);
        const __m256i q0 = sixteen_at(q[0] + x), q1 = sixteen_at(q[1] + x),
                      q2 = sixteen_at(q[2] + x);
        /* Lanes hold places 0 to 3 and 8 to 11, and 4 to 7 and 12 to 15. */
        const __m256i low =
            three_products(_mm256_unpacklo_epi16(p0, p1), _mm256_unpacklo_epi16(q0, q1),
                           _mm256_unpacklo_epi16(p2, zero), _mm256_unpacklo_epi16(q2, zero));
        const __m256i high =
            three_products(_mm256_unpackhi_epi16(p0, p1), _mm256_unpackhi_epi16(q0, q1),
                           _mm256_unpackhi_epi16(p2, zero), _mm256_unpackhi_epi16(q2, zero));
        _mm256_storeu_si256((__m256i *)(out + x), _mm256_permute2x128_si256(low, high, 0x20));
        _mm256_storeu_si256((__m256i *)(out + x + 8), _mm256_permute2x128_si256(low, high, 0x31));
    }
    for (; x < width; x++)
        out[x] = p[0][x] * q[0][x] + p[1][x] * q[1][x] + p[2][x] * q[2][x];
}

#define FV_COLUMN_SUMS
#define FV_NAME(kernel) fv_k_##kernel##__avx2
#include "kernels/response_loops.h"
