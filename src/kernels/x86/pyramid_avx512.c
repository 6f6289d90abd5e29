#include "kernels/kernels.h"
#include "kernels/x86/shrink_table.h"

#include <immintrin.h>

/* pmulhrsw by 2^15 / 128 is the rounded shift by 7. */
static inline __m512i round7(__m512i sum)
{
    return _mm512_mulhrs_epi16(sum, _mm512_set1_epi16(256));
}

void fv_k_blend_rows_u8__avx512(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                                int32_t weight_b)
{
    const __m512i weights = _mm512_set1_epi16((int16_t)(weight_b << 8 | (128 - weight_b)));
    for (int32_t i = 0; i < count; i += 64) {
        const __m512i pa = _mm512_loadu_si512(a + i), pb = _mm512_loadu_si512(b + i);
        const __m512i low = round7(_mm512_maddubs_epi16(_mm512_unpacklo_epi8(pa, pb), weights));
        const __m512i high = round7(_mm512_maddubs_epi16(_mm512_unpackhi_epi8(pa, pb), weights));
        _mm512_storeu_si512(out + i, _mm512_packus_epi16(low, high));
    }
}

static inline __m128i load(const uint8_t *in, int32_t i)
{
    return _mm_loadu_si128((const __m128i *)(in + i + i / 5));
}

static inline __m512i thirty_two(const uint8_t *in, int32_t i, int row)
{
    __m512i pixels = _mm512_castsi128_si512(load(in, i));
    pixels = _mm512_inserti32x4(pixels, load(in, i + 8), 1);
    pixels = _mm512_inserti32x4(pixels, load(in, i + 16), 2);
    pixels = _mm512_inserti32x4(pixels, load(in, i + 24), 3);
    const __m512i pairs = _mm512_shuffle_epi8(pixels, _mm512_loadu_si512(shrink_pairs[row]));
    return round7(_mm512_maddubs_epi16(pairs, _mm512_loadu_si512(shrink_weights[row])));
}

void fv_k_shrink_row_u8__avx512(uint8_t *out, const uint8_t *in, int32_t count)
{
    int row = 0;
    for (int32_t i = 0; i < count; i += 32) {
        _mm256_storeu_si256((__m256i *)(out + i), _mm512_cvtepi16_epi8(thirty_two(in, i, row)));
        row = row == 0 ? 4 : row - 1; /* 4 rows further, mod 5 */
    }
}
