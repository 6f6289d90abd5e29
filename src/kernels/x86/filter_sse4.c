#include "kernels/kernels.h"

#include <immintrin.h>

/* Weighted sums of two pixels each, in pairs of words; 8 pixels. */
static inline void two_sums(__m128i pairs, __m128i weights, __m128i half, __m128i *low,
                            __m128i *high)
{
    const __m128i zero = _mm_setzero_si128();
    *low = _mm_add_epi32(_mm_madd_epi16(_mm_unpacklo_epi8(pairs, zero), weights), half);
    *high = _mm_add_epi32(_mm_madd_epi16(_mm_unpackhi_epi8(pairs, zero), weights), half);
}

static inline __m128i weights_of(int32_t a, int32_t b)
{
    return _mm_set1_epi32((int32_t)((uint32_t)b << 16 | ((uint32_t)a & 0xffff)));
}

static inline __m128i mix_eight(__m128i pairs, __m128i weights)
{
    __m128i low, high;
    two_sums(pairs, weights, _mm_set1_epi32(128), &low, &high);
    return _mm_packs_epi32(_mm_srai_epi32(low, 8), _mm_srai_epi32(high, 8));
}

void fv_k_mix_u8__sse4(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                       int32_t weight)
{
    const __m128i weights = weights_of(weight, 256 - weight);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        const __m128i va = _mm_loadu_si128((const __m128i *)(a + i)),
                      vb = _mm_loadu_si128((const __m128i *)(b + i));
        _mm_storeu_si128((__m128i *)(out + i),
                         _mm_packus_epi16(mix_eight(_mm_unpacklo_epi8(va, vb), weights),
                                          mix_eight(_mm_unpackhi_epi8(va, vb), weights)));
    }
    for (; i < count; i++) {
        const int32_t mixed = (weight * a[i] + (256 - weight) * b[i] + 128) >> 8;
        out[i] = (uint8_t)(mixed < 0 ? 0 : mixed > 255 ? 255 : mixed);
    }
}

static inline __m128i blend_eight(__m128i pairs, __m128i weights)
{
    __m128i low, high;
    two_sums(pairs, weights, _mm_set1_epi32(8), &low, &high);
    return _mm_packus_epi32(_mm_srli_epi32(low, 4), _mm_srli_epi32(high, 4));
}

void fv_k_contrast_blend_u16__sse4(uint16_t out[256], const uint8_t a[256], const uint8_t b[256],
                                   int32_t weight)
{
    const __m128i weights = weights_of(4096 - weight, weight);
    for (int32_t i = 0; i < 256; i += 16) {
        const __m128i va = _mm_loadu_si128((const __m128i *)(a + i)),
                      vb = _mm_loadu_si128((const __m128i *)(b + i));
        _mm_storeu_si128((__m128i *)(out + i), blend_eight(_mm_unpacklo_epi8(va, vb), weights));
        _mm_storeu_si128((__m128i *)(out + i + 8), blend_eight(_mm_unpackhi_epi8(va, vb), weights));
    }
}
