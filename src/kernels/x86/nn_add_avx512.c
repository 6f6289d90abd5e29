#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

/* One input of a sum: 16 bytes to 32-bit lanes, moved by 20 bits, scaled. */
FV_INLINE __m512i term(__m128i bytes, __m512i zero, const struct scale16 *s, const int half)
{
    const __m512i v = _mm512_sub_epi32(_mm512_cvtepu8_epi32(bytes), zero);
    return half ? _mm512_slli_epi32(v, 19) : requantize(_mm512_slli_epi32(v, 20), s, 0);
}

/* The sum as a line: c a + d b + e with F bits of fraction, c and d in two parts of 15 bits. What
 * the roundings of the reference make of a pair of bytes differs from the line by less than a known
 * distance, so the line gives the same whole number unless it comes so close to where this number
 * changes: unless all of its higher fraction bits are zero. */
struct line {
    __m512i high, low, constant, near, fraction;
};

struct sum_job {
    struct line line;
    struct scale16 a, b, out;
    __m512i zero_a, zero_b;
    struct clamp64 clamp;
};

/* 64 sums; `half_a`: the factor of a is exactly one half, as it is for the input of the larger
 * scale. */
FV_INLINE __m512i sum64(const struct sum_job *j, __m512i a, __m512i b, const int half_a,
                        const int half_b)
{
    const __m512i order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    __m512i r[4];
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++) {
        const __m128i ai = i == 0   ? _mm512_castsi512_si128(a)
                           : i == 1 ? _mm512_extracti32x4_epi32(a, 1)
                           : i == 2 ? _mm512_extracti32x4_epi32(a, 2)
                                    : _mm512_extracti32x4_epi32(a, 3);
        const __m128i bi = i == 0   ? _mm512_castsi512_si128(b)
                           : i == 1 ? _mm512_extracti32x4_epi32(b, 1)
                           : i == 2 ? _mm512_extracti32x4_epi32(b, 2)
                                    : _mm512_extracti32x4_epi32(b, 3);
        const __m512i sum = _mm512_add_epi32(term(ai, j->zero_a, &j->a, half_a),
                                             term(bi, j->zero_b, &j->b, half_b));
        r[i] = requantize(sum, &j->out, 0);
    }
    return _mm512_permutexvar_epi32(order, pack_lanes(r[0], r[1], r[2], r[3], &j->clamp, 0));
}

/* Of m_in and m_out the factor of an input with `bits` bits of fraction, rounded; `inexact`: half a
 * unit, or nothing. -1: out of range. */
static int64_t factor_of(int32_t m_in, int32_t s_in, const struct fv_nn_add *p, int32_t bits,
                         int32_t *inexact)
{
    const int64_t product = (int64_t)m_in * p->m_out;
    const int32_t down = 42 - s_in - p->s_out - bits;
    if (down < 1 || down > 62) return -1;
    *inexact = (product & ((INT64_C(1) << down) - 1)) != 0;
    return (product + (INT64_C(1) << (down - 1))) >> down;
}

static inline int32_t farther(int32_t zero)
{
    return zero > 127 ? zero : 255 - zero;
}

/* Whether there is a line with `bits` bits of fraction that fits 32-bit words. Roundings before the
 * last differ by at most one unit from the real sum, which is 2 2^s_out of a whole number for both
 * inputs together; the two stages of the last one move a half by at most another 2^s_out. */
