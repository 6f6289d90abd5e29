#include "kernels/kernels.h"

#include <immintrin.h>

#define MIN _mm256_min_epu8
#define MAX _mm256_max_epu8

static inline __m256i load(const uint8_t *p)
{
    return _mm256_loadu_si256((const __m256i *)p);
}

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two arcs that differ
 * in their ends share eight pixels: min over them once, then the better of the two ends. */
static inline void best_arcs(const __m256i p[16], __m256i *brightest, __m256i *darkest)
{
    __m256i low[8], high[8];
    for (int j = 0; j < 8; j++) {
        low[j] = MIN(p[2 * j + 1], p[(2 * j + 2) & 15]);
        high[j] = MAX(p[2 * j + 1], p[(2 * j + 2) & 15]);
    }
    __m256i low4[8], high4[8];
    for (int j = 0; j < 8; j++) {
        low4[j] = MIN(low[j], low[(j + 1) & 7]);
        high4[j] = MAX(high[j], high[(j + 1) & 7]);
    }
    __m256i bright = _mm256_setzero_si256(), dark = _mm256_set1_epi8(-1);
    for (int j = 0; j < 8; j++) {
        const __m256i one_end = p[2 * j], other_end = p[(2 * j + 9) & 15];
        bright = MAX(bright, MIN(MIN(low4[j], low4[(j + 2) & 7]), MAX(one_end, other_end)));
        dark = MIN(dark, MAX(MAX(high4[j], high4[(j + 2) & 7]), MIN(one_end, other_end)));
    }
    *brightest = bright;
    *darkest = dark;
}

/* Whether both opposite pairs hold a pixel beyond the threshold on the same side, in any lane. */
static inline int any_beyond(const __m256i *p, int first, int second, __m256i above, __m256i below)
{
    const __m256i bright = MIN(MAX(p[first], p[first + 8]), MAX(p[second], p[second + 8]));
    const __m256i dark = MAX(MIN(p[first], p[first + 8]), MIN(p[second], p[second + 8]));
    const __m256i beyond = _mm256_or_si256(_mm256_subs_epu8(bright, above), _mm256_subs_epu8(below, dark));
    return !_mm256_testz_si256(beyond, beyond);
}

void fv_k_fast_score_u8__avx2(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes, int32_t count,
                              int32_t threshold)
{
    const ptrdiff_t s = stride_bytes;
    const __m256i t = _mm256_set1_epi8((char)threshold), t1 = _mm256_set1_epi8((char)(threshold + 1));
    const __m256i one = _mm256_set1_epi8(1);
    for (int32_t i = 0; i < count; i += 32) {
        const uint8_t *c = pixels + i;
        const __m256i centre = load(c), above = _mm256_adds_epu8(centre, t), below = _mm256_subs_epu8(centre, t);
        __m256i p[16], score = _mm256_setzero_si256();
        p[0] = load(c - 3 * s), p[8] = load(c + 3 * s), p[4] = load(c + 3), p[12] = load(c - 3);
        if (any_beyond(p, 0, 4, above, below)) {
            p[2] = load(c - 2 * s + 2), p[10] = load(c + 2 * s - 2);
            p[6] = load(c + 2 * s + 2), p[14] = load(c - 2 * s - 2);
            if (any_beyond(p, 2, 6, above, below)) {
                p[1] = load(c - 3 * s + 1), p[3] = load(c - s + 3), p[5] = load(c + s + 3), p[7] = load(c + 3 * s + 1);
                p[9] = load(c + 3 * s - 1), p[11] = load(c + s - 3), p[13] = load(c - s - 3);
                p[15] = load(c - 3 * s - 1);
                __m256i bright, dark;
                best_arcs(p, &bright, &dark);
                const __m256i best = MAX(_mm256_subs_epu8(bright, centre), _mm256_subs_epu8(centre, dark));
                score = _mm256_and_si256(_mm256_cmpeq_epi8(MAX(best, t1), best), _mm256_sub_epi8(best, one));
            }
        }
        _mm256_storeu_si256((__m256i *)(scores + i), score);
    }
}

int32_t fv_k_fast_peaks_u8__avx2(uint16_t *columns, const uint8_t *above, const uint8_t *row, const uint8_t *below,
                                 int32_t count)
{
    int32_t found = 0;
    for (int32_t i = 0; i < count; i += 32) {
        const __m256i centre = load(row + i);
        if (_mm256_testz_si256(centre, centre)) continue;
        __m256i around = MAX(load(row + i - 1), load(row + i + 1));
        around = MAX(around, MAX(MAX(load(above + i - 1), load(above + i)), load(above + i + 1)));
        around = MAX(around, MAX(MAX(load(below + i - 1), load(below + i)), load(below + i + 1)));
        /* A lane of the saturated difference is zero where the centre is not greater. */
        const __m256i lower = _mm256_cmpeq_epi8(_mm256_subs_epu8(centre, around), _mm256_setzero_si256());
        uint32_t peaks = ~(uint32_t)_mm256_movemask_epi8(lower);
        if (count - i < 32) peaks &= (1u << (count - i)) - 1u;
        for (; peaks != 0; peaks &= peaks - 1) columns[found++] = (uint16_t)(i + __builtin_ctz(peaks));
    }
    return found;
}
