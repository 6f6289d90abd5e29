#include <smmintrin.h>
#include <stdint.h>
#include <string.h>

#define FV_INLINE static inline __attribute__((always_inline))

enum { LANES = 4 };
typedef __m128i lanes;

FV_INLINE lanes all_of(int32_t value)
{
    return _mm_set1_epi32(value);
}

FV_INLINE lanes load(const int32_t *from)
{
    return _mm_loadu_si128((const __m128i *)(const void *)from);
}

FV_INLINE void store(int32_t *to, lanes v)
{
    _mm_storeu_si128((__m128i *)(void *)to, v);
}

FV_INLINE lanes plus(lanes a, lanes b)
{
    return _mm_add_epi32(a, b);
}

FV_INLINE lanes minus(lanes a, lanes b)
{
    return _mm_sub_epi32(a, b);
}

FV_INLINE lanes smaller(lanes a, lanes b)
{
    return _mm_min_epi32(a, b);
}

FV_INLINE lanes larger(lanes a, lanes b)
{
    return _mm_max_epi32(a, b);
}

FV_INLINE lanes above_zero(lanes v)
{
    return _mm_max_epi32(v, _mm_setzero_si128());
}

/* To the right, of unsigned words. */
FV_INLINE lanes shifted(lanes v, int32_t bits)
{
    return _mm_srl_epi32(v, _mm_cvtsi32_si128(bits));
}

FV_INLINE lanes shifted_each(lanes v, lanes bits)
{
    const __m128i word = _mm_set_epi64x(0, 0xFFFFFFFF);
    const __m128i a = _mm_srl_epi32(v, _mm_and_si128(bits, word)),
                  b = _mm_srl_epi32(v, _mm_srli_epi64(bits, 32)),
                  c = _mm_srl_epi32(v, _mm_and_si128(_mm_srli_si128(bits, 8), word)),
                  d = _mm_srl_epi32(v, _mm_srli_si128(bits, 12));
    return _mm_blend_epi16(_mm_blend_epi16(a, b, 0x0C), _mm_blend_epi16(c, d, 0xC0), 0xF0);
}

/* fv_nn_high_product, of two that are not both -2^31. */
FV_INLINE lanes high_product(lanes a, lanes b)
{
    const __m128i half = _mm_set1_epi64x(INT64_C(1) << 30);
    const __m128i even = _mm_add_epi64(_mm_mul_epi32(a, b), half);
    const __m128i odd =
        _mm_add_epi64(_mm_mul_epi32(_mm_srli_epi64(a, 32), _mm_srli_epi64(b, 32)), half);
    return _mm_blend_epi16(_mm_srli_epi64(even, 31), _mm_slli_epi64(odd, 1), 0xCC);
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

/* Of four bytes, by their distances from the largest. */
FV_INLINE lanes exponentials(const int32_t *exps, const uint8_t *in, int32_t largest)
{
    const int32_t *from = exps + largest;
    return _mm_setr_epi32(*(from - in[0]), *(from - in[1]), *(from - in[2]), *(from - in[3]));
}

FV_INLINE int32_t sum_of(lanes v)
{
    const __m128i two = _mm_add_epi32(v, _mm_shuffle_epi32(v, 0x4E));
    return _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 0xB1)));
}

/* Four words, none above 2^15, cut to 255. */
FV_INLINE void store_bytes_of(uint8_t *to, lanes v)
{
    const __m128i words = _mm_packus_epi32(v, v);
    const int32_t bytes = _mm_cvtsi128_si32(_mm_packus_epi16(words, words));
    memcpy(to, &bytes, sizeof bytes);
}

#include "kernels/nn_softmax_lanes.h"

void fv_k_nn_softmax_u8__sse4(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                              int32_t rows)
{
    softmax(exps, in, out, depth, rows);
}
