/* What the AVX2 network kernels share: exact requantisation of 8 accumulators, byte tables, storing
 * tiles. Included by files of that set; inlined. */
#ifndef FOVEA_KERNELS_X86_NN_AVX2_H
#define FOVEA_KERNELS_X86_NN_AVX2_H

#include "kernels/x86/nn_store.h"

/* 32 bytes, aligned to 32. */
FV_INLINE __m256i load32(const void *from)
{
    return _mm256_load_si256((const __m256i *)from);
}

/* Four neighbouring bytes, in every lane of 32 bits. */
FV_INLINE __m256i four_inputs(const uint8_t *bytes)
{
    return _mm256_broadcastd_epi32(_mm_loadu_si32(bytes));
}

/* How results are made, known when compiling: with bits ABOVE_ZERO where those below zero will be
 * clamped to zero anyway, so that their rounding does not matter, LESSENED where all shifts are
 * below zero (load_any_scales), REAL where products of real numbers give the same bytes
 * (nn_real_avx2.h), and TABLED where there may be a table: to look up takes registers from the sums
 * of loops that do not. */
enum { ABOVE_ZERO = 1, LESSENED = 2, REAL = 4, TABLED = 8 };

/* Constants of 8 channels: see fv_nn_requantize. AVX2 has no arithmetic 64-bit shift: 2^62 is added
 * before the logical one and what it became, 2^(62 - right), taken off after it. LESSENED results
 * have no bits in the lower words of products: the upper ones are shifted by `more`, without
 * 2^62. `down`: the half of negative products. REAL ones have `factor` and `offset`. */
struct scale8 {
    __m256i multiplier, multiplier_odd, half_even, half_odd, down_even, down_odd, right_even,
        right_odd, excess, more;
    __m256 factor, offset;
};

FV_INLINE void half_of(__m256i shift, __m256i base, __m256i *half, __m256i *down, __m256i *right)
{
    const __m256i one = _mm256_set1_epi64x(1),
                  is_right = _mm256_cmpgt_epi64(_mm256_setzero_si256(), shift);
    *half = _mm256_sllv_epi64(one, _mm256_sub_epi64(_mm256_set1_epi64x(30), shift));
    *half =
        _mm256_add_epi64(*half, _mm256_and_si256(is_right, _mm256_set1_epi64x(INT64_C(1) << 30)));
    *half = _mm256_add_epi64(*half, base);
    *down =
        _mm256_sub_epi64(*half, _mm256_and_si256(is_right, _mm256_set1_epi64x(INT64_C(1) << 31)));
    *right = _mm256_sub_epi64(_mm256_set1_epi64x(31), shift);
}

/* Words of two 64-bit vectors, the lower halves: in each lane 0 1 of `even`, then 0 1 of `odd`. */
FV_INLINE __m256i low_words(__m256i even, __m256i odd)
{
    return _mm256_castps_si256(
        _mm256_shuffle_ps(_mm256_castsi256_ps(even), _mm256_castsi256_ps(odd), 0x88));
}

/* The same of the upper halves. */
FV_INLINE __m256i high_words(__m256i even, __m256i odd)
{
    return _mm256_castps_si256(
        _mm256_shuffle_ps(_mm256_castsi256_ps(even), _mm256_castsi256_ps(odd), 0xDD));
}

FV_INLINE void load_scale_as(struct scale8 *s, __m256i m, __m256i shift, const int mode)
{
    const __m256i base = _mm256_set1_epi64x((mode & LESSENED) != 0 ? 0 : INT64_C(1) << 62);
    const __m256i sign = _mm256_srai_epi32(shift, 31);
    const __m256i even = _mm256_blend_epi32(shift, _mm256_slli_epi64(sign, 32), 0xAA);
    const __m256i odd = _mm256_blend_epi32(_mm256_srli_epi64(shift, 32), sign, 0xAA);
    s->multiplier = m;
    s->multiplier_odd = _mm256_srli_epi64(m, 32);
    half_of(even, base, &s->half_even, &s->down_even, &s->right_even);
    half_of(odd, base, &s->half_odd, &s->down_odd, &s->right_odd);
    const __m256i one = _mm256_set1_epi64x(1), top = _mm256_set1_epi64x(62);
    s->excess = low_words(_mm256_sllv_epi64(one, _mm256_sub_epi64(top, s->right_even)),
                          _mm256_sllv_epi64(one, _mm256_sub_epi64(top, s->right_odd)));
    /* in the order of words that requantize makes */
    s->more = _mm256_shuffle_epi32(_mm256_sub_epi32(_mm256_set1_epi32(-1), shift), 0xD8);
}

FV_INLINE void load_scale(struct scale8 *s, __m256i m, __m256i shift)
{
    load_scale_as(s, m, shift, 0);
}

