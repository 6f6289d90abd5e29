/* Element-wise differences, products and PRELU of bytes. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

enum function { SUB, MUL, PRELU };

struct job {
    struct scale8 a, b, out;
    __m256i zero_a, zero_b;
    struct output output;
};

static void init_scale(struct scale8 *s, int32_t multiplier, int32_t shift)
{
    load_scale(s, _mm256_set1_epi32(multiplier), _mm256_set1_epi32(shift));
}

static void init(struct job *j, const struct fv_nn_add *p, const enum function function)
{
    j->zero_a = _mm256_set1_epi32(p->zero_a);
    j->zero_b = _mm256_set1_epi32(p->zero_b);
    if (function != MUL) init_scale(&j->a, p->m_a, p->s_a);
    if (function == SUB) init_scale(&j->b, p->m_b, p->s_b);
    init_scale(&j->out, p->m_out, p->s_out);
    init_output(&j->output, p->zero_out, p->act_min, p->act_max, NULL);
}

FV_INLINE __m256i load8(const uint8_t *from, __m256i zero)
{
    return _mm256_sub_epi32(
        _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)from)), zero);
}

/* Eight results in requantize's order, which swaps the inner ones of each four; what goes through
 * it twice or is blended with it is swapped before. */
FV_INLINE __m256i eight(const struct job *j, const uint8_t *a, const uint8_t *b,
                        const enum function function)
{
    const __m256i x = load8(a, j->zero_a), y = load8(b, j->zero_b);
    if (function == SUB) {
        const __m256i u = requantize(_mm256_slli_epi32(x, 20), &j->a, 0),
                      v = requantize(_mm256_slli_epi32(y, 20), &j->b, 0);
        return requantize(_mm256_shuffle_epi32(_mm256_sub_epi32(u, v), 0xD8), &j->out, 0);
    }
    const __m256i product = requantize(_mm256_mullo_epi32(x, y), &j->out, 0);
    if (function == MUL) return product;
    const __m256i negative = _mm256_shuffle_epi32(_mm256_srai_epi32(x, 31), 0xD8);
    return _mm256_blendv_epi8(requantize(x, &j->a, 0), product, negative);
}

FV_INLINE __m256i many(const struct job *j, const uint8_t *a, const uint8_t *b,
                       const enum function function)
{
    const __m256i first[2] = {eight(j, a, b, function), eight(j, a + 8, b + 8, function)};
    const __m256i second[2] = {eight(j, a + 16, b + 16, function),
                               eight(j, a + 24, b + 24, function)};
    return two_rows(&j->output, first, second, 0);
}

FV_INLINE void binary(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b,
                      ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count,
                      const enum function function)
{
    struct job j;
    init(&j, p, function);
    for (int32_t r = 0; r < rows; r++, a += lda, b += ldb, out += ldo) {
        int32_t i = 0;
        for (; i + 32 <= count; i += 32)
            _mm256_storeu_si256((__m256i *)(void *)(out + i), many(&j, a + i, b + i, function));
        if (i == count) continue;
        uint8_t rest_a[32] = {0}, rest_b[32] = {0}, results[32];
        memcpy(rest_a, a + i, (size_t)(count - i));
        memcpy(rest_b, b + i, (size_t)(count - i));
        _mm256_storeu_si256((__m256i *)(void *)results, many(&j, rest_a, rest_b, function));
        memcpy(out + i, results, (size_t)(count - i));
    }
}

void fv_k_nn_sub_u8__avx2(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    binary(p, a, lda, b, ldb, out, ldo, rows, count, SUB);
}

void fv_k_nn_mul_u8__avx2(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    binary(p, a, lda, b, ldb, out, ldo, rows, count, MUL);
}

void fv_k_nn_prelu_u8__avx2(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                            const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                            int32_t rows, int32_t count)
{
    binary(p, a, lda, b, ldb, out, ldo, rows, count, PRELU);
}
