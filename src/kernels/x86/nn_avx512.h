/* What the AVX-512 network kernels share: exact requantisation of 16 accumulators, packing of 64,
 * byte tables. Included by files of one instruction set each; everything is inlined there. */
#ifndef FOVEA_KERNELS_X86_NN_AVX512_H
#define FOVEA_KERNELS_X86_NN_AVX512_H

#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#define FV_INLINE static inline __attribute__((always_inline))

/* The first `count` of 64 bytes, all where there are more; count is at least 1. */
FV_INLINE __mmask64 first_bytes(ptrdiff_t count)
{
    return count >= 64 ? ~UINT64_C(0) : ~UINT64_C(0) >> (64 - count);
}

/* Constants of 16 channels: see fv_nn_requantize. Even and odd channels take turns in the 64-bit
 * products. */
struct scale16 {
    __m512i multiplier, multiplier_odd, half_even, half_odd, fix_even, fix_odd, right_even,
        right_odd;
};

FV_INLINE void half_of(__m512i shift, __m512i *half, __m512i *fix, __m512i *right)
{
    const __m512i one = _mm512_set1_epi64(1);
    const __mmask8 down = _mm512_cmplt_epi64_mask(shift, _mm512_setzero_si512());
    const __m512i at = _mm512_sub_epi64(_mm512_set1_epi64(30), shift);
    *half = _mm512_sllv_epi64(one, at);
    *half = _mm512_mask_add_epi64(*half, down, *half, _mm512_set1_epi64(INT64_C(1) << 30));
    *fix = _mm512_maskz_set1_epi64(down, INT64_C(1) << 31);
    *right = _mm512_sub_epi64(_mm512_set1_epi64(31), shift);
}

FV_INLINE void load_scale_of(struct scale16 *s, __m512i m, __m512i h)
{
    s->multiplier = m;
    s->multiplier_odd = _mm512_srli_epi64(m, 32);
    half_of(_mm512_srai_epi64(_mm512_slli_epi64(h, 32), 32), &s->half_even, &s->fix_even,
            &s->right_even);
    half_of(_mm512_srai_epi64(h, 32), &s->half_odd, &s->fix_odd, &s->right_odd);
}

FV_INLINE void load_scale(struct scale16 *s, const int32_t *multiplier, const int32_t *shift)
{
    load_scale_of(s, _mm512_loadu_si512(multiplier), _mm512_loadu_si512(shift));
}

/* `from_zero`: the zero point is 0. Results below zero will be clamped to zero, so the rounding of
 * negative ones does not matter. */
FV_INLINE __m512i requantize(__m512i acc, const struct scale16 *s, const int from_zero)
{
    __m512i even = _mm512_mul_epi32(acc, s->multiplier);
    __m512i odd = _mm512_mul_epi32(_mm512_srli_epi64(acc, 32), s->multiplier_odd);
    const __mmask8 even_negative = from_zero ? 0 : _mm512_movepi64_mask(even);
    const __mmask8 odd_negative = from_zero ? 0 : _mm512_movepi64_mask(odd);
    even = _mm512_add_epi64(even, s->half_even);
    odd = _mm512_add_epi64(odd, s->half_odd);
    if (!from_zero) {
        even = _mm512_mask_sub_epi64(even, even_negative, even, s->fix_even);
        odd = _mm512_mask_sub_epi64(odd, odd_negative, odd, s->fix_odd);
    }
    even = _mm512_srav_epi64(even, s->right_even);
    odd = _mm512_srav_epi64(odd, s->right_odd);
    return _mm512_mask_shuffle_epi32(even, 0xAAAA, odd, _MM_PERM_CCAA);
}

/* The same where all shifts are below zero, as multipliers below one half have: what is left of the
 * products lies in their upper words, which are put together before one shift of 32-bit lanes.
 * Zen 4 does one shift of 64 bytes per cycle, and shifts and shuffles share its pipes. */
struct down16 {
    __m512i multiplier, multiplier_odd, half_even, half_odd, right;
};

