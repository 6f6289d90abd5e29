#include "kernels/kernels.h"

#include <immintrin.h>

#define MIN _mm512_min_epu8
#define MAX _mm512_max_epu8
#define MIN32 _mm256_min_epu8
#define MAX32 _mm256_max_epu8

enum { STRETCH = 1024 }; /* pixels whose groups are listed at once */

static inline __m512i load(const uint8_t *p)
{
    return _mm512_loadu_si512(p);
}

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two arcs that
 * differ in their ends share eight pixels: min over them once, then the better of the two ends. */
static inline void best_arcs(const __m256i p[16], __m256i *brightest, __m256i *darkest)
{
    __m256i low[8], high[8];
    for (int j = 0; j < 8; j++) {
        low[j] = MIN32(p[2 * j + 1], p[(2 * j + 2) & 15]);
        high[j] = MAX32(p[2 * j + 1], p[(2 * j + 2) & 15]);
    }
    __m256i low4[8], high4[8];
    for (int j = 0; j < 8; j++) {
        low4[j] = MIN32(low[j], low[(j + 1) & 7]);
        high4[j] = MAX32(high[j], high[(j + 1) & 7]);
    }
    __m256i bright = _mm256_setzero_si256(), dark = _mm256_set1_epi8(-1);
    for (int j = 0; j < 8; j++) {
        const __m256i one_end = p[2 * j], other_end = p[(2 * j + 9) & 15];
        bright = MAX32(bright, MIN32(MIN32(low4[j], low4[(j + 2) & 7]), MAX32(one_end, other_end)));
        dark = MIN32(dark, MAX32(MAX32(high4[j], high4[(j + 2) & 7]), MIN32(one_end, other_end)));
    }
    *brightest = bright;
    *darkest = dark;
}

/* Of two opposite pairs: the brighter of each, then the darker of the two; and the other way round. */
static inline void pairs(const uint8_t *first, const uint8_t *first8, const uint8_t *second,
                         const uint8_t *second8, __m512i *bright, __m512i *dark)
{
    const __m512i a = load(first), b = load(first8), c = load(second), d = load(second8);
    *bright = MIN(MAX(a, b), MAX(c, d));
    *dark = MAX(MIN(a, b), MIN(c, d));
}

/* Bit k of the result: pixel k may be a corner. */
static inline uint64_t candidates(const uint8_t *c, ptrdiff_t s, __m512i t)
{
    const __m512i centre = load(c), above = _mm512_adds_epu8(centre, t), below = _mm512_subs_epu8(centre, t);
    __m512i bright, dark, bright2, dark2;
    pairs(c - 3 * s, c + 3 * s, c + 3, c - 3, &bright, &dark);
    pairs(c - 2 * s + 2, c + 2 * s - 2, c + 2 * s + 2, c - 2 * s - 2, &bright2, &dark2);
    const __mmask64 brighter =
        _mm512_mask_cmpgt_epu8_mask(_mm512_cmpgt_epu8_mask(bright, above), bright2, above);
    const __mmask64 darker = _mm512_mask_cmplt_epu8_mask(_mm512_cmplt_epu8_mask(dark, below), dark2, below);
    return brighter | darker;
}

/* Sixteen pixels at each of two places. */
static inline __m256i both(const uint8_t *a, const uint8_t *b, ptrdiff_t offset)
{
    return _mm256_loadu2_m128i((const __m128i *)(b + offset), (const __m128i *)(a + offset));
}

static inline void score_groups(uint8_t *scores_a, uint8_t *scores_b, const uint8_t *a, const uint8_t *b,
                                ptrdiff_t s, __m256i t)
{
    const __m256i p[16] = {
        both(a, b, -3 * s), both(a, b, -3 * s + 1), both(a, b, -2 * s + 2), both(a, b, -s + 3),
        both(a, b, 3),      both(a, b, s + 3),      both(a, b, 2 * s + 2),  both(a, b, 3 * s + 1),
        both(a, b, 3 * s),  both(a, b, 3 * s - 1),  both(a, b, 2 * s - 2),  both(a, b, s - 3),
        both(a, b, -3),     both(a, b, -s - 3),     both(a, b, -2 * s - 2), both(a, b, -3 * s - 1)};
    const __m256i centre = both(a, b, 0);
    __m256i bright, dark;
    best_arcs(p, &bright, &dark);
    const __m256i best = MAX32(_mm256_subs_epu8(bright, centre), _mm256_subs_epu8(centre, dark));
    const __mmask32 corner = _mm256_cmpgt_epu8_mask(best, t);
    const __m256i score = _mm256_maskz_sub_epi8(corner, best, _mm256_set1_epi8(1));
    _mm_storeu_si128((__m128i *)scores_a, _mm256_castsi256_si128(score));
    _mm_storeu_si128((__m128i *)scores_b, _mm256_extracti128_si256(score, 1));
}

/* Two passes over a stretch of the row. The first asks of every group of sixteen pixels whether any of them
 * has, in each of four opposite pairs of the circle, a pixel beyond the threshold on the same side: nine
 * contiguous ones hold one of every pair. The second scores the groups that passed. Listing them instead of
 * branching spares the mispredictions. The second works on 256
 * bits: two of its minima are done at once where only one of 512 bits would be. */
static void score_stretch(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes, int32_t count,
                          int32_t threshold)
{
    const __m512i t = _mm512_set1_epi8((char)threshold);
    const __m256i t32 = _mm256_set1_epi8((char)threshold);
    int32_t groups[STRETCH / 16 + 4], found = 0;
    for (int32_t i = 0; i < count; i += 64) {
        const uint64_t lanes = candidates(pixels + i, stride_bytes, t);
        _mm512_storeu_si512(scores + i, _mm512_setzero_si512());
        for (int32_t k = 0; k < 64; k += 16) {
            groups[found] = i + k;
            found += (lanes >> k & 0xffff) != 0;
        }
    }
    groups[found] = count; /* an odd last group is paired with the pixels past the end */
    for (int32_t k = 0; k < found; k += 2) {
        const int32_t a = groups[k], b = groups[k + 1];
        score_groups(scores + a, scores + b, pixels + a, pixels + b, stride_bytes, t32);
    }
}

void fv_k_fast_score_u8__avx512(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes, int32_t count,
                                int32_t threshold)
{
    for (int32_t i = 0; i < count; i += STRETCH)
        score_stretch(scores + i, pixels + i, stride_bytes, count - i < STRETCH ? count - i : STRETCH,
                      threshold);
}

int32_t fv_k_fast_peaks_u8__avx512(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                   const uint8_t *below, int32_t from, int32_t to)
{
    int32_t found = 0;
    for (int32_t i = from; i < to; i += 64) {
        const __m512i centre = load(row + i);
        if (_mm512_test_epi8_mask(centre, centre) == 0) continue;
        __m512i around = MAX(load(row + i - 1), load(row + i + 1));
        around = MAX(around, MAX(MAX(load(above + i - 1), load(above + i)), load(above + i + 1)));
        around = MAX(around, MAX(MAX(load(below + i - 1), load(below + i)), load(below + i + 1)));
        uint64_t peaks = _mm512_cmpgt_epu8_mask(centre, around);
        if (to - i < 64) peaks &= (UINT64_C(1) << (to - i)) - 1u;
        for (; peaks != 0; peaks &= peaks - 1)
            columns[found++] = (uint16_t)(i + __builtin_ctzll(peaks));
    }
    return found;
}