static int find_line(struct line *l, const struct fv_nn_add *p, int32_t bits)
{
    int32_t inexact_a, inexact_b;
    const int64_t a = factor_of(p->m_a, p->s_a, p, bits, &inexact_a),
                  b = factor_of(p->m_b, p->s_b, p, bits, &inexact_b);
    if (a < 0 || b < 0) return 0;
    const int halves = inexact_a == 0 && inexact_b == 0 && ((a | b) & ((1 << bits) - 1)) != 0;
    if (halves) return 0; /* many sums lie where the number changes */
    const int64_t off = (inexact_a * farther(p->zero_a) + inexact_b * farther(p->zero_b) + 1) / 2 +
                        (INT64_C(3) << (bits + p->s_out)) + 1;
    int32_t near = 1;
    while (INT64_C(1) << near < 2 * off)
        near++;
    const int64_t constant = ((int64_t)p->zero_out << bits) + (INT64_C(1) << (bits - 1)) + off -
                             a * p->zero_a - b * p->zero_b;
    if (near > bits - 4 || 255 * (a + b) + (INT64_C(256) << bits) > INT32_MAX) return 0;
    l->high = _mm512_set1_epi32((int32_t)(b >> 15 << 16 | a >> 15));
    l->low = _mm512_set1_epi32((int32_t)((b & 0x7FFF) << 16 | (a & 0x7FFF)));
    l->constant = _mm512_set1_epi32((int32_t)constant);
    l->near = _mm512_set1_epi32((1 << bits) - (1 << near));
    l->fraction = _mm512_set1_epi32(bits);
    return 1;
}

static int init_line(struct line *l, const struct fv_nn_add *p)
{
    if (p->m_a <= 0 || p->m_b <= 0 || p->m_out <= 0) return 0;
    for (int32_t bits = 22; bits >= 14; --bits) {
        if (bits + p->s_out >= 0 && find_line(l, p, bits)) return 1;
    }
    return 0;
}

/* 64 sums before they are clamped; 0: not sure. */
FV_INLINE int on_line(const struct line *l, __m512i a, __m512i b, __m512i *bytes)
{
    const __m512i none = _mm512_setzero_si512();
    const __m512i low = _mm512_unpacklo_epi8(a, b), high = _mm512_unpackhi_epi8(a, b);
    __m512i v[4] = {_mm512_unpacklo_epi8(low, none), _mm512_unpackhi_epi8(low, none),
                    _mm512_unpacklo_epi8(high, none), _mm512_unpackhi_epi8(high, none)};
    __mmask16 close = 0;
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++) {
        const __m512i coarse = _mm512_slli_epi32(_mm512_madd_epi16(v[i], l->high), 15);
        const __m512i fine = _mm512_add_epi32(_mm512_madd_epi16(v[i], l->low), l->constant);
        v[i] = _mm512_add_epi32(coarse, fine);
        close |= _mm512_testn_epi32_mask(v[i], l->near);
        v[i] = _mm512_srav_epi32(v[i], l->fraction);
    }
    *bytes = _mm512_packus_epi16(_mm512_packs_epi32(v[0], v[1]), _mm512_packs_epi32(v[2], v[3]));
    return close == 0;
}

/* 64 bytes: of one row, or of 64 / count rows. */
FV_INLINE __m512i load_rows(const uint8_t *from, ptrdiff_t stride, int32_t count, __mmask64 mask)
{
    if (count == 16) {
        __m512i v = _mm512_castsi128_si512(_mm_loadu_si128((const __m128i *)(const void *)from));
        v = _mm512_inserti32x4(v, _mm_loadu_si128((const __m128i *)(const void *)(from + stride)),
                               1);
        v = _mm512_inserti32x4(
            v, _mm_loadu_si128((const __m128i *)(const void *)(from + 2 * stride)), 2);
        return _mm512_inserti32x4(
            v, _mm_loadu_si128((const __m128i *)(const void *)(from + 3 * stride)), 3);
    }
    if (count == 32) {
        const __m512i v =
            _mm512_castsi256_si512(_mm256_loadu_si256((const __m256i *)(const void *)from));
        return _mm512_inserti64x4(
            v, _mm256_loadu_si256((const __m256i *)(const void *)(from + stride)), 1);
    }
    return _mm512_maskz_loadu_epi8(mask, from);
}

