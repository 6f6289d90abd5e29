#include "kernels/bilateral_ends.h"

#include <immintrin.h>

enum { WIDE = 32, BLOCK = 16, BLOCKS = 256 / BLOCK };

/* Weights as bytes, in blocks of 16 that a shuffle looks up, low bytes and high bytes, both halves
 * alike. Blocks behind the last weight that is not 0 are left out: most of them, as weights fall
 * with the square of the difference. */
struct tables {
    int count[3];
    __m256i low[3][BLOCKS], high[3][BLOCKS];
};

static void split(struct tables *tables, const uint16_t weights[3][256])
{
    const __m128i byte = _mm_set1_epi16(255);
    for (int k = 0; k < 3; k++) {
        tables->count[k] = 0;
        for (int b = 0; b < BLOCKS; b++) {
            const __m128i *from = (const __m128i *)(const void *)(weights[k] + BLOCK * b);
            const __m128i first = _mm_loadu_si128(from), second = _mm_loadu_si128(from + 1);
            const __m128i any = _mm_or_si128(first, second);
            tables->low[k][b] = _mm256_broadcastsi128_si256(
                _mm_packus_epi16(_mm_and_si128(first, byte), _mm_and_si128(second, byte)));
            tables->high[k][b] = _mm256_broadcastsi128_si256(
                _mm_packus_epi16(_mm_srli_epi16(first, 8), _mm_srli_epi16(second, 8)));
            if (!_mm_testz_si128(any, any)) tables->count[k] = b + 1;
        }
    }
}

/* Sums of 32 pixels: words in the order of unpacklo_epi8 and unpackhi_epi8, and of these again for
 * 32 bits. */
struct sums {
    __m256i norm[2], sum[4];
};

static inline __m256i load(const uint8_t *from)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)from);
}

static inline __m256i difference(__m256i a, __m256i b)
{
    return _mm256_sub_epi8(_mm256_max_epu8(a, b), _mm256_min_epu8(a, b));
}

/* Add a pair of taps whose weights stand in table k. A difference less 16 b is an index of block b
 * from 0 to 15; 0x70 more, at most 255, the others get their highest bit set, for which a shuffle
 * gives 0. */
static inline void add_pair(struct sums *sums, __m256i p, __m256i q, __m256i centre,
                            const struct tables *tables, int k)
{
    const __m256i zero = _mm256_setzero_si256(), bias = _mm256_set1_epi8(0x70),
                  next = _mm256_set1_epi8(BLOCK);
    __m256i i = difference(p, centre), j = difference(q, centre);
    __m256i p_low = zero, p_high = zero, q_low = zero, q_high = zero;
    for (int b = 0; b < tables->count[k]; b++) {
        const __m256i low = tables->low[k][b], high = tables->high[k][b];
        const __m256i at = _mm256_adds_epu8(i, bias), bt = _mm256_adds_epu8(j, bias);
        p_low = _mm256_or_si256(p_low, _mm256_shuffle_epi8(low, at));
        p_high = _mm256_or_si256(p_high, _mm256_shuffle_epi8(high, at));
        q_low = _mm256_or_si256(q_low, _mm256_shuffle_epi8(low, bt));
        q_high = _mm256_or_si256(q_high, _mm256_shuffle_epi8(high, bt));
        i = _mm256_sub_epi8(i, next);
        j = _mm256_sub_epi8(j, next);
    }
    const __m256i weight[2][2] = {
        {_mm256_unpacklo_epi8(p_low, p_high), _mm256_unpacklo_epi8(q_low, q_high)},
        {_mm256_unpackhi_epi8(p_low, p_high), _mm256_unpackhi_epi8(q_low, q_high)}};
    const __m256i pixel[2][2] = {{_mm256_unpacklo_epi8(p, zero), _mm256_unpacklo_epi8(q, zero)},
                                 {_mm256_unpackhi_epi8(p, zero), _mm256_unpackhi_epi8(q, zero)}};
    for (int h = 0; h < 2; h++) {
        const __m256i a = weight[h][0], b = weight[h][1], c = pixel[h][0], d = pixel[h][1];
        sums->norm[h] = _mm256_add_epi16(sums->norm[h], _mm256_add_epi16(a, b));
        sums->sum[2 * h] =
            _mm256_add_epi32(sums->sum[2 * h], _mm256_madd_epi16(_mm256_unpacklo_epi16(a, b),
                                                                 _mm256_unpacklo_epi16(c, d)));
        sums->sum[2 * h + 1] =
            _mm256_add_epi32(sums->sum[2 * h + 1], _mm256_madd_epi16(_mm256_unpackhi_epi16(a, b),
                                                                     _mm256_unpackhi_epi16(c, d)));
    }
}

