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

FV_INLINE __m256i term(const uint8_t *from, __m256i zero, const struct scale8 *s)
{
    const __m256i v = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from));
    return requantize(_mm256_slli_epi32(_mm256_sub_epi32(v, zero), 20), s, 0);
}

FV_INLINE __m256i sum8(const struct sum_job *j, const uint8_t *a, const uint8_t *b)
{
    const __m256i sum = _mm256_add_epi32(term(a, j->zero_a, &j->a), term(b, j->zero_b, &j->b));
    return requantize(_mm256_shuffle_epi32(sum, 0xD8), &j->out, 0);
}

/* 16 sums of each of two places. */
FV_INLINE __m256i sum32(const struct sum_job *j, const uint8_t *a, const uint8_t *b, ptrdiff_t next_a, ptrdiff_t next_b,
                        const struct output *o)
{
    const __m256i first[2] = {sum8(j, a, b), sum8(j, a + 8, b + 8)};
    const __m256i second[2] = {sum8(j, a + next_a, b + next_b), sum8(j, a + next_a + 8, b + next_b + 8)};
    return two_rows(o, first, second);
}

/* Fewer than 32 bytes of a row. */
static void sum_rest(const struct sum_job *j, const uint8_t *a, const uint8_t *b, int32_t count, const struct output *o, uint8_t *out)
{
    uint8_t rest_a[32] = {0}, rest_b[32] = {0}, sums[32];
    memcpy(rest_a, a, (size_t)count);
    memcpy(rest_b, b, (size_t)count);
    _mm256_storeu_si256((__m256i *)(void *)sums, sum32(j, rest_a, rest_b, 16, 16, o));
    memcpy(out, sums, (size_t)count);
}

void fv_k_nn_add_u8__avx2(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b, ptrdiff_t ldb, uint8_t *out,
                          ptrdiff_t ldo, int32_t rows, int32_t count)
{
    struct sum_job j = {.zero_a = _mm256_set1_epi32(p->zero_a), .zero_b = _mm256_set1_epi32(p->zero_b)};
    struct output o;
    init_scale(&j.a, p->m_a, p->s_a);
    init_scale(&j.b, p->m_b, p->s_b);
    init_scale(&j.out, p->m_out, p->s_out);
    init_output(&o, p->zero_out, p->act_min, p->act_max, NULL);
    for (int32_t r = 0; r < rows; ++r, a += lda, b += ldb, out += ldo) {
        int32_t i = 0;
        for (; i + 32 <= count; i += 32) {
            _mm256_storeu_si256((__m256i *)(void *)(out + i), sum32(&j, a + i, b + i, 16, 16, &o));
        }
        if (i < count) sum_rest(&j, a + i, b + i, count - i, &o, out + i);
    }
}
