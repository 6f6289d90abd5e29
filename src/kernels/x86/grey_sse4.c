#include "kernels/kernels.h"

#include <immintrin.h>

/* min against 255 before the saturating pack, which takes its input as signed. */
void fv_k_grey_shift_u16__sse4(uint8_t *grey, const uint16_t *source, int32_t count, int32_t shift)
{
    const __m128i by = _mm_cvtsi32_si128(shift), white = _mm_set1_epi16(255);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        __m128i a = _mm_loadu_si128((const __m128i *)(source + i));
        __m128i b = _mm_loadu_si128((const __m128i *)(source + i + 8));
        a = _mm_min_epu16(_mm_srl_epi16(a, by), white);
        b = _mm_min_epu16(_mm_srl_epi16(b, by), white);
        _mm_storeu_si128((__m128i *)(grey + i), _mm_packus_epi16(a, b));
    }
    fv_k_grey_shift_u16__c(grey + i, source + i, count - i, shift);
}

void fv_k_grey_pick_u8__sse4(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    const __m128i by = _mm_cvtsi32_si128(8 * offset), low = _mm_set1_epi16(255);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        __m128i a = _mm_loadu_si128((const __m128i *)(source + 2 * i));
        __m128i b = _mm_loadu_si128((const __m128i *)(source + 2 * i + 16));
        a = _mm_and_si128(_mm_srl_epi16(a, by), low);
        b = _mm_and_si128(_mm_srl_epi16(b, by), low);
        _mm_storeu_si128((__m128i *)(grey + i), _mm_packus_epi16(a, b));
    }
    fv_k_grey_pick_u8__c(grey + i, source + 2 * i, count - i, offset);
}
