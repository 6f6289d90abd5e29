#include "kernels/kernels.h"

#include <immintrin.h>

#define MIN _mm_min_epu8
#define MAX _mm_max_epu8

static inline __m128i load(const uint8_t *p)
{
    return _mm_loadu_si128((const __m128i *)p);
}

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two arcs that differ
 * in their ends share eight pixels: min over them once, then the better of the two ends. */
static inline void best_arcs(const __m128i p[16], __m128i *brightest, __m128i *darkest)
{
    __m128i low[8], high[8];
    for (int j = 0; j < 8; j++) {
        low[j] = MIN(p[2 * j + 1], p[(2 * j + 2) & 15]);
        high[j] = MAX(p[2 * j + 1], p[(2 * j + 2) & 15]);
    }
    __m128i low4[8], high4[8];
    for (int j = 0; j < 8; j++) {
        low4[j] = MIN(low[j], low[(j + 1) & 7]);
        high4[j] = MAX(high[j], high[(j + 1) & 7]);
    }
    __m128i bright = _mm_setzero_si128(), dark = _mm_set1_epi8(-1);
    for (int j = 0; j < 8; j++) {
        const __m128i one_end = p[2 * j], other_end = p[(2 * j + 9) & 15];
        bright = MAX(bright, MIN(MIN(low4[j], low4[(j + 2) & 7]), MAX(one_end, other_end)));
        dark = MIN(dark, MAX(MAX(high4[j], high4[(j + 2) & 7]), MIN(one_end, other_end)));
    }
    *brightest = bright;
    *darkest = dark;
}

/* Whether both opposite pairs hold a pixel beyond the threshold on the same side, in any lane. */
static inline int any_beyond(const __m128i *p, int first, int second, __m128i above, __m128i below)
{
    const __m128i bright = MIN(MAX(p[first], p[first + 8]), MAX(p[second], p[second + 8]));
    const __m128i dark = MAX(MIN(p[first], p[first + 8]), MIN(p[second], p[second + 8]));
    const __m128i beyond = _mm_or_si128(_mm_subs_epu8(bright, above), _mm_subs_epu8(below, dark));
    return !_mm_testz_si128(beyond, beyond);
}

void fv_k_fast_score_u8__sse4(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes, int32_t count,
                              int32_t threshold)
{
    const ptrdiff_t s = stride_bytes;
    const __m128i t = _mm_set1_epi8((char)threshold), t1 = _mm_set1_epi8((char)(threshold + 1));
    const __m128i one = _mm_set1_epi8(1);
    for (int32_t i = 0; i < count; i += 16) {
        const uint8_t *c = pixels + i;
        const __m128i centre = load(c), above = _mm_adds_epu8(centre, t), below = _mm_subs_epu8(centre, t);
        __m128i p[16], score = _mm_setzero_si128();
        p[0] = load(c - 3 * s), p[8] = load(c + 3 * s), p[4] = load(c + 3), p[12] = load(c - 3);
        if (any_beyond(p, 0, 4, above, below)) {
            p[2] = load(c - 2 * s + 2), p[10] = load(c + 2 * s - 2);
            p[6] = load(c + 2 * s + 2), p[14] = load(c - 2 * s - 2);
            if (any_beyond(p, 2, 6, above, below)) {
                p[1] = load(c - 3 * s + 1), p[3] = load(c - s + 3), p[5] = load(c + s + 3), p[7] = load(c + 3 * s + 1);
                p[9] = load(c + 3 * s - 1), p[11] = load(c + s - 3), p[13] = load(c - s - 3);
                p[15] = load(c - 3 * s - 1);
                __m128i bright, dark;
                best_arcs(p, &bright, &dark);
                const __m128i best = MAX(_mm_subs_epu8(bright, centre), _mm_subs_epu8(centre, dark));
                score = _mm_and_si128(_mm_cmpeq_epi8(MAX(best, t1), best), _mm_sub_epi8(best, one));
            }
        }
        _mm_storeu_si128((__m128i *)(scores + i), score);
    }
}

int32_t fv_k_fast_peaks_u8__sse4(uint16_t *columns, const uint8_t *above, const uint8_t *row, const uint8_t *below,
                                 int32_t count)
{
    int32_t found = 0;
    for (int32_t i = 0; i < count; i += 16) {
        const __m128i centre = load(row + i);
        if (_mm_testz_si128(centre, centre)) continue;
        __m128i around = MAX(load(row + i - 1), load(row + i + 1));
        around = MAX(around, MAX(MAX(load(above + i - 1), load(above + i)), load(above + i + 1)));
        around = MAX(around, MAX(MAX(load(below + i - 1), load(below + i)), load(below + i + 1)));
        /* A lane of the saturated difference is zero where the centre is not greater. */
        const __m128i lower = _mm_cmpeq_epi8(_mm_subs_epu8(centre, around), _mm_setzero_si128());
        uint32_t peaks = (uint32_t)_mm_movemask_epi8(lower) ^ 0xffffu;
        if (count - i < 16) peaks &= (1u << (count - i)) - 1u;
        for (; peaks != 0; peaks &= peaks - 1) columns[found++] = (uint16_t)(i + __builtin_ctz(peaks));
    }
    return found;
}
