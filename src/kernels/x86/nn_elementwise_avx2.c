#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

void fv_k_nn_table_u8__avx2(const uint8_t *table, const uint8_t *in, uint8_t *out, int32_t count)
{
    int32_t i = 0;
    if (count >= 64) { /* below, preparing the table costs more than it saves */
        struct table32 t;
        load_table(&t, table);
        for (; i + 32 <= count; i += 32) {
            const __m256i v = _mm256_loadu_si256((const __m256i *)(const void *)(in + i));
            _mm256_storeu_si256((__m256i *)(void *)(out + i), look_up(&t, v));
        }
    }
    for (; i < count; ++i) out[i] = table[in[i]];
}

void fv_k_nn_max_u8__avx2(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        const __m256i x = _mm256_loadu_si256((const __m256i *)(const void *)(a + i));
        const __m256i y = _mm256_loadu_si256((const __m256i *)(const void *)(b + i));
        _mm256_storeu_si256((__m256i *)(void *)(out + i), _mm256_max_epu8(x, y));
    }
    for (; i < count; ++i) out[i] = a[i] > b[i] ? a[i] : b[i];
}

struct blend {
    __m256i upper, lower, pair, half;
    __m128i shift;
};

FV_INLINE __m256i weigh(const uint8_t *top, const uint8_t *bottom, const struct blend *b)
{
    const __m256i x = _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)top));
    const __m256i y = _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)bottom));
    return _mm256_add_epi16(_mm256_mullo_epi16(x, b->upper), _mm256_mullo_epi16(y, b->lower));
}

/* 16 channels of one output pixel from the columns beside it, in 16-bit then 32-bit arithmetic. */
FV_INLINE __m128i blend16(__m256i left, __m256i right, const struct blend *b)
{
    __m256i low = _mm256_madd_epi16(_mm256_unpacklo_epi16(left, right), b->pair);
    __m256i high = _mm256_madd_epi16(_mm256_unpackhi_epi16(left, right), b->pair);
    low = _mm256_srl_epi32(_mm256_add_epi32(low, b->half), b->shift);
    high = _mm256_srl_epi32(_mm256_add_epi32(high, b->half), b->shift);
    const __m256i words = _mm256_packus_epi32(low, high);
    return _mm_packus_epi16(_mm256_castsi256_si128(words), _mm256_extracti128_si256(words, 1));
}

void fv_k_nn_blend_u8__avx2(const struct fv_nn_blend *p, const uint8_t *top, const uint8_t *bottom, int32_t weight, uint8_t *out)
{
    const int32_t one = 1 << p->bits;
    struct blend b = {.upper = _mm256_set1_epi16((short)(one - weight)), .lower = _mm256_set1_epi16((short)weight),
                      .half = _mm256_set1_epi32((1 << 2 * p->bits) >> 1), .shift = _mm_cvtsi32_si128(2 * p->bits)};
    for (int32_t x = 0; x < p->out_w; ++x, out += p->out_stride) {
        const int32_t *entry = p->columns + (ptrdiff_t)3 * x;
        const ptrdiff_t left = (ptrdiff_t)entry[0] * p->in_stride, right = (ptrdiff_t)entry[1] * p->in_stride;
        b.pair = _mm256_set1_epi32((int32_t)((uint32_t)entry[2] << 16 | (uint32_t)(one - entry[2])));
        for (int32_t c = 0; c < p->channels; c += 16) {
            const __m256i sides[2] = {weigh(top + left + c, bottom + left + c, &b), weigh(top + right + c, bottom + right + c, &b)};
            store_some(out + c, blend16(sides[0], sides[1], &b), p->channels - c < 16 ? p->channels - c : 16);
        }
    }
}
