#include "kernels/kernels.h"
#include "kernels/x86/shrink_table.h"

#include <immintrin.h>

/* pmulhrsw by 2^15 / 128 is the rounded shift by 7. */
static inline __m128i round7(__m128i sum)
{
    return _mm_mulhrs_epi16(sum, _mm_set1_epi16(256));
}

void fv_k_blend_rows_u8__sse4(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                              int32_t weight_b)
{
    const __m128i weights = _mm_set1_epi16((int16_t)(weight_b << 8 | (128 - weight_b)));
    for (int32_t i = 0; i < count; i += 16) {
        const __m128i pa = _mm_loadu_si128((const __m128i *)(a + i)),
                      pb = _mm_loadu_si128((const __m128i *)(b + i));
        const __m128i low = round7(_mm_maddubs_epi16(_mm_unpacklo_epi8(pa, pb), weights));
        const __m128i high = round7(_mm_maddubs_epi16(_mm_unpackhi_epi8(pa, pb), weights));
        _mm_storeu_si128((__m128i *)(out + i), _mm_packus_epi16(low, high));
    }
}

static inline __m128i eight(const uint8_t *in, int32_t i, int row)
{
    const __m128i pixels = _mm_loadu_si128((const __m128i *)(in + i + i / 5));
    const __m128i pairs =
        _mm_shuffle_epi8(pixels, _mm_loadu_si128((const __m128i *)shrink_pairs[row]));
    return round7(_mm_maddubs_epi16(pairs, _mm_loadu_si128((const __m128i *)shrink_weights[row])));
}

void fv_k_shrink_row_u8__sse4(uint8_t *out, const uint8_t *in, int32_t count)
{
    int row = 0;
    for (int32_t i = 0; i < count; i += 16) {
        const __m128i low = eight(in, i, row), high = eight(in, i + 8, row + 1);
        _mm_storeu_si128((__m128i *)(out + i), _mm_packus_epi16(low, high));
        row = row + 2 >= 5 ? row - 3 : row + 2;
    }
}
