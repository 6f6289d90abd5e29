/* What the AVX2 network kernels share: exact requantisation of 8 accumulators. Included by files of that set; inlined. */
#ifndef FOVEA_KERNELS_X86_NN_AVX2_H
#define FOVEA_KERNELS_X86_NN_AVX2_H

#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#define FV_INLINE static inline __attribute__((always_inline))

/* Constants of 8 channels: see fv_nn_requantize. AVX2 has no arithmetic 64-bit shift: 2^62 is added before the logical one
 * and what it became, 2^(62 - right), taken off after it. */
struct scale8 {
    __m256i multiplier, multiplier_odd, half_even, half_odd, fix_even, fix_odd, right_even, right_odd, excess;
};

FV_INLINE void half_of(__m256i shift, __m256i *half, __m256i *fix, __m256i *right)
{
    const __m256i one = _mm256_set1_epi64x(1), down = _mm256_cmpgt_epi64(_mm256_setzero_si256(), shift);
    *half = _mm256_sllv_epi64(one, _mm256_sub_epi64(_mm256_set1_epi64x(30), shift));
    *half = _mm256_add_epi64(*half, _mm256_and_si256(down, _mm256_set1_epi64x(INT64_C(1) << 30)));
    *half = _mm256_add_epi64(*half, _mm256_set1_epi64x(INT64_C(1) << 62));
    *fix = _mm256_and_si256(down, _mm256_set1_epi64x(INT64_C(1) << 31));
    *right = _mm256_sub_epi64(_mm256_set1_epi64x(31), shift);
}

FV_INLINE void load_scale(struct scale8 *s, __m256i m, __m256i shift)
{
    const __m256i sign = _mm256_srai_epi32(shift, 31);
    const __m256i even = _mm256_blend_epi32(shift, _mm256_slli_epi64(sign, 32), 0xAA);
    const __m256i odd = _mm256_blend_epi32(_mm256_srli_epi64(shift, 32), sign, 0xAA);
    s->multiplier = m;
    s->multiplier_odd = _mm256_srli_epi64(m, 32);
    half_of(even, &s->half_even, &s->fix_even, &s->right_even);
    half_of(odd, &s->half_odd, &s->fix_odd, &s->right_odd);
    const __m256i one = _mm256_set1_epi64x(1), top = _mm256_set1_epi64x(62);
    const __m256i excess_even = _mm256_sllv_epi64(one, _mm256_sub_epi64(top, s->right_even));
    const __m256i excess_odd = _mm256_sllv_epi64(one, _mm256_sub_epi64(top, s->right_odd));
    s->excess = _mm256_blend_epi32(excess_even, _mm256_slli_epi64(excess_odd, 32), 0xAA);
}

/* A product plus its rounding; a negative one is rounded down where it lies half way. */
FV_INLINE __m256i scaled(__m256i product, __m256i half, __m256i fix, __m256i right, const int above_zero)
{
    __m256i sum = _mm256_add_epi64(product, half);
    if (!above_zero) {
        const __m256i negative = _mm256_shuffle_epi32(_mm256_srai_epi32(product, 31), 0xF5);
        sum = _mm256_sub_epi64(sum, _mm256_and_si256(negative, fix));
    }
    return _mm256_srlv_epi64(sum, right);
}

/* `above_zero`: results below zero will be clamped to zero anyway, so the rounding of negative ones does not matter. */
FV_INLINE __m256i requantize(__m256i acc, const struct scale8 *s, const int above_zero)
{
    const __m256i even = scaled(_mm256_mul_epi32(acc, s->multiplier), s->half_even, s->fix_even, s->right_even, above_zero);
    const __m256i odd = scaled(_mm256_mul_epi32(_mm256_srli_epi64(acc, 32), s->multiplier_odd), s->half_odd, s->fix_odd,
                               s->right_odd, above_zero);
    return _mm256_sub_epi32(_mm256_blend_epi32(even, _mm256_slli_epi64(odd, 32), 0xAA), s->excess);
}

/* How results become bytes, and where they go. */
struct output {
    __m256i zero;
    __m128i low, high;
    const uint8_t *table;
    int32_t width; /* valid bytes of the 16 */
};

FV_INLINE void init_output(struct output *o, int32_t zero, int32_t low, int32_t high, const uint8_t *table)
{
    o->zero = _mm256_set1_epi16((short)zero);
    o->low = _mm_set1_epi8((char)low);
    o->high = _mm_set1_epi8((char)high);
    o->table = table;
    o->width = 16;
}

/* 16 words (in order within 128-bit lanes after packing) to bytes. */
FV_INLINE void store16(const struct output *o, __m256i words, uint8_t *out)
{
    const __m256i moved = _mm256_adds_epi16(words, o->zero);
    __m128i bytes = _mm_packus_epi16(_mm256_castsi256_si128(moved), _mm256_extracti128_si256(moved, 1));
    bytes = _mm_min_epu8(_mm_max_epu8(bytes, o->low), o->high);
    if (o->table == NULL && o->width == 16) {
        _mm_storeu_si128((__m128i *)(void *)out, bytes);
        return;
    }
    uint8_t part[16];
    _mm_storeu_si128((__m128i *)(void *)part, bytes);
    if (o->table != NULL) {
        for (int i = 0; i < 16; ++i) part[i] = o->table[part[i]];
    }
    memcpy(out, part, (size_t)o->width);
}

#endif
