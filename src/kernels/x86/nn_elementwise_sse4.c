/* Element-wise sums of bytes: both inputs to one scale, added, to the output's. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

struct sum_job {
    struct scale4 a, b, out;
    __m128i zero_a, zero_b;
};

static void init_scale(struct scale4 *s, int32_t multiplier, int32_t shift)
{
    const int32_t multipliers[4] = {multiplier, multiplier, multiplier, multiplier},
                  shifts[4] = {shift, shift, shift, shift};
    load_scale(s, multipliers, shifts);
}

/* One input. `half`: its factor is exactly one half. */
FV_INLINE __m128i term(__m128i v, __m128i zero, const struct scale4 *s, const int half)
{
    v = _mm_sub_epi32(_mm_cvtepu8_epi32(v), zero);
    return half ? _mm_slli_epi32(v, 19) : requantize_as(_mm_slli_epi32(v, 20), s, 1, 0);
}

/* The sum of bytes 0 to 3. */
FV_INLINE __m128i sum4(const struct sum_job *j, __m128i a, __m128i b, const int half_a,
                       const int half_b)
{
    const __m128i sum =
        _mm_add_epi32(term(a, j->zero_a, &j->a, half_a), term(b, j->zero_b, &j->b, half_b));
    return requantize_as(sum, &j->out, 1, 0);
}

FV_INLINE __m128i sum16(const struct sum_job *j, const uint8_t *from_a, const uint8_t *from_b,
                        const struct output *o, const int half_a, const int half_b)
{
    const __m128i a = load16(from_a), b = load16(from_b);
    return to_bytes(o, sum4(j, a, b, half_a, half_b),
                    sum4(j, _mm_srli_si128(a, 4), _mm_srli_si128(b, 4), half_a, half_b),
                    sum4(j, _mm_srli_si128(a, 8), _mm_srli_si128(b, 8), half_a, half_b),
                    sum4(j, _mm_srli_si128(a, 12), _mm_srli_si128(b, 12), half_a, half_b));
}

FV_INLINE void sum_row(const struct sum_job *j, const uint8_t *a, const uint8_t *b, int32_t count,
                       const struct output *o, uint8_t *out, const int half_a, const int half_b)
{
    int32_t i = 0;
    for (; i + 16 <= count; i += 16)
        store_bytes(o, out + i, sum16(j, a + i, b + i, o, half_a, half_b), 16);
    if (i < count) {
        uint8_t rest_a[16] = {0}, rest_b[16] = {0};
        memcpy(rest_a, a + i, (size_t)(count - i));
        memcpy(rest_b, b + i, (size_t)(count - i));
        store_bytes(o, out + i, sum16(j, rest_a, rest_b, o, half_a, half_b), count - i);
    }
}

void fv_k_nn_add_u8__sse4(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    struct sum_job j = {.zero_a = _mm_set1_epi32(p->zero_a), .zero_b = _mm_set1_epi32(p->zero_b)};
    struct output o;
    init_scale(&j.a, p->m_a, p->s_a);
    init_scale(&j.b, p->m_b, p->s_b);
    init_scale(&j.out, p->m_out, p->s_out);
    init_output(&o, p->zero_out, p->act_min, p->act_max, NULL);
    /* the input of the larger scale has the factor one half */
    const int half_a = p->m_a == 1 << 30 && p->s_a == 0, half_b = p->m_b == 1 << 30 && p->s_b == 0;
    for (int32_t r = 0; r < rows; r++, a += lda, b += ldb, out += ldo) {
        if (half_a)
            sum_row(&j, a, b, count, &o, out, 1, 0);
        else if (half_b)
            sum_row(&j, a, b, count, &o, out, 0, 1);
        else
            sum_row(&j, a, b, count, &o, out, 0, 0);
    }
}