/* (sum + norm / 2) / norm rounded down (bilateral_ends.h). */
static inline __m256i divided(__m256i sum, __m256i norm)
{
    const __m256i dividend = _mm256_add_epi32(sum, _mm256_srli_epi32(norm, 1));
    return _mm256_cvttps_epi32(
        _mm256_div_ps(_mm256_cvtepi32_ps(dividend), _mm256_cvtepi32_ps(norm)));
}

static inline __m256i thirty_two(const uint8_t *const rows[5], int32_t x,
                                 const struct tables *tables)
{
    const __m256i zero = _mm256_setzero_si256(), centre = load(rows[2] + x);
    struct sums sums;
    for (int h = 0; h < 2; h++) {
        const __m256i words =
            h == 0 ? _mm256_unpacklo_epi8(centre, zero) : _mm256_unpackhi_epi8(centre, zero);
        sums.norm[h] = _mm256_set1_epi16(FV_BILATERAL_WEIGHT_MAX);
        sums.sum[2 * h] = _mm256_slli_epi32(_mm256_unpacklo_epi16(words, zero), 11);
        sums.sum[2 * h + 1] = _mm256_slli_epi32(_mm256_unpackhi_epi16(words, zero), 11);
    }
    add_pair(&sums, load(rows[2] + x - 1), load(rows[2] + x + 1), centre, tables, 0);
    add_pair(&sums, load(rows[1] + x), load(rows[3] + x), centre, tables, 0);
    add_pair(&sums, load(rows[1] + x - 1), load(rows[1] + x + 1), centre, tables, 1);
    add_pair(&sums, load(rows[3] + x - 1), load(rows[3] + x + 1), centre, tables, 1);
    add_pair(&sums, load(rows[2] + x - 2), load(rows[2] + x + 2), centre, tables, 2);
    add_pair(&sums, load(rows[0] + x), load(rows[4] + x), centre, tables, 2);
    __m256i words[2];
    for (int h = 0; h < 2; h++)
        words[h] = _mm256_packus_epi32(
            divided(sums.sum[2 * h], _mm256_unpacklo_epi16(sums.norm[h], zero)),
            divided(sums.sum[2 * h + 1], _mm256_unpackhi_epi16(sums.norm[h], zero)));
    return _mm256_packus_epi16(words[0], words[1]);
}

void fv_k_bilateral_row_u8__avx2(uint8_t *out, const uint8_t *const *rows, int32_t width,
                                 const uint16_t weights[3][256])
{
    struct tables tables;
    if (width < WIDE + 4) {
        fv_k_bilateral_row_u8__c(out, rows, width, weights);
        return;
    }
    const uint8_t *const five[5] = {rows[0], rows[1], rows[2], rows[3], rows[4]};
    split(&tables, weights);
    bilateral_ends(out, rows, width, weights);
    const int32_t last = width - 2 - WIDE; /* which goes over some columns again */
    for (int32_t x = 2;; x += WIDE) {
        const int32_t at = x < last ? x : last;
        _mm256_storeu_si256((__m256i *)(void *)(out + at), thirty_two(five, at, &tables));
        if (at == last) return;
    }
}