/* Those of 16 channels. */
FV_INLINE void load_scales(struct scale8 scale[2], const int32_t *multiplier, const int32_t *shift)
{
    for (int h = 0; h < 2; h++)
        load_scale(&scale[h], load32(multiplier + 8 * h), load32(shift + 8 * h));
}

/* The same, with LESSENED where the shifts are below zero; returns that or 0. A channel that is not
 * there, whose multiplier and shift are 0, gives 0 with a shift of -1 as well. */
FV_INLINE int load_any_scales(struct scale8 scale[2], const int32_t *multiplier,
                              const int32_t *shift)
{
    __m256i m[2], s[2];
    int all = 1;
    for (int h = 0; h < 2; h++) {
        m[h] = load32(multiplier + 8 * h);
        s[h] = load32(shift + 8 * h);
        const __m256i none = _mm256_cmpeq_epi32(m[h], _mm256_setzero_si256());
        s[h] = _mm256_min_epi32(
            s[h], _mm256_blendv_epi8(_mm256_set1_epi32(INT32_MAX), _mm256_set1_epi32(-1), none));
        all &= _mm256_movemask_ps(_mm256_castsi256_ps(s[h])) == 255;
    }
    for (int h = 0; h < 2; h++) {
        if (all)
            load_scale_as(&scale[h], m[h], s[h], LESSENED);
        else
            load_scale_as(&scale[h], m[h], load32(shift + 8 * h), 0);
    }
    return all ? LESSENED : 0;
}

/* A product plus its rounding; a negative one is rounded down where it lies half way. */
FV_INLINE __m256i rounded(__m256i product, __m256i half, __m256i down, const int mode)
{
    if ((mode & ABOVE_ZERO) == 0) {
        half = _mm256_castpd_si256(_mm256_blendv_pd(
            _mm256_castsi256_pd(half), _mm256_castsi256_pd(down), _mm256_castsi256_pd(product)));
    }
    return _mm256_add_epi64(product, half);
}

/* The sum times a real number, moved away from zero by the offset, to the nearest whole number. */
FV_INLINE __m256i requantize_real(__m256i acc, const struct scale8 *s, const int mode)
{
    const __m256 x = _mm256_cvtepi32_ps(acc), sign = _mm256_and_ps(x, _mm256_set1_ps(-0.0F));
    const __m256 offset = (mode & ABOVE_ZERO) != 0 ? s->offset : _mm256_or_ps(s->offset, sign);
    return _mm256_cvtps_epi32(_mm256_fmadd_ps(x, s->factor, offset));
}

/* Leaves the channels of each lane in the order 0 2 1 3, which two_rows undoes; REAL ones as they
 * are. */
FV_INLINE __m256i requantize(__m256i acc, const struct scale8 *s, const int mode)
{
    if ((mode & REAL) != 0) return requantize_real(acc, s, mode);
    const __m256i even =
        rounded(_mm256_mul_epi32(acc, s->multiplier), s->half_even, s->down_even, mode);
    const __m256i odd = rounded(_mm256_mul_epi32(_mm256_srli_epi64(acc, 32), s->multiplier_odd),
                                s->half_odd, s->down_odd, mode);
    if ((mode & LESSENED) != 0) return _mm256_srav_epi32(high_words(even, odd), s->more);
    return _mm256_sub_epi32(
        low_words(_mm256_srlv_epi64(even, s->right_even), _mm256_srlv_epi64(odd, s->right_odd)),
        s->excess);
}

/* A table of 256 bytes as 16 rows of 16 that are combined by exclusive or. pshufb gives zero where
 * bit 7 of its index is set, so x - 16 i picks from row i where 16 i <= x < 16 i + 128, and with
 * signed saturation, for i >= 8, wherever 16 i <= x. */
struct table32 {
    __m256i row[16];
};

FV_INLINE __m256i table_row(const uint8_t *table, int i)
{
    return i < 0 ? _mm256_setzero_si256()
                 : _mm256_broadcastsi128_si256(
                       _mm_loadu_si128((const __m128i *)(const void *)(table + 16 * i)));
}

static inline void load_table(struct table32 *t, const uint8_t *table)
{
    for (int i = 0; i < 16; i++) {
        t->row[i] = _mm256_xor_si256(table_row(table, i), table_row(table, i - 1));
        if (i >= 8) { /* of the first eight rows' differences those up to i - 8 no longer answer */
            t->row[i] = _mm256_xor_si256(
                t->row[i], _mm256_xor_si256(table_row(table, i - 8), table_row(table, i - 9)));
        }
    }
}

