#include <immintrin.h>
#include <stdint.h>

#define FV_INLINE static inline __attribute__((always_inline))

enum { LANES = 8 };
typedef __m256i lanes;

FV_INLINE lanes all_of(int32_t value)
{
    return _mm256_set1_epi32(value);
}

FV_INLINE lanes load(const int32_t *from)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)from);
}

FV_INLINE void store(int32_t *to, lanes v)
{
    _mm256_storeu_si256((__m256i *)(void *)to, v);
}

FV_INLINE lanes plus(lanes a, lanes b)
{
    return _mm256_add_epi32(a, b);
}

FV_INLINE lanes minus(lanes a, lanes b)
{
    return _mm256_sub_epi32(a, b);
}

FV_INLINE lanes smaller(lanes a, lanes b)
{
    return _mm256_min_epi32(a, b);
}

FV_INLINE lanes larger(lanes a, lanes b)
{
    return _mm256_max_epi32(a, b);
}

FV_INLINE lanes above_zero(lanes v)
{
    return _mm256_max_epi32(v, _mm256_setzero_si256());
}

/* To the right, of unsigned words. */
FV_INLINE lanes shifted(lanes v, int32_t bits)
{
    return _mm256_srl_epi32(v, _mm_cvtsi32_si128(bits));
}

FV_INLINE lanes shifted_each(lanes v, lanes bits)
{
    return _mm256_srlv_epi32(v, bits);
}

/* fv_nn_high_product, of two that are not both -2^31. */
FV_INLINE lanes high_product(lanes a, lanes b)
{
    const __m256i half = _mm256_set1_epi64x(INT64_C(1) << 30);
    const __m256i even = _mm256_add_epi64(_mm256_mul_epi32(a, b), half);
    const __m256i odd = _mm256_add_epi64(
        _mm256_mul_epi32(_mm256_srli_epi64(a, 32), _mm256_srli_epi64(b, 32)), half);
    return _mm256_blend_epi32(_mm256_srli_epi64(even, 31), _mm256_slli_epi64(odd, 1), 0xAA);
}

/* Of at least 16 bytes. */
FV_INLINE int32_t largest_of_many(const uint8_t *in, int32_t depth)
{
    __m128i most = _mm_loadu_si128((const __m128i *)(const void *)(in + depth - 16));
    for (int32_t i = 0; i + 16 <= depth; i += 16)
        most = _mm_max_epu8(most, _mm_loadu_si128((const __m128i *)(const void *)(in + i)));
    const __m128i least = _mm_xor_si128(most, _mm_set1_epi8(-1)); /* of what is missing to 255 */
    const __m128i pairs = _mm_min_epu8(least, _mm_srli_epi16(least, 8));
    return 255 - _mm_extract_epi16(_mm_minpos_epu16(pairs), 0);
}

/* Of eight bytes, by their distances from the largest. Single loads: processors that are mended
 * against the leak of gathered data take longer for a gather. */
FV_INLINE lanes exponentials(const int32_t *exps, const uint8_t *in, int32_t largest)
{
    const int32_t *from = exps + largest;
    return _mm256_setr_epi32(*(from - in[0]), *(from - in[1]), *(from - in[2]), *(from - in[3]),
                             *(from - in[4]), *(from - in[5]), *(from - in[6]), *(from - in[7]));
}

FV_INLINE int32_t sum_of(lanes v)
{
    const __m128i four = _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    const __m128i two = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4E));
    return _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 0xB1)));
}

/* Eight words, none above 2^15, cut to 255. */
FV_INLINE void store_bytes_of(uint8_t *to, lanes v)
{
    const __m128i words =
        _mm_packus_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    _mm_storel_epi64((__m128i *)(void *)to, _mm_packus_epi16(words, words));
}

#include "kernels/nn_softmax_lanes.h"

void fv_k_nn_softmax_u8__avx2(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                              int32_t rows)
{
    softmax(exps, in, out, depth, rows);
}
