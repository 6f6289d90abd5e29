#include "kernels/kernels.h"

#include <immintrin.h>

#define MIN _mm512_min_epu8
#define MAX _mm512_max_epu8

static inline __m512i load(const uint8_t *p)
{
    return _mm512_loadu_si512(p);
}

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two arcs that differ
 * in their ends share eight pixels: min over them once, then the better of the two ends. */
static inline void best_arcs(const __m512i p[16], __m512i *brightest, __m512i *darkest)
{
    __m512i low[8], high[8];
    for (int j = 0; j < 8; j++) {
        low[j] = MIN(p[2 * j + 1], p[(2 * j + 2) & 15]);
        high[j] = MAX(p[2 * j + 1], p[(2 * j + 2) & 15]);
    }
    __m512i low4[8], high4[8];
    for (int j = 0; j < 8; j++) {
        low4[j] = MIN(low[j], low[(j + 1) & 7]);
        high4[j] = MAX(high[j], high[(j + 1) & 7]);
    }
    __m512i bright = _mm512_setzero_si512(), dark = _mm512_set1_epi8(-1);
    for (int j = 0; j < 8; j++) {
        const __m512i one_end = p[2 * j], other_end = p[(2 * j + 9) & 15];
        bright = MAX(bright, MIN(MIN(low4[j], low4[(j + 2) & 7]), MAX(one_end, other_end)));
        dark = MIN(dark, MAX(MAX(high4[j], high4[(j + 2) & 7]), MIN(one_end, other_end)));
    }
    *brightest = bright;
    *darkest = dark;
}

/* Lanes in which both opposite pairs hold a pixel beyond the threshold on the same side. */
static inline __mmask64 beyond(const __m512i *p, int first, int second, __m512i above, __m512i below)
{
    const __m512i bright = MIN(MAX(p[first], p[first + 8]), MAX(p[second], p[second + 8]));
    const __m512i dark = MAX(MIN(p[first], p[first + 8]), MIN(p[second], p[second + 8]));
    return _mm512_cmpgt_epu8_mask(bright, above) | _mm512_cmplt_epu8_mask(dark, below);
}

void fv_k_fast_score_u8__avx512(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes, int32_t count,
                                int32_t threshold)
{
    const ptrdiff_t s = stride_bytes;
    const __m512i t = _mm512_set1_epi8((char)threshold), one = _mm512_set1_epi8(1);
    for (int32_t i = 0; i < count; i += 64) {
        const uint8_t *c = pixels + i;
        const __m512i centre = load(c), above = _mm512_adds_epu8(centre, t), below = _mm512_subs_epu8(centre, t);
        __m512i p[16], score = _mm512_setzero_si512();
        p[0] = load(c - 3 * s), p[8] = load(c + 3 * s), p[4] = load(c + 3), p[12] = load(c - 3);
        __mmask64 left = beyond(p, 0, 4, above, below);
        if (left != 0) {
            p[2] = load(c - 2 * s + 2), p[10] = load(c + 2 * s - 2);
            p[6] = load(c + 2 * s + 2), p[14] = load(c - 2 * s - 2);
            left &= beyond(p, 2, 6, above, below);
        }
        if (left != 0) {
            p[1] = load(c - 3 * s + 1), p[3] = load(c - s + 3), p[5] = load(c + s + 3), p[7] = load(c + 3 * s + 1);
            p[9] = load(c + 3 * s - 1), p[11] = load(c + s - 3), p[13] = load(c - s - 3), p[15] = load(c - 3 * s - 1);
            __m512i bright, dark;
            best_arcs(p, &bright, &dark);
            const __m512i best = MAX(_mm512_subs_epu8(bright, centre), _mm512_subs_epu8(centre, dark));
            score = _mm512_maskz_sub_epi8(_mm512_cmpgt_epu8_mask(best, t), best, one);
        }
        _mm512_storeu_si512(scores + i, score);
    }
}

int32_t fv_k_fast_peaks_u8__avx512(uint16_t *columns, const uint8_t *above, const uint8_t *row, const uint8_t *below,
                                   int32_t count)
{
    int32_t found = 0;
    for (int32_t i = 0; i < count; i += 64) {
        const __m512i centre = load(row + i);
        if (_mm512_test_epi8_mask(centre, centre) == 0) continue;
        __m512i around = MAX(load(row + i - 1), load(row + i + 1));
        around = MAX(around, MAX(MAX(load(above + i - 1), load(above + i)), load(above + i + 1)));
        around = MAX(around, MAX(MAX(load(below + i - 1), load(below + i)), load(below + i + 1)));
        uint64_t peaks = _mm512_cmpgt_epu8_mask(centre, around);
        if (count - i < 64) peaks &= (UINT64_C(1) << (count - i)) - 1u;
        for (; peaks != 0; peaks &= peaks - 1) columns[found++] = (uint16_t)(i + __builtin_ctzll(peaks));
    }
    return found;
}
