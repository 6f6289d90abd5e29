#include "kernels/kernels.h"

#include <immintrin.h>

void fv_k_grey_shift_u16__avx512(uint8_t *grey, const uint16_t *source, int32_t count, int32_t shift)
{
    const __m128i by = _mm_cvtsi32_si128(shift);
    for (int32_t i = 0; i < count; i += 32) {
        const int32_t left = count - i;
        const __mmask32 mask = left >= 32 ? 0xffffffffu : (1u << left) - 1u;
        const __m512i level = _mm512_srl_epi16(_mm512_maskz_loadu_epi16(mask, source + i), by);
        _mm512_mask_cvtusepi16_storeu_epi8(grey + i, mask, level);
    }
}

void fv_k_grey_pick_u8__avx512(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    const __m128i by = _mm_cvtsi32_si128(8 * offset);
    for (int32_t i = 0; i < count; i += 32) {
        const int32_t left = count - i;
        const __mmask32 mask = left >= 32 ? 0xffffffffu : (1u << left) - 1u;
        const __m512i pair = _mm512_maskz_loadu_epi16(mask, source + 2 * i);
        _mm512_mask_cvtepi16_storeu_epi8(grey + i, mask, _mm512_srl_epi16(pair, by));
    }
}
