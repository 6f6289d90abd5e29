/* What the SSE4.1 network kernels share: exact requantisation of 4 accumulators, and bytes from
 * them. Included by files of that set; inlined. */
#ifndef FOVEA_KERNELS_X86_NN_SSE4_H
#define FOVEA_KERNELS_X86_NN_SSE4_H

#include "kernels/x86/nn_store.h"

/* Constants of 4 channels: see fv_nn_requantize. SSE has neither an arithmetic 64-bit shift nor one
 * by lanes: 2^62 is added before the logical one and what it became, 2^(62 - right), taken off
 * after it; lanes of different counts are shifted apart and blended. `half` rounds, `down` is that
 * of negative products. */
struct scale4 {
    __m128i multiplier, multiplier_odd, half[2], down[2]; /* channels 0 and 2, 1 and 3 */
    __m128i right[4], excess;                             /* right: by channel */
    int same;                                             /* all four are shifted alike */
};

FV_INLINE __m128i load16(const void *from)
{
    return _mm_loadu_si128((const __m128i *)from);
}

/* Four neighbouring bytes, in every lane of 32 bits. */
FV_INLINE __m128i four_inputs(const uint8_t *bytes)
{
    return _mm_shuffle_epi32(_mm_loadu_si32(bytes), 0);
}

static inline void load_scale(struct scale4 *s, const int32_t *multiplier, const int32_t *shift)
{
    int64_t half[4], down[4];
    int32_t excess[4];
    for (int i = 0; i < 4; i++) {
        const int32_t right = 31 - shift[i];
        half[i] = (INT64_C(1) << 62) + (INT64_C(1) << (30 - shift[i])) +
                  (shift[i] < 0 ? INT64_C(1) << 30 : 0);
        down[i] = half[i] - (shift[i] < 0 ? INT64_C(1) << 31 : 0);
        excess[i] = (int32_t)(uint32_t)((UINT64_C(1) << 62) >> right);
        s->right[i] = _mm_cvtsi32_si128(right);
    }
    s->multiplier = load16(multiplier);
    s->multiplier_odd = _mm_srli_epi64(s->multiplier, 32);
    for (int i = 0; i < 2; i++) {
        s->half[i] = _mm_set_epi64x(half[i + 2], half[i]);
        s->down[i] = _mm_set_epi64x(down[i + 2], down[i]);
    }
    s->excess = load16(excess);
    s->same = shift[0] == shift[1] && shift[0] == shift[2] && shift[0] == shift[3];
}

/* The products of two channels plus their rounding, shifted. */
FV_INLINE __m128i scaled(__m128i product, const struct scale4 *s, const int odd, const int same,
                         const int above_zero)
{
    __m128i half = s->half[odd];
    if (!above_zero) {
        half = _mm_castpd_si128(_mm_blendv_pd(
            _mm_castsi128_pd(half), _mm_castsi128_pd(s->down[odd]), _mm_castsi128_pd(product)));
    }
    const __m128i sum = _mm_add_epi64(product, half);
    if (same) return _mm_srl_epi64(sum, s->right[odd]);
    return _mm_blend_epi16(_mm_srl_epi64(sum, s->right[odd]), _mm_srl_epi64(sum, s->right[odd + 2]),
                           0xF0);
}

/* `above_zero`: results below zero will be clamped to zero anyway, so the rounding of negative ones
 * does not matter. */
FV_INLINE __m128i requantize_as(__m128i acc, const struct scale4 *s, const int same,
                                const int above_zero)
{
    const __m128i even = scaled(_mm_mul_epi32(acc, s->multiplier), s, 0, same, above_zero);
    const __m128i odd =
        scaled(_mm_mul_epi32(_mm_srli_epi64(acc, 32), s->multiplier_odd), s, 1, same, above_zero);
    return _mm_sub_epi32(_mm_blend_epi16(even, _mm_slli_epi64(odd, 32), 0xCC), s->excess);
}

FV_INLINE __m128i requantize(__m128i acc, const struct scale4 *s, const int above_zero)
{
    return s->same ? requantize_as(acc, s, 1, above_zero) : requantize_as(acc, s, 0, above_zero);
}

/* How results become bytes. */
struct output {
    __m128i zero, low, high;
    const uint8_t *table;
};

static inline void init_output(struct output *o, int32_t zero, int32_t low, int32_t high,
                               const uint8_t *table)
{
    o->zero = _mm_set1_epi16((short)zero);
    o->low = _mm_set1_epi8((char)low);
    o->high = _mm_set1_epi8((char)high);
    o->table = table;
}

/* Sixteen results as bytes, but for the table. */
FV_INLINE __m128i to_bytes(const struct output *o, __m128i a, __m128i b, __m128i c, __m128i d)
{
    const __m128i first = _mm_adds_epi16(_mm_packs_epi32(a, b), o->zero),
                  second = _mm_adds_epi16(_mm_packs_epi32(c, d), o->zero);
    return _mm_min_epu8(_mm_max_epu8(_mm_packus_epi16(first, second), o->low), o->high);
}

/* The first `width` of 16 bytes, through the table. */
FV_INLINE void store_bytes(const struct output *o, uint8_t *to, __m128i v, int32_t width)
{
    if (o->table == NULL) {
        store_some(to, v, width);
        return;
    }
    uint8_t bytes[16];
    _mm_storeu_si128((__m128i *)(void *)bytes, v);
    for (int32_t i = 0; i < width; i++)
        to[i] = o->table[bytes[i]];
}

#endif
