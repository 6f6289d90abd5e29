#include "kernels/kernels.h"

#include <immintrin.h>

/* The pack works within 128-bit lanes: put the four quarters back in order. */
static inline __m256i pack(__m256i a, __m256i b)
{
    return _mm256_permute4x64_epi64(_mm256_packus_epi16(a, b), _MM_SHUFFLE(3, 1, 2, 0));
}

void fv_k_grey_shift_u16__avx2(uint8_t *grey, const uint16_t *source, int32_t count, int32_t shift)
{
    const __m128i by = _mm_cvtsi32_si128(shift);
    const __m256i white = _mm256_set1_epi16(255);
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        __m256i a = _mm256_loadu_si256((const __m256i *)(source + i));
        __m256i b = _mm256_loadu_si256((const __m256i *)(source + i + 16));
        a = _mm256_min_epu16(_mm256_srl_epi16(a, by), white);
        b = _mm256_min_epu16(_mm256_srl_epi16(b, by), white);
        _mm256_storeu_si256((__m256i *)(grey + i), pack(a, b));
    }
    fv_k_grey_shift_u16__c(grey + i, source + i, count - i, shift);
}

void fv_k_grey_pick_u8__avx2(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    const __m128i by = _mm_cvtsi32_si128(8 * offset);
    const __m256i low = _mm256_set1_epi16(255);
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        __m256i a = _mm256_loadu_si256((const __m256i *)(source + 2 * i));
        __m256i b = _mm256_loadu_si256((const __m256i *)(source + 2 * i + 32));
        a = _mm256_and_si256(_mm256_srl_epi16(a, by), low);
        b = _mm256_and_si256(_mm256_srl_epi16(b, by), low);
        _mm256_storeu_si256((__m256i *)(grey + i), pack(a, b));
    }
    fv_k_grey_pick_u8__c(grey + i, source + 2 * i, count - i, offset);
}
