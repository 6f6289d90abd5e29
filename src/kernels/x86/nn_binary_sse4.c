/* Element-wise differences, products and PRELU of bytes. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

enum function { SUB, MUL, PRELU };

struct job {
    struct scale4 a, b, out;
    __m128i zero_a, zero_b;
    struct output output;
};

static void init_scale(struct scale4 *s, int32_t multiplier, int32_t shift)
{
    const int32_t multipliers[4] = {multiplier, multiplier, multiplier, multiplier},
                  shifts[4] = {shift, shift, shift, shift};
    load_scale(s, multipliers, shifts);
}

static void init(struct job *j, const struct fv_nn_add *p, const enum function function)
{
    j->zero_a = _mm_set1_epi32(p->zero_a);
    j->zero_b = _mm_set1_epi32(p->zero_b);
    if (function != MUL) init_scale(&j->a, p->m_a, p->s_a);
    if (function == SUB) init_scale(&j->b, p->m_b, p->s_b);
    init_scale(&j->out, p->m_out, p->s_out);
    init_output(&j->output, p->zero_out, p->act_min, p->act_max, NULL);
}

/* The results of bytes 0 to 3. */
FV_INLINE __m128i four(const struct job *j, __m128i a, __m128i b, const enum function function)
{
    const __m128i x = _mm_sub_epi32(_mm_cvtepu8_epi32(a), j->zero_a),
                  y = _mm_sub_epi32(_mm_cvtepu8_epi32(b), j->zero_b);
    if (function == SUB) {
        const __m128i u = requantize_as(_mm_slli_epi32(x, 20), &j->a, 1, 0),
                      v = requantize_as(_mm_slli_epi32(y, 20), &j->b, 1, 0);
        return requantize_as(_mm_sub_epi32(u, v), &j->out, 1, 0);
    }
    const __m128i product = requantize_as(_mm_mullo_epi32(x, y), &j->out, 1, 0);
    if (function == MUL) return product;
    return _mm_blendv_epi8(requantize_as(x, &j->a, 1, 0), product, _mm_srai_epi32(x, 31));
}

FV_INLINE __m128i sixteen(const struct job *j, const uint8_t *from_a, const uint8_t *from_b,
                          const enum function function)
{
    const __m128i a = load16(from_a), b = load16(from_b);
    return to_bytes(&j->output, four(j, a, b, function),
                    four(j, _mm_srli_si128(a, 4), _mm_srli_si128(b, 4), function),
                    four(j, _mm_srli_si128(a, 8), _mm_srli_si128(b, 8), function),
                    four(j, _mm_srli_si128(a, 12), _mm_srli_si128(b, 12), function));
}

FV_INLINE void binary(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda, const uint8_t *b,
                      ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count,
                      const enum function function)
{
    struct job j;
    init(&j, p, function);
    for (int32_t r = 0; r < rows; r++, a += lda, b += ldb, out += ldo) {
        int32_t i = 0;
        for (; i + 16 <= count; i += 16)
            store_bytes(&j.output, out + i, sixteen(&j, a + i, b + i, function), 16);
        if (i == count) continue;
        uint8_t rest_a[16] = {0}, rest_b[16] = {0};
        memcpy(rest_a, a + i, (size_t)(count - i));
        memcpy(rest_b, b + i, (size_t)(count - i));
        store_bytes(&j.output, out + i, sixteen(&j, rest_a, rest_b, function), count - i);
    }
}

void fv_k_nn_sub_u8__sse4(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    binary(p, a, lda, b, ldb, out, ldo, rows, count, SUB);
}

void fv_k_nn_mul_u8__sse4(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                          const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                          int32_t rows, int32_t count)
{
    binary(p, a, lda, b, ldb, out, ldo, rows, count, MUL);
}

void fv_k_nn_prelu_u8__sse4(const struct fv_nn_add *p, const uint8_t *a, ptrdiff_t lda,
                            const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                            int32_t rows, int32_t count)
{
    binary(p, a, lda, b, ldb, out, ldo, rows, count, PRELU);
}
