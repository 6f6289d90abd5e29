#define FV_NAME(kernel) fv_k_##kernel##__avx512
#include "kernels/filter_loops.h"

#include <immintrin.h>

/* Sums down the columns, less 32768. */
static inline void gauss_columns(uint16_t *column, const uint8_t *const *rows, int32_t width,
                                 const uint16_t *weights, int32_t radius)
{
    const uint8_t *row[2 * FV_GAUSS_RADIUS_MAX + 1];
    for (int32_t i = 0; i <= 2 * radius; i++)
        row[i] = rows[i];
    for (int32_t x = 0; x < width; x++) {
        uint16_t sum = (uint16_t)(weights[0] * row[radius][x] + 32768u);
        for (int32_t i = 1; i <= radius; i++)
            sum =
                (uint16_t)(sum + weights[i] * (uint16_t)(row[radius - i][x] + row[radius + i][x]));
        column[x] = sum;
    }
    for (int32_t i = 1; i <= radius; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
}

/* Weights of the pairs (x - radius, x - radius + 1), (x - radius + 2, ...), ... for outputs at even
 * and at odd places of a vector, which both read the pairs that begin at even places. */
struct gauss_pairs {
    __m512i even[4], odd[4];
};

static inline int32_t gauss_weight(const uint16_t *weights, int32_t radius, int32_t tap)
{
    const int32_t distance = tap < radius ? radius - tap : tap - radius;
    return tap < 0 || distance > radius ? 0 : weights[distance];
}

static inline void gauss_pairs_make(struct gauss_pairs *pairs, const uint16_t *weights,
                                    int32_t radius)
{
    for (int32_t k = 0; k <= radius; k++) {
        pairs->even[k] = _mm512_set1_epi32(gauss_weight(weights, radius, 2 * k + 1) << 16 |
                                           gauss_weight(weights, radius, 2 * k));
        pairs->odd[k] = _mm512_set1_epi32(gauss_weight(weights, radius, 2 * k) << 16 |
                                          gauss_weight(weights, radius, 2 * k - 1));
    }
}

static inline __m512i gauss_thirty_two(const uint16_t *column, const struct gauss_pairs *pairs,
                                       int32_t radius)
{
    const __m512i bias = _mm512_set1_epi32(256 * 32768 + 32768);
    __m512i even = bias, odd = bias;
    for (int32_t k = 0; k <= radius; k++) {
        const __m512i c = _mm512_loadu_si512(column - radius + 2 * k);
        even = _mm512_add_epi32(even, _mm512_madd_epi16(c, pairs->even[k]));
        odd = _mm512_add_epi32(odd, _mm512_madd_epi16(c, pairs->odd[k]));
    }
    return _mm512_mask_blend_epi16(0xaaaaaaaau, _mm512_srli_epi32(even, 16), odd);
}

static inline void gauss_row(uint8_t *out, const uint8_t *const *rows, int32_t width,
                             const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    uint16_t *column = scratch + 16;
    struct gauss_pairs pairs;
    gauss_columns(column, rows, width, weights, radius);
    gauss_pairs_make(&pairs, weights, radius);
    for (int32_t x = 0; x < width; x += 32) {
        const __mmask32 mask = width - x >= 32 ? 0xffffffffu : (1u << (width - x)) - 1u;
        _mm512_mask_cvtepi16_storeu_epi8(out + x, mask,
                                         gauss_thirty_two(column + x, &pairs, radius));
    }
}

void fv_k_gauss_row_u8__avx512(uint8_t *out, const uint8_t *const *rows, int32_t width,
                               const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    if (radius == 1)
        gauss_row(out, rows, width, weights, 1, scratch);
    else if (radius == 2)
        gauss_row(out, rows, width, weights, 2, scratch);
    else
        gauss_row(out, rows, width, weights, 3, scratch);
}

/* One of 256 words for each of 32 indices: 64 at a time, chosen by the two upper bits. */
static inline __m512i table_words(__m512i index, const __m512i part[8], __mmask32 bit6,
                                  __mmask32 bit7)
{
    const __m512i lower =
        _mm512_mask_mov_epi16(_mm512_permutex2var_epi16(part[0], index, part[1]), bit6,
                              _mm512_permutex2var_epi16(part[2], index, part[3]));
    const __m512i upper =
        _mm512_mask_mov_epi16(_mm512_permutex2var_epi16(part[4], index, part[5]), bit6,
                              _mm512_permutex2var_epi16(part[6], index, part[7]));
    return _mm512_mask_mov_epi16(lower, bit7, upper);
}

static inline __m128i contrast_sixteen(__m256i left, __m256i right, __m256i weight)
{
    const __m512i a = _mm512_cvtepu16_epi32(left), b = _mm512_cvtepu16_epi32(right);
    const __m512i moved = _mm512_mullo_epi32(_mm512_sub_epi32(b, a), _mm512_cvtepu16_epi32(weight));
    const __m512i sum =
        _mm512_add_epi32(_mm512_slli_epi32(a, FV_CONTRAST_BITS),
                         _mm512_add_epi32(moved, _mm512_set1_epi32(1 << (FV_CONTRAST_BITS + 7))));
    return _mm512_cvtepi32_epi8(_mm512_srli_epi32(sum, FV_CONTRAST_BITS + 8));
}

void fv_k_contrast_row_u8__avx512(uint8_t *out, const uint8_t *in, int32_t count,
                                  const uint16_t left[256], const uint16_t right[256],
                                  const uint16_t *weights)
{
    __m512i a[8], b[8];
    for (int i = 0; i < 8; i++) {
        a[i] = _mm512_loadu_si512(left + 32 * i);
        b[i] = _mm512_loadu_si512(right + 32 * i);
    }
    for (int32_t i = 0; i < count; i += 32) {
        const __mmask32 mask = count - i >= 32 ? 0xffffffffu : (1u << (count - i)) - 1u;
        const __m512i index = _mm512_cvtepu8_epi16(_mm256_maskz_loadu_epi8(mask, in + i));
        const __m512i weight = _mm512_maskz_loadu_epi16(mask, weights + i);
        const __mmask32 bit6 = _mm512_test_epi16_mask(index, _mm512_set1_epi16(64));
        const __mmask32 bit7 = _mm512_test_epi16_mask(index, _mm512_set1_epi16(128));
        const __m512i l = table_words(index, a, bit6, bit7), r = table_words(index, b, bit6, bit7);
        const __m128i low = contrast_sixteen(_mm512_castsi512_si256(l), _mm512_castsi512_si256(r),
                                             _mm512_castsi512_si256(weight));
        const __m128i high =
            contrast_sixteen(_mm512_extracti64x4_epi64(l, 1), _mm512_extracti64x4_epi64(r, 1),
                             _mm512_extracti64x4_epi64(weight, 1));
        _mm256_mask_storeu_epi8(out + i, mask, _mm256_set_m128i(high, low));
    }
}