FV_INLINE void load_down_of(struct down16 *s, __m512i m, __m512i h)
{
    struct scale16 scale;
    load_scale_of(&scale, m, h);
    s->multiplier = scale.multiplier;
    s->multiplier_odd = scale.multiplier_odd;
    s->half_even = scale.half_even;
    s->half_odd = scale.half_odd;
    s->right = _mm512_sub_epi32(_mm512_set1_epi32(-1), h);
}

FV_INLINE void load_down(struct down16 *s, const int32_t *multiplier, const int32_t *shift)
{
    load_down_of(s, _mm512_loadu_si512(multiplier), _mm512_loadu_si512(shift));
}

/* Whether the shifts of n channels are below zero, but for channels that are always zero. */
static inline int all_down(const int32_t *multiplier, const int32_t *shift, int32_t n)
{
    __mmask16 up = 0;
    for (int32_t i = 0; i < n; i += 16) {
        const __mmask16 used = n - i < 16 ? (__mmask16)((1u << (n - i)) - 1) : 0xFFFF;
        const __m512i m = _mm512_loadu_si512(multiplier + i), h = _mm512_loadu_si512(shift + i);
        up |= _mm512_mask_cmpge_epi32_mask(_mm512_mask_test_epi32_mask(used, m, m), h,
                                           _mm512_setzero_si512());
    }
    return up == 0;
}

FV_INLINE __m512i requantize_down(__m512i acc, const struct down16 *s, const int from_zero)
{
    __m512i even = _mm512_mul_epi32(acc, s->multiplier);
    __m512i odd = _mm512_mul_epi32(_mm512_srli_epi64(acc, 32), s->multiplier_odd);
    if (!from_zero) {
        const __m512i fix = _mm512_set1_epi64(INT64_C(1) << 31);
        const __mmask8 even_negative = _mm512_movepi64_mask(even),
                       odd_negative = _mm512_movepi64_mask(odd);
        even = _mm512_mask_sub_epi64(even, even_negative, even, fix);
        odd = _mm512_mask_sub_epi64(odd, odd_negative, odd, fix);
    }
    even = _mm512_add_epi64(even, s->half_even);
    odd = _mm512_add_epi64(odd, s->half_odd);
    return _mm512_srav_epi32(_mm512_mask_shuffle_epi32(odd, 0x5555, even, _MM_PERM_DDBB), s->right);
}

/* 16 channels that are rounded by real numbers (contracts/nn.h). */
struct real16 {
    __m512 factor, offset;
};

/* A positive number with the sign of an integer. */
FV_INLINE __m512 with_sign(__m512 value, __m512i of)
{
    enum { FIRST_OR_BOTH = 0xF8 }; /* a | (b & c) */
    return _mm512_castsi512_ps(_mm512_ternarylogic_epi32(
        _mm512_castps_si512(value), of, _mm512_set1_epi32(INT32_MIN), FIRST_OR_BOTH));
}

FV_INLINE __m512i requantize_real(__m512i acc, const struct real16 *s, const int from_zero)
{
    enum { CUT = _MM_FROUND_TO_ZERO | _MM_FROUND_NO_EXC };
    const __m512 x = _mm512_cvt_roundepi32_ps(acc, CUT);
    const __m512 offset = from_zero ? s->offset : with_sign(s->offset, acc);
    return _mm512_cvt_roundps_epi32(_mm512_fmadd_round_ps(x, s->factor, offset, CUT), CUT);
}

/* How results become bytes. */
struct clamp64 {
    __m512i zero, low, high;
    int is_cut; /* to a range that is narrower than that of bytes */
};

static inline struct clamp64 clamp_of(int32_t zero, int32_t low, int32_t high)
{
    return (struct clamp64){_mm512_set1_epi16((short)zero), _mm512_set1_epi8((char)low),
                            _mm512_set1_epi8((char)high), low > 0 || high < 255};
}

