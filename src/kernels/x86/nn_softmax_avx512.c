#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"
#include "kernels/nn_softmax.h"
#include "kernels/x86/nn_avx512.h"

/* 16 values: distance from the largest to exponential; lanes outside the mask give -1, which counts
 * as left out. */
FV_INLINE __m512i exponentials(const int32_t *exps, const uint8_t *in, __mmask16 mask,
                               __m512i largest)
{
    const __m512i distance =
        _mm512_sub_epi32(largest, _mm512_cvtepu8_epi32(_mm_maskz_loadu_epi8(mask, in)));
    return _mm512_mask_i32gather_epi32(_mm512_set1_epi32(-1), mask, distance, exps, 4);
}

/* Modulo 2^32, as the sum may pass 2^31; the compiler's own reduction adds as signed numbers. */
FV_INLINE int32_t sum_of(__m512i v)
{
    const __m256i eight =
        _mm256_add_epi32(_mm512_castsi512_si256(v), _mm512_extracti64x4_epi64(v, 1));
    const __m128i four =
        _mm_add_epi32(_mm256_castsi256_si128(eight), _mm256_extracti128_si256(eight, 1));
    const __m128i two = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4E));
    return _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 0xB1)));
}

static void row(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth)
{
    const __m512i zero = _mm512_setzero_si512();
    __m128i most = _mm_setzero_si128();
    for (int32_t i = 0; i < depth; i += 16) {
        const __mmask16 mask = (__mmask16)(depth - i >= 16 ? 0xFFFF : (1 << (depth - i)) - 1);
        most = _mm_max_epu8(most, _mm_maskz_loadu_epi8(mask, in + i));
    }
    const __m512i largest = _mm512_set1_epi32(_mm512_reduce_max_epi32(_mm512_cvtepu8_epi32(most)));
    __m512i sums = zero;
    for (int32_t i = 0; i < depth; i += 16) {
        const __mmask16 mask = (__mmask16)(depth - i >= 16 ? 0xFFFF : (1 << (depth - i)) - 1);
        const __m512i e = _mm512_max_epi32(exponentials(exps, in + i, mask, largest), zero);
        /* (e + 2^11) >> 12 without the sum's overflow; e is not negative */
        sums = _mm512_add_epi32(
            sums, _mm512_srli_epi32(_mm512_add_epi32(e, _mm512_set1_epi32(1 << 11)), 12));
    }
    int32_t over;
    const int32_t scale = fv_nn_reciprocal(sum_of(sums), &over);
    const int32_t exponent = fv_nn_clamp(over + 31 - 8, 0, 31);
    const __m512i factor = _mm512_set1_epi32(scale), half = _mm512_set1_epi64(INT64_C(1) << 30);
    const __m512i bias = _mm512_set1_epi32(exponent == 0 ? 0 : 1 << (exponent - 1));
    const __m128i shift = _mm_cvtsi32_si128(exponent);
    for (int32_t i = 0; i < depth; i += 16) {
        const __mmask16 mask = (__mmask16)(depth - i >= 16 ? 0xFFFF : (1 << (depth - i)) - 1);
        const __m512i e = exponentials(exps, in + i, mask, largest);
        const __m512i even =
            _mm512_srli_epi64(_mm512_add_epi64(_mm512_mul_epi32(e, factor), half), 31);
        const __m512i odd = _mm512_slli_epi64(
            _mm512_add_epi64(_mm512_mul_epi32(_mm512_srli_epi64(e, 32), factor), half), 1);
        const __m512i high = _mm512_mask_mov_epi32(even, 0xAAAA, odd);
        const __mmask16 keep = _mm512_cmpge_epi32_mask(e, zero);
        const __m512i value = _mm512_maskz_srl_epi32(keep, _mm512_add_epi32(high, bias), shift);
        _mm_mask_storeu_epi8(out + i, mask,
                             _mm512_cvtepi32_epi8(_mm512_min_epu32(value, _mm512_set1_epi32(255))));
    }
}

void fv_k_nn_softmax_u8__avx512(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                                int32_t rows)
{
    for (int32_t r = 0; r < rows; r++)
        row(exps, in + (ptrdiff_t)r * depth, out + (ptrdiff_t)r * depth, depth);
}