FV_INLINE __m256i look_up(const struct table32 *t, __m256i x)
{
    const __m256i step = _mm256_set1_epi8(16);
    __m256i high = _mm256_xor_si256(x, _mm256_set1_epi8((char)0x80)), low = x;
    __m256i a = _mm256_shuffle_epi8(t->row[0], low), b = _mm256_shuffle_epi8(t->row[8], high);
    for (int i = 1; i < 8; i++) {
        low = _mm256_sub_epi8(low, step);
        high = _mm256_subs_epi8(high, step);
        a = _mm256_xor_si256(a, _mm256_shuffle_epi8(t->row[i], low));
        b = _mm256_xor_si256(b, _mm256_shuffle_epi8(t->row[i + 8], high));
    }
    return _mm256_xor_si256(a, b);
}

/* How results become bytes. */
struct output {
    __m256i zero, low, high;
    int is_cut; /* to a range that is narrower than that of bytes */
    int has_table;
    struct table32 table;
};

static inline void init_output(struct output *o, int32_t zero, int32_t low, int32_t high,
                               const uint8_t *table)
{
    o->zero = _mm256_set1_epi16((short)zero);
    o->low = _mm256_set1_epi8((char)low);
    o->high = _mm256_set1_epi8((char)high);
    o->is_cut = low > 0 || high < 255;
    o->has_table = table != NULL;
    if (table != NULL) load_table(&o->table, table);
}

/* Two rows of 16 channels, 0-7 and 8-15: results of requantize to bytes in order. */
FV_INLINE __m256i two_rows(const struct output *o, const __m256i first[2], const __m256i second[2],
                           const int mode)
{
    const __m256i in_order = _mm256_setr_epi8(0, 2, 1, 3, 4, 6, 5, 7, 8, 10, 9, 11, 12, 14, 13, 15,
                                              0, 2, 1, 3, 4, 6, 5, 7, 8, 10, 9, 11, 12, 14, 13, 15);
    const __m256i a = _mm256_adds_epi16(_mm256_packs_epi32(first[0], first[1]), o->zero);
    const __m256i b = _mm256_adds_epi16(_mm256_packs_epi32(second[0], second[1]), o->zero);
    __m256i bytes = _mm256_packus_epi16(a, b);
    if (o->is_cut) bytes = _mm256_min_epu8(_mm256_max_epu8(bytes, o->low), o->high);
    const __m256i fours =
        _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
    const __m256i ordered = (mode & REAL) != 0 ? fours : _mm256_shuffle_epi8(fours, in_order);
    return (mode & TABLED) != 0 && o->has_table ? look_up(&o->table, ordered) : ordered;
}

/* Scale ROWS rows (1, or an even number) of 16 accumulators and store the first `width` channels of
 * each: step by step for all rows, since each step waits for the one before. */
FV_INLINE void store_tile(const struct output *o, const struct scale8 scale[2], __m256i acc[][2],
                          const int ROWS, uint8_t *out, ptrdiff_t ldo, int32_t width,
                          const int mode)
{
    const struct scale8 *low = &scale[0], *high = &scale[(mode & REAL) != 0 ? 0 : 1];
    __m256i words[6][2], bytes[3];
#pragma GCC unroll 6
    for (int r = 0; r < ROWS; r++) {
        words[r][0] = requantize(acc[r][0], low, mode);
        words[r][1] = requantize(acc[r][1], high, mode);
    }
#pragma GCC unroll 3
    for (int r = 0; r < ROWS; r += 2)
        bytes[r / 2] = two_rows(o, words[r], words[ROWS == 1 ? r : r + 1], mode);
#pragma GCC unroll 3
    for (int r = 0; r < ROWS; r += 2, out += 2 * ldo) {
        store_some(out, _mm256_castsi256_si128(bytes[r / 2]), width);
        if (ROWS > 1) store_some(out + ldo, _mm256_extracti128_si256(bytes[r / 2], 1), width);
    }
}

/* Scale two rows of 16 accumulators and store the first `width` channels of each, the second one
 * first. */
FV_INLINE void store_two(const struct output *o, const struct scale8 scale[2], __m256i acc[2][2],
                         uint8_t *first, uint8_t *second, int32_t width, const int mode)
{
    const struct scale8 *low = &scale[0], *high = &scale[(mode & REAL) != 0 ? 0 : 1];
    const __m256i a[2] = {requantize(acc[0][0], low, mode), requantize(acc[0][1], high, mode)};
    const __m256i b[2] = {requantize(acc[1][0], low, mode), requantize(acc[1][1], high, mode)};
    const __m256i bytes = two_rows(o, a, b, mode);
    store_some(second, _mm256_extracti128_si256(bytes, 1), width);
    store_some(first, _mm256_castsi256_si128(bytes), width);
}

#endif
