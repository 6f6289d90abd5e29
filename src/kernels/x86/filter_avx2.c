#define FV_NAME(kernel) fv_k_##kernel##__avx2
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
    __m256i even[4], odd[4];
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
        pairs->even[k] = _mm256_set1_epi32(gauss_weight(weights, radius, 2 * k + 1) << 16 |
                                           gauss_weight(weights, radius, 2 * k));
        pairs->odd[k] = _mm256_set1_epi32(gauss_weight(weights, radius, 2 * k) << 16 |
                                          gauss_weight(weights, radius, 2 * k - 1));
    }
}

static inline __m256i gauss_sixteen(const uint16_t *column, const struct gauss_pairs *pairs,
                                    int32_t radius)
{
    const __m256i bias = _mm256_set1_epi32(256 * 32768 + 32768);
    __m256i even = bias, odd = bias;
    for (int32_t k = 0; k <= radius; k++) {
        const __m256i c = _mm256_loadu_si256((const __m256i *)(column - radius + 2 * k));
        even = _mm256_add_epi32(even, _mm256_madd_epi16(c, pairs->even[k]));
        odd = _mm256_add_epi32(odd, _mm256_madd_epi16(c, pairs->odd[k]));
    }
    return _mm256_blend_epi16(_mm256_srli_epi32(even, 16), odd, 0xaa);
}

static inline void gauss_row(uint8_t *out, const uint8_t *const *rows, int32_t width,
                             const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    uint16_t *column = scratch + 16;
    struct gauss_pairs pairs;
    gauss_columns(column, rows, width, weights, radius);
    gauss_pairs_make(&pairs, weights, radius);
    int32_t x = 0;
    for (; x + 32 <= width; x += 32) {
        const __m256i low = gauss_sixteen(column + x, &pairs, radius),
                      high = gauss_sixteen(column + x + 16, &pairs, radius);
        _mm256_storeu_si256((__m256i *)(out + x),
                            _mm256_permute4x64_epi64(_mm256_packus_epi16(low, high), 0xd8));
    }
    for (; x < width; x++) {
        uint32_t sum = 32768;
        for (int32_t tap = 0; tap <= 2 * radius; tap++)
            sum +=
                (uint32_t)gauss_weight(weights, radius, tap) * (column[x - radius + tap] ^ 0x8000u);
        out[x] = (uint8_t)(sum >> 16);
    }
}

void fv_k_gauss_row_u8__avx2(uint8_t *out, const uint8_t *const *rows, int32_t width,
                             const uint16_t *weights, int32_t radius, uint16_t *scratch)
{
    if (radius == 1)
        gauss_row(out, rows, width, weights, 1, scratch);
    else if (radius == 2)
        gauss_row(out, rows, width, weights, 2, scratch);
    else
        gauss_row(out, rows, width, weights, 3, scratch);
}

/* ---- two pictures or tables to one ----------------------------------------------------------- */

/* Weighted sums of two pixels each, in pairs of words; 16 pixels. */
static inline void two_sums(__m256i pairs, __m256i weights, __m256i half, __m256i *low,
                            __m256i *high)
{
    const __m256i zero = _mm256_setzero_si256();
    *low = _mm256_add_epi32(_mm256_madd_epi16(_mm256_unpacklo_epi8(pairs, zero), weights), half);
    *high = _mm256_add_epi32(_mm256_madd_epi16(_mm256_unpackhi_epi8(pairs, zero), weights), half);
}

static inline __m256i weights_of(int32_t a, int32_t b)
{
    return _mm256_set1_epi32((int32_t)((uint32_t)b << 16 | ((uint32_t)a & 0xffff)));
}

static inline __m256i mix_sixteen(__m256i pairs, __m256i weights)
{
    __m256i low, high;
    two_sums(pairs, weights, _mm256_set1_epi32(128), &low, &high);
    return _mm256_packs_epi32(_mm256_srai_epi32(low, 8), _mm256_srai_epi32(high, 8));
}

void fv_k_mix_u8__avx2(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                       int32_t weight)
{
    const __m256i weights = weights_of(weight, 256 - weight);
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        const __m256i va = _mm256_loadu_si256((const __m256i *)(a + i)),
                      vb = _mm256_loadu_si256((const __m256i *)(b + i));
        _mm256_storeu_si256(
            (__m256i *)(out + i),
            _mm256_packus_epi16(mix_sixteen(_mm256_unpacklo_epi8(va, vb), weights),
                                mix_sixteen(_mm256_unpackhi_epi8(va, vb), weights)));
    }
    for (; i < count; i++) {
        const int32_t mixed = (weight * a[i] + (256 - weight) * b[i] + 128) >> 8;
        out[i] = (uint8_t)(mixed < 0 ? 0 : mixed > 255 ? 255 : mixed);
    }
}

static inline __m256i line_eight(const uint8_t *in, __m256 factor, __m256 offset)
{
    const __m256i v = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)(const void *)in));
    const __m256 product = _mm256_mul_ps(_mm256_cvtepi32_ps(v), factor);
    return _mm256_cvtps_epi32(_mm256_add_ps(product, offset));
}

void fv_k_line_u8__avx2(uint8_t *out, const uint8_t *in, int32_t count, float factor, float offset)
{
    const __m256 factors = _mm256_set1_ps(factor), offsets = _mm256_set1_ps(offset);
    const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        const __m256i a = line_eight(in + i, factors, offsets);
        const __m256i b = line_eight(in + i + 8, factors, offsets);
        const __m256i c = line_eight(in + i + 16, factors, offsets);
        const __m256i d = line_eight(in + i + 24, factors, offsets);
        const __m256i bytes =
            _mm256_packus_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
        _mm256_storeu_si256((__m256i *)(void *)(out + i),
                            _mm256_permutevar8x32_epi32(bytes, order));
    }
    fv_k_line_u8__c(out + i, in + i, count - i, factor, offset);
}

static inline __m256i blend_sixteen(__m256i pairs, __m256i weights)
{
    __m256i low, high;
    two_sums(pairs, weights, _mm256_set1_epi32(8), &low, &high);
    return _mm256_packus_epi32(_mm256_srli_epi32(low, 4), _mm256_srli_epi32(high, 4));
}

void fv_k_contrast_blend_u16__avx2(uint16_t out[256], const uint8_t a[256], const uint8_t b[256],
                                   int32_t weight)
{
    const __m256i weights = weights_of(4096 - weight, weight);
    for (int32_t i = 0; i < 256; i += 32) {
        const __m256i va = _mm256_loadu_si256((const __m256i *)(a + i)),
                      vb = _mm256_loadu_si256((const __m256i *)(b + i));
        /* Lanes hold places 0 to 7 and 16 to 23, and 8 to 15 and 24 to 31. */
        const __m256i low = blend_sixteen(_mm256_unpacklo_epi8(va, vb), weights),
                      high = blend_sixteen(_mm256_unpackhi_epi8(va, vb), weights);
        _mm256_storeu_si256((__m256i *)(out + i), _mm256_permute2x128_si256(low, high, 0x20));
        _mm256_storeu_si256((__m256i *)(out + i + 16), _mm256_permute2x128_si256(low, high, 0x31));
    }
}
