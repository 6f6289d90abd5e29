/* Slopes by channel of bytes, in float32. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

void fv_k_nn_slopes_u8__avx512(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                               uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    const __m512i zero_in = _mm512_set1_epi32(p->zero_in),
                  zero_out = _mm512_set1_epi32(p->zero_out);
    const __m512 rising = _mm512_set1_ps(p->slopes[count]);
    for (int32_t r = 0; r < rows; r++) {
        for (int32_t i = 0; i < count; i += 16) {
            const __mmask16 some =
                (__mmask16)(count - i < 16 ? (1u << (count - i)) - 1 : UINT16_MAX);
            const __m128i bytes = _mm_maskz_loadu_epi8(some, in + r * ldi + i);
            const __m512 x =
                _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_cvtepu8_epi32(bytes), zero_in));
            const __mmask16 falls = _mm512_movepi32_mask(_mm512_castps_si512(x));
            const __m512 slope = _mm512_mask_loadu_ps(rising, falls & some, p->slopes + i);
            const __m512i y =
                _mm512_add_epi32(_mm512_cvtps_epi32(_mm512_mul_ps(x, slope)), zero_out);
            const __m512i positive = _mm512_max_epi32(y, _mm512_setzero_si512());
            _mm_mask_storeu_epi8(out + r * ldo + i, some, _mm512_cvtusepi32_epi8(positive));
        }
    }
}
