/* Shared by the AVX2 and AVX-512 variants of fast_score_u8: exact scores of pixels that may be
 * corners, 32 at a time. The AVX-512 one uses 256 bits here as well: two of their minima are done
 * at once where only one of 512 bits would be. */
#ifndef FOVEA_KERNELS_X86_FAST_GROUPS_H
#define FOVEA_KERNELS_X86_FAST_GROUPS_H

#include <immintrin.h>
#include <stddef.h>
#include <stdint.h>

enum { FV_FAST_STRETCH = 1024 }; /* pixels whose groups are listed at once */

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two
 * arcs that differ in their ends share eight pixels: min over them once, then the better of the two
 * ends. */
static inline void fv_fast_best_arcs(const __m256i p[16], __m256i *brightest, __m256i *darkest)
{
    __m256i low[8], high[8];
    for (int j = 0; j < 8; j++) {
        low[j] = _mm256_min_epu8(p[2 * j + 1], p[(2 * j + 2) & 15]);
        high[j] = _mm256_max_epu8(p[2 * j + 1], p[(2 * j + 2) & 15]);
    }
    __m256i low4[8], high4[8];
    for (int j = 0; j < 8; j++) {
        low4[j] = _mm256_min_epu8(low[j], low[(j + 1) & 7]);
        high4[j] = _mm256_max_epu8(high[j], high[(j + 1) & 7]);
    }
    __m256i bright = _mm256_setzero_si256(), dark = _mm256_set1_epi8(-1);
    for (int j = 0; j < 8; j++) {
        const __m256i one_end = p[2 * j], other_end = p[(2 * j + 9) & 15];
        bright =
            _mm256_max_epu8(bright, _mm256_min_epu8(_mm256_min_epu8(low4[j], low4[(j + 2) & 7]),
                                                    _mm256_max_epu8(one_end, other_end)));
        dark = _mm256_min_epu8(dark, _mm256_max_epu8(_mm256_max_epu8(high4[j], high4[(j + 2) & 7]),
                                                     _mm256_min_epu8(one_end, other_end)));
    }
    *brightest = bright;
    *darkest = dark;
}

/* Sixteen pixels at each of two places. */
static inline __m256i fv_fast_both(const uint8_t *a, const uint8_t *b, ptrdiff_t offset)
{
    return _mm256_loadu2_m128i((const __m128i *)(b + offset), (const __m128i *)(a + offset));
}

/* Scores of sixteen pixels from `a` on and sixteen from `b` on; `t`: their thresholds. */
static inline void fv_fast_score_groups(uint8_t *scores_a, uint8_t *scores_b, const uint8_t *a,
                                        const uint8_t *b, ptrdiff_t s, __m256i t)
{
    const __m256i p[16] = {fv_fast_both(a, b, -3 * s),     fv_fast_both(a, b, -3 * s + 1),
                           fv_fast_both(a, b, -2 * s + 2), fv_fast_both(a, b, -s + 3),
                           fv_fast_both(a, b, 3),          fv_fast_both(a, b, s + 3),
                           fv_fast_both(a, b, 2 * s + 2),  fv_fast_both(a, b, 3 * s + 1),
                           fv_fast_both(a, b, 3 * s),      fv_fast_both(a, b, 3 * s - 1),
                           fv_fast_both(a, b, 2 * s - 2),  fv_fast_both(a, b, s - 3),
                           fv_fast_both(a, b, -3),         fv_fast_both(a, b, -s - 3),
                           fv_fast_both(a, b, -2 * s - 2), fv_fast_both(a, b, -3 * s - 1)};
    const __m256i centre = fv_fast_both(a, b, 0);
    __m256i bright, dark;
    fv_fast_best_arcs(p, &bright, &dark);
    const __m256i best =
        _mm256_max_epu8(_mm256_subs_epu8(bright, centre), _mm256_subs_epu8(centre, dark));
    const __m256i within = _mm256_cmpeq_epi8(_mm256_max_epu8(best, t), t);
    const __m256i score = _mm256_andnot_si256(within, _mm256_sub_epi8(best, _mm256_set1_epi8(1)));
    _mm_storeu_si128((__m128i *)scores_a, _mm256_castsi256_si128(score));
    _mm_storeu_si128((__m128i *)scores_b, _mm256_extracti128_si256(score, 1));
}

/* Score the listed groups of sixteen. `groups` has room for one more. */
static inline void fv_fast_score_listed(uint8_t *scores, const uint8_t *pixels,
                                        ptrdiff_t stride_bytes, const uint8_t *thresholds,
                                        int32_t *groups, int32_t found, int32_t count)
{
    groups[found] = count; /* an odd last group is paired with the pixels past the end */
    for (int32_t k = 0; k < found; k += 2) {
        const int32_t a = groups[k], b = groups[k + 1];
        fv_fast_score_groups(scores + a, scores + b, pixels + a, pixels + b, stride_bytes,
                             fv_fast_both(thresholds + a, thresholds + b, 0));
    }
}

#endif
