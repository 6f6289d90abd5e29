#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

/* One input of a sum: 16 bytes to 32-bit lanes, moved by 20 bits, scaled. */
FV_INLINE __m512i term(__m128i bytes, __m512i zero, const struct scale16 *s, const int half)
{
    const __m512i v = _mm512_sub_epi32(_mm512_cvtepu8_epi32(bytes), zero);
    return half ? _mm512_slli_epi32(v, 19) : requantize(_mm512_slli_epi32(v, 20), s, 0);
}

struct sum_job {
    struct scale16 a, b, out;
    __m512i zero_a, zero_b, zero_out, low, high;
};

/* 64 sums; `half_a`: the factor of a is exactly one half, as it is for the input of the larger scale. */
FV_INLINE __m512i sum64(const struct sum_job *j, __m512i a, __m512i b, const int half_a, const int half_b)
{
    const __m512i order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    __m512i r[4];
#pragma GCC unroll 4
    for (int i = 0; i < 4; ++i) {
        const __m128i ai = i == 0 ? _mm512_castsi512_si128(a) : i == 1 ? _mm512_extracti32x4_epi32(a, 1)
                         : i == 2 ? _mm512_extracti32x4_epi32(a, 2) : _mm512_extracti32x4_epi32(a, 3);
        const __m128i bi = i == 0 ? _mm512_castsi512_si128(b) : i == 1 ? _mm512_extracti32x4_epi32(b, 1)
                         : i == 2 ? _mm512_extracti32x4_epi32(b, 2) : _mm512_extracti32x4_epi32(b, 3);
        const __m512i sum = _mm512_add_epi32(term(ai, j->zero_a, &j->a, half_a), term(bi, j->zero_b, &j->b, half_b));
        r[i] = requantize(sum, &j->out, 0);
    }
    return _mm512_permutexvar_epi32(order, pack_lanes(r[0], r[1], r[2], r[3], j->zero_out, j->low, j->high));
}

FV_INLINE void sums(const struct sum_job *j, const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count, const int half_a,
                    const int half_b)
{
    for (int32_t i = 0; i < count; i += 64) {
        const __mmask64 mask = count - i >= 64 ? ~UINT64_C(0) : ~UINT64_C(0) >> (64 - (count - i));
        const __m512i va = _mm512_maskz_loadu_epi8(mask, a + i), vb = _mm512_maskz_loadu_epi8(mask, b + i);
        _mm512_mask_storeu_epi8(out + i, mask, sum64(j, va, vb, half_a, half_b));
    }
}

void fv_k_nn_add_u8__avx512(const struct fv_nn_add *p, const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    struct sum_job j = {
        .zero_a = _mm512_set1_epi32(p->zero_a),
        .zero_b = _mm512_set1_epi32(p->zero_b),
        .zero_out = _mm512_set1_epi16((short)p->zero_out),
        .low = _mm512_set1_epi8((char)p->act_min),
        .high = _mm512_set1_epi8((char)p->act_max),
    };
    load_scale_of(&j.a, _mm512_set1_epi32(p->m_a), _mm512_set1_epi32(p->s_a));
    load_scale_of(&j.b, _mm512_set1_epi32(p->m_b), _mm512_set1_epi32(p->s_b));
    load_scale_of(&j.out, _mm512_set1_epi32(p->m_out), _mm512_set1_epi32(p->s_out));
    if (p->m_a == 1 << 30 && p->s_a == 0) sums(&j, a, b, out, count, 1, 0);
    else if (p->m_b == 1 << 30 && p->s_b == 0) sums(&j, a, b, out, count, 0, 1);
    else sums(&j, a, b, out, count, 0, 0);
}

void fv_k_nn_max_u8__avx512(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; i += 64) {
        const __mmask64 mask = count - i >= 64 ? ~UINT64_C(0) : ~UINT64_C(0) >> (64 - (count - i));
        _mm512_mask_storeu_epi8(out + i, mask, _mm512_max_epu8(_mm512_maskz_loadu_epi8(mask, a + i), _mm512_maskz_loadu_epi8(mask, b + i)));
    }
}
