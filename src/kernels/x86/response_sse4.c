#include <stdint.h>

#include <immintrin.h>

/* Products of two rows at once, and of the third. */
static inline __m128i three_products(__m128i p01, __m128i q01, __m128i p2, __m128i q2)
{
    return _mm_add_epi32(_mm_madd_epi16(p01, q01), _mm_madd_epi16(p2, q2));
}

static inline __m128i eight_at(const int16_t *row)
{
    return _mm_loadu_si128((const __m128i *)row);
}

static inline void column_sums(int32_t *restrict out, const int16_t *const *p,
                               const int16_t *const *q, int32_t width)
{
    const __m128i zero = _mm_setzero_si128();
    int32_t x = 0;
    for (; x + 8 <= width; x += 8) {
        const __m128i p0 = eight_at(p[0] + x), p1 = eight_at(p[1] + x), p2 = eight_at(p[2] + x);
        const __m128i q0 = eight_at(q[0] + x), q1 = eight_at(q[1] + x), q2 = eight_at(q[2] + x);
        _mm_storeu_si128((__m128i *)(out + x),
                         three_products(_mm_unpacklo_epi16(p0, p1), _mm_unpacklo_epi16(q0, q1),
                                        _mm_unpacklo_epi16(p2, zero),
                                        _mm_unpacklo_epi16(q2, zero)));
        _mm_storeu_si128((__m128i *)(out + x + 4),
                         three_products(_mm_unpackhi_epi16(p0, p1), _mm_unpackhi_epi16(q0, q1),
                                        _mm_unpackhi_epi16(p2, zero),
                                        _mm_unpackhi_epi16(q2, zero)));
    }
    for (; x < width; x++)
        out[x] = p[0][x] * q[0][x] + p[1][x] * q[1][x] + p[2][x] * q[2][x];
}

#define FV_COLUMN_SUMS
#define FV_NAME(kernel) fv_k_##kernel##__sse4
#include "kernels/response_loops.h"