FV_INLINE void store_rows(uint8_t *to, ptrdiff_t stride, int32_t count, __mmask64 mask, __m512i v)
{
    if (count == 16) {
        _mm_storeu_si128((__m128i *)(void *)to, _mm512_castsi512_si128(v));
        _mm_storeu_si128((__m128i *)(void *)(to + stride), _mm512_extracti32x4_epi32(v, 1));
        _mm_storeu_si128((__m128i *)(void *)(to + 2 * stride), _mm512_extracti32x4_epi32(v, 2));
        _mm_storeu_si128((__m128i *)(void *)(to + 3 * stride), _mm512_extracti32x4_epi32(v, 3));
    } else if (count == 32) {
        _mm256_storeu_si256((__m256i *)(void *)to, _mm512_castsi512_si256(v));
        _mm256_storeu_si256((__m256i *)(void *)(to + stride), _mm512_extracti64x4_epi64(v, 1));
    } else {
        _mm512_mask_storeu_epi8(to, mask, v);
    }
}

struct operands {
    const uint8_t *a, *b;
    uint8_t *out;
    ptrdiff_t lda, ldb, ldo;
    int32_t rows, count;
};

/* 64 sums: by the line where that is sure. */
FV_INLINE __m512i sums_of(const struct sum_job *j, __m512i a, __m512i b, const int half_a,
                          const int half_b, const int line)
{
    __m512i bytes;
    if (line && on_line(&j->line, a, b, &bytes))
        return _mm512_min_epu8(_mm512_max_epu8(bytes, j->clamp.low), j->clamp.high);
    return sum64(j, a, b, half_a, half_b);
}

FV_INLINE void sums(const struct sum_job *j, const struct operands *o, const int half_a,
                    const int half_b, const int line)
{
    const int32_t group = o->count == 16 ? 4 : o->count == 32 ? 2 : 1;
    int32_t r = 0;
    for (; r + group <= o->rows && group > 1; r += group) { /* several short rows at once */
        const __m512i va = load_rows(o->a + r * o->lda, o->lda, o->count, 0),
                      vb = load_rows(o->b + r * o->ldb, o->ldb, o->count, 0);
        store_rows(o->out + r * o->ldo, o->ldo, o->count, 0,
                   sums_of(j, va, vb, half_a, half_b, line));
    }
    for (; r < o->rows; r++) {
        for (int32_t i = 0; i < o->count; i += 64) {
            const __mmask64 mask = first_bytes(o->count - i);
            const __m512i va = _mm512_maskz_loadu_epi8(mask, o->a + r * o->lda + i);
            const __m512i vb = _mm512_maskz_loadu_epi8(mask, o->b + r * o->ldb + i);
            _mm512_mask_storeu_epi8(o->out + r * o->ldo + i, mask,
                                    sums_of(j, va, vb, half_a, half_b, line));
        }
    }
}

void fv_k_nn_add_u8__avx512(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                            const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                            int32_t rows, int32_t count)
{
    const struct operands o = {.a = a,
                               .b = b,
                               .out = out,
                               .lda = lda,
                               .ldb = ldb,
                               .ldo = ldo,
                               .rows = rows,
                               .count = count};
    struct sum_job j = {
        .zero_a = _mm512_set1_epi32(p->zero_a),
        .zero_b = _mm512_set1_epi32(p->zero_b),
        .clamp = clamp_of(p->zero_out, p->act_min, p->act_max),
    };
    load_scale_of(&j.a, _mm512_set1_epi32(p->m_a), _mm512_set1_epi32(p->s_a));
    load_scale_of(&j.b, _mm512_set1_epi32(p->m_b), _mm512_set1_epi32(p->s_b));
    load_scale_of(&j.out, _mm512_set1_epi32(p->m_out), _mm512_set1_epi32(p->s_out));
    if (init_line(&j.line, p))
        sums(&j, &o, 0, 0, 1);
    else if (p->m_a == 1 << 30 && p->s_a == 0)
        sums(&j, &o, 1, 0, 0);
    else if (p->m_b == 1 << 30 && p->s_b == 0)
        sums(&j, &o, 0, 1, 0);
    else
        sums(&j, &o, 0, 0, 0);
}