/* Lanes of 4 x 16 results to 64 bytes per 128-bit lane: [a b c d] of that lane, moved by the zero
 * point, which is 0 if `from_zero`, and clamped. */
FV_INLINE __m512i pack_lanes(__m512i a, __m512i b, __m512i c, __m512i d, const struct clamp64 *to,
                             const int from_zero)
{
    __m512i ab = _mm512_packs_epi32(a, b), cd = _mm512_packs_epi32(c, d);
    if (!from_zero) {
        ab = _mm512_adds_epi16(ab, to->zero);
        cd = _mm512_adds_epi16(cd, to->zero);
    }
    __m512i bytes = _mm512_packus_epi16(ab, cd);
    if (to->is_cut) bytes = _mm512_min_epu8(_mm512_max_epu8(bytes, to->low), to->high);
    return bytes;
}

/* Words of 64 bytes, 16 in each register, in the order in which unpacking leaves the bytes: out[q]
 * holds 4 q to 4 q + 3 of each 16. */
FV_INLINE void transpose_lanes(const __m512i in[4], __m512i out[4])
{
    const __m512i a = _mm512_shuffle_i32x4(in[0], in[1], 0x44),
                  b = _mm512_shuffle_i32x4(in[2], in[3], 0x44);
    const __m512i c = _mm512_shuffle_i32x4(in[0], in[1], 0xEE),
                  d = _mm512_shuffle_i32x4(in[2], in[3], 0xEE);
    out[0] = _mm512_shuffle_i32x4(a, b, 0x88);
    out[1] = _mm512_shuffle_i32x4(a, b, 0xDD);
    out[2] = _mm512_shuffle_i32x4(c, d, 0x88);
    out[3] = _mm512_shuffle_i32x4(c, d, 0xDD);
}

/* Table lookup of 64 bytes. With VBMI by bytes, else by words: a word holds the entries of two
 * neighbouring indices, and a shift takes that of the lower bit. */
struct table64 {
    __m512i part[4];
};

FV_INLINE void load_table(struct table64 *t, const uint8_t *table)
{
    for (int i = 0; i < 4; i++)
        t->part[i] = table == NULL ? _mm512_setzero_si512() : _mm512_loadu_si512(table + 64 * i);
}

#ifdef __AVX512VBMI__

FV_INLINE __m512i look_up(__m512i index, const struct table64 *t)
{
    const __m512i low = _mm512_permutex2var_epi8(t->part[0], index, t->part[1]);
    const __m512i high = _mm512_permutex2var_epi8(t->part[2], index, t->part[3]);
    return _mm512_mask_mov_epi8(low, _mm512_movepi8_mask(index), high);
}

#else

/* `word`: which of the table's words, in the six lowest bits of each lane; `upper`: its second
 * half. */
FV_INLINE __m512i look_up_words(__m512i word, __mmask32 upper, const struct table64 *t)
{
    const __m512i low = _mm512_permutex2var_epi16(t->part[0], word, t->part[1]);
    const __m512i high = _mm512_permutex2var_epi16(t->part[2], word, t->part[3]);
    return _mm512_mask_mov_epi16(low, upper, high);
}

FV_INLINE __m512i look_up(__m512i index, const struct table64 *t)
{
    const __m512i eight = _mm512_set1_epi16(8);
    const __m512i even = look_up_words(_mm512_srli_epi16(index, 1),
                                       _mm512_test_epi16_mask(index, _mm512_set1_epi16(0x80)), t);
    const __m512i odd = look_up_words(_mm512_srli_epi16(index, 9), _mm512_movepi16_mask(index), t);
    const __m512i down = _mm512_and_si512(_mm512_slli_epi16(index, 3), eight);
    const __m512i up = _mm512_andnot_si512(_mm512_srli_epi16(index, 5), eight);
    return _mm512_mask_mov_epi8(_mm512_srlv_epi16(even, down), UINT64_C(0xAAAAAAAAAAAAAAAA),
                                _mm512_sllv_epi16(odd, up));
}

#endif

#endif
