#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

struct sum_job {
    struct scale8 a, b, out;
    __m256i zero_a, zero_b;
};

static void init_scale(struct scale8 *s, int32_t multiplier, int32_t shift)
{
    load_scale(s, _mm256_set1_epi32(multiplier), _mm256_set1_epi32(shift));
}

/* One input of a sum, with the channels of each lane in the order 0 2 1 3. `half`: its factor is
 * exactly one half. */
FV_INLINE __m256i term(const uint8_t *from, __m256i zero, const struct scale8 *s, const int half)
{
    const __m256i v = _mm256_sub_epi32(
        _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from)), zero);
    if (half) return _mm256_shuffle_epi32(_mm256_slli_epi32(v, 19), 0xD8);
    return requantize(_mm256_slli_epi32(v, 20), s, 0);
}

/* Eight sums in requantize's order, which swaps the inner ones of each four: they are swapped back
 * before. */
FV_INLINE __m256i sum8(const struct sum_job *j, const uint8_t *a, const uint8_t *b,
                       const int half_a, const int half_b)
{
    const __m256i sum =
        _mm256_add_epi32(term(a, j->zero_a, &j->a, half_a), term(b, j->zero_b, &j->b, half_b));
    return requantize(_mm256_shuffle_epi32(sum, 0xD8), &j->out, 0);
}

FV_INLINE __m256i sum32(const struct sum_job *j, const uint8_t *a, const uint8_t *b,
                        const struct output *o, const int half_a, const int half_b)
{
    const __m256i first[2] = {sum8(j, a, b, half_a, half_b), sum8(j, a + 8, b + 8, half_a, half_b)};
    const __m256i second[2] = {sum8(j, a + 16, b + 16, half_a, half_b),
                               sum8(j, a + 24, b + 24, half_a, half_b)};
    return two_rows(o, first, second, 0);
}

FV_INLINE void sum_row(const struct sum_job *j, const uint8_t *a, const uint8_t *b, int32_t count,
                       const struct output *o, uint8_t *out, const int half_a, const int half_b)
{
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        _mm256_storeu_si256((__m256i *)(void *)(out + i),
                            sum32(j, a + i, b + i, o, half_a, half_b));
    }
    if (i < count) {
        uint8_t rest_a[32] = {0}, rest_b[32] = {0}, sums[32];
        memcpy(rest_a, a + i, (size_t)(count - i));
        memcpy(rest_b, b + i, (size_t)(count - i));
        _mm256_storeu_si256((__m256i *)(void *)sums, sum32(j, rest_a, rest_b, o, half_a, half_b));
        memcpy(out + i, sums, (size_t)(count - i));
    }
}

void fv_k_nn_add_u8__avx2(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    struct sum_job j = {.zero_a = _mm256_set1_epi32(p->zero_a),
                        .zero_b = _mm256_set1_epi32(p->zero_b)};
    struct output o;
    init_scale(&j.a, p->m_a, p->s_a);
    init_scale(&j.b, p->m_b, p->s_b);
    init_scale(&j.out, p->m_out, p->s_out);
    init_output(&o, p->zero_out, p->act_min, p->act_max, NULL);
    /* the input of the larger scale has the factor one half */
    const int half_a = p->m_a == 1 << 30 && p->s_a == 0, half_b = p->m_b == 1 << 30 && p->s_b == 0;
    for (int32_t r = 0; r < rows; ++r, a += lda, b += ldb, out += ldo) {
        if (half_a)
            sum_row(&j, a, b, count, &o, out, 1, 0);
        else if (half_b)
            sum_row(&j, a, b, count, &o, out, 0, 1);
        else
            sum_row(&j, a, b, count, &o, out, 0, 0);
    }
}
