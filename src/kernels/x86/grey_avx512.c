#include "kernels/contracts/grey_ends.h"
#include "kernels/kernels.h"

#include <immintrin.h>

void fv_k_grey_shift_u16__avx512(uint8_t *grey, const uint8_t *source, int32_t count, int32_t shift)
{
    const __m128i by = _mm_cvtsi32_si128(shift);
    for (int32_t i = 0; i < count; i += 32) {
        const int32_t left = count - i;
        const __mmask32 mask = left >= 32 ? 0xffffffffu : (1u << left) - 1u;
        const __m512i level = _mm512_srl_epi16(_mm512_maskz_loadu_epi16(mask, source + 2 * i), by);
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

/* Sixteen pixels at a time: each 128-bit lane gets the twelve bytes of its four pixels. */
void fv_k_grey_mix_u8__avx512(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first,
                              int32_t third)
{
    const __m512i outer = _mm512_set1_epi32(19235 << 16 | first), inner = _mm512_set1_epi32(third);
    const __m512i round = _mm512_set1_epi32(16384);
    const __m512i lanes = _mm512_setr_epi32(0, 1, 2, 3, 3, 4, 5, 6, 6, 7, 8, 9, 9, 10, 11, 12);
    const __m512i pair = _mm512_broadcast_i32x4(
        _mm_setr_epi8(0, -1, 1, -1, 3, -1, 4, -1, 6, -1, 7, -1, 9, -1, 10, -1));
    const __m512i last = _mm512_broadcast_i32x4(
        _mm_setr_epi8(2, -1, -1, -1, 5, -1, -1, -1, 8, -1, -1, -1, 11, -1, -1, -1));
    for (int32_t i = 0; i < count; i += 16) {
        const int32_t left = count - i < 16 ? count - i : 16;
        const __mmask64 mask = (UINT64_C(1) << 3 * left) - 1u;
        const __m512i bytes =
            _mm512_permutexvar_epi32(lanes, _mm512_maskz_loadu_epi8(mask, source + 3 * i));
        const __m512i a = _mm512_madd_epi16(_mm512_shuffle_epi8(bytes, pair), outer);
        const __m512i b = _mm512_madd_epi16(_mm512_shuffle_epi8(bytes, last), inner);
        const __m512i level =
            _mm512_srli_epi32(_mm512_add_epi32(_mm512_add_epi32(a, b), round), 15);
        _mm512_mask_cvtepi32_storeu_epi8(grey + i, (__mmask16)((1u << left) - 1u), level);
    }
}

static inline __m512i column(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    const __m512i a = _mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)above));
    const __m512i r = _mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)row));
    const __m512i b = _mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)below));
    return _mm512_add_epi16(_mm512_add_epi16(a, b), _mm512_slli_epi16(r, 1));
}

void fv_k_grey_bayer_u8__avx512(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                                const uint8_t *below, int32_t count)
{
    int32_t x = 1;
    for (; x + 33 <= count; x += 32) {
        const __m512i left = column(above + x - 1, row + x - 1, below + x - 1);
        const __m512i middle = column(above + x, row + x, below + x);
        const __m512i right = column(above + x + 1, row + x + 1, below + x + 1);
        __m512i sum = _mm512_add_epi16(_mm512_add_epi16(left, right), _mm512_slli_epi16(middle, 1));
        sum = _mm512_srli_epi16(_mm512_add_epi16(sum, _mm512_set1_epi16(8)), 4);
        _mm256_storeu_si256((__m256i *)(grey + x), _mm512_cvtepi16_epi8(sum));
    }
    fv_k_grey_bayer_ends(grey, above, row, below, count, x);
}
