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
    for (; i < count; i++)
        out[i] = table[in[i]];
}

void fv_k_nn_max_u8__avx2(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        const __m256i x = _mm256_loadu_si256((const __m256i *)(const void *)(a + i));
        const __m256i y = _mm256_loadu_si256((const __m256i *)(const void *)(b + i));
        _mm256_storeu_si256((__m256i *)(void *)(out + i), _mm256_max_epu8(x, y));
    }
    for (; i < count; i++)
        out[i] = a[i] > b[i] ? a[i] : b[i];
}

void fv_k_nn_min_u8__avx2(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count)
{
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        const __m256i x = _mm256_loadu_si256((const __m256i *)(const void *)(a + i));
        const __m256i y = _mm256_loadu_si256((const __m256i *)(const void *)(b + i));
        _mm256_storeu_si256((__m256i *)(void *)(out + i), _mm256_min_epu8(x, y));
    }
    for (; i < count; i++)
        out[i] = a[i] < b[i] ? a[i] : b[i];
}

struct blend {
    __m256i upper, lower, half, middle;
    __m256i rows, left,
        right; /* of more than 7 bits: of the two rows beside each other, of each column */
    __m128i shift;
};

FV_INLINE __m256i load16(const uint8_t *from)
{
    return _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)from));
}

FV_INLINE __m256i weigh(const uint8_t *top, const uint8_t *bottom, const struct blend *b)
{
    return _mm256_add_epi16(_mm256_mullo_epi16(load16(top), b->upper),
                            _mm256_mullo_epi16(load16(bottom), b->lower));
}

/* 16 channels of one output pixel: low and high four of each lane in turn. `is_moved`: whether
 * there are values below the middle, whose halves are rounded down. */
FV_INLINE __m128i round16(__m256i low, __m256i high, const struct blend *b, const int is_moved)
{
    if (is_moved) {
        low = _mm256_add_epi32(low, _mm256_cmpgt_epi32(b->middle, low));
        high = _mm256_add_epi32(high, _mm256_cmpgt_epi32(b->middle, high));
    }
    low = _mm256_add_epi32(low, b->half);
    high = _mm256_add_epi32(high, b->half);
    const __m256i words =
        _mm256_packus_epi32(_mm256_srl_epi32(low, b->shift), _mm256_srl_epi32(high, b->shift));
    return _mm_packus_epi16(_mm256_castsi256_si128(words), _mm256_extracti128_si256(words, 1));
}

/* From the four corners in 32-bit arithmetic, for weights of more than 7 bits. */
FV_INLINE __m128i blend16_wide(const uint8_t *const corner[4], ptrdiff_t c, const struct blend *b)
{
    __m256i v[4];
    for (int i = 0; i < 4; i++)
        v[i] = load16(corner[i] + c);
    const __m256i low_left = _mm256_madd_epi16(_mm256_unpacklo_epi16(v[0], v[1]), b->rows);
    const __m256i low_right = _mm256_madd_epi16(_mm256_unpacklo_epi16(v[2], v[3]), b->rows);
    const __m256i high_left = _mm256_madd_epi16(_mm256_unpackhi_epi16(v[0], v[1]), b->rows);
    const __m256i high_right = _mm256_madd_epi16(_mm256_unpackhi_epi16(v[2], v[3]), b->rows);
    return round16(_mm256_add_epi32(_mm256_mullo_epi32(low_left, b->left),
                                    _mm256_mullo_epi32(low_right, b->right)),
                   _mm256_add_epi32(_mm256_mullo_epi32(high_left, b->left),
                                    _mm256_mullo_epi32(high_right, b->right)),
                   b, 1);
}

/* Two 16-bit weights beside each other. */
FV_INLINE __m256i pair_of(int32_t first, int32_t second)
{
    return _mm256_set1_epi32((int32_t)((uint32_t)second << 16 | (uint32_t)first));
}

/* 16 channels from c on of all pixels with weights of at most 7 bits, in 16-bit then 32-bit
 * arithmetic. The sum of two rows serves all outputs between the same columns. */
FV_INLINE void blend_narrow(const struct fv_nn_blend *p, const struct blend *b, const uint8_t *top,
                            const uint8_t *bottom, int32_t c, uint8_t *out, const int is_moved)
{
    const int32_t one = 1 << p->bits, width = p->channels - c < 16 ? p->channels - c : 16;
    const int32_t *entry = p->columns;
    __m256i low = _mm256_setzero_si256(), high = low;
    int32_t left = -1, right = -1;
    for (int32_t x = 0; x < p->out_w; x++, entry += 3, out += p->out_stride) {
        if (entry[0] != left || entry[1] != right) {
            left = entry[0];
            right = entry[1];
            const ptrdiff_t at = (ptrdiff_t)left * p->in_stride + c,
                            beside = (ptrdiff_t)right * p->in_stride + c;
            const __m256i first = weigh(top + at, bottom + at, b),
                          second = weigh(top + beside, bottom + beside, b);
            low = _mm256_unpacklo_epi16(first, second);
            high = _mm256_unpackhi_epi16(first, second);
        }
        const __m256i pair = pair_of(one - entry[2], entry[2]);
        const __m128i v =
            round16(_mm256_madd_epi16(low, pair), _mm256_madd_epi16(high, pair), b, is_moved);
        store_some(out + c, v, width);
    }
}

void fv_k_nn_blend_u8__avx2(const struct fv_nn_blend *p, const uint8_t *top, const uint8_t *bottom,
                            int32_t weight, uint8_t *out)
{
    const int32_t one = 1 << p->bits;
    struct blend b = {.upper = _mm256_set1_epi16((short)(one - weight)),
                      .lower = _mm256_set1_epi16((short)weight),
                      .half = _mm256_set1_epi32((1 << 2 * p->bits) >> 1),
                      .shift = _mm_cvtsi32_si128(2 * p->bits),
                      .middle = _mm256_set1_epi32(p->bits == 0 ? 0 : p->middle << 2 * p->bits),
                      .rows = pair_of(one - weight, weight)};
    for (int32_t c = 0; c < p->channels && p->bits <= 7; c += 16) {
        if (p->middle == 0)
            blend_narrow(p, &b, top, bottom, c, out, 0);
        else
            blend_narrow(p, &b, top, bottom, c, out, 1);
    }
    for (int32_t x = 0; x < p->out_w && p->bits > 7; x++, out += p->out_stride) {
        const int32_t *entry = p->columns + (ptrdiff_t)3 * x;
        const ptrdiff_t left = (ptrdiff_t)entry[0] * p->in_stride,
                        right = (ptrdiff_t)entry[1] * p->in_stride;
        const uint8_t *const corner[4] = {top + left, bottom + left, top + right, bottom + right};
        b.left = _mm256_set1_epi32(one - entry[2]);
        b.right = _mm256_set1_epi32(entry[2]);
        for (int32_t c = 0; c < p->channels; c += 16) {
            store_some(out + c, blend16_wide(corner, c, &b),
                       p->channels - c < 16 ? p->channels - c : 16);
        }
    }
}
