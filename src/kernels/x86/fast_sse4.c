#include "kernels/kernels.h"

#include <immintrin.h>

#define FAST_LANES 16
#include "kernels/x86/fast_peaks.h"

#define MIN _mm_min_epu8
#define MAX _mm_max_epu8

enum { STRETCH = 1024 }; /* pixels whose groups are listed at once */

static inline __m128i load(const uint8_t *p)
{
    return _mm_loadu_si128((const __m128i *)p);
}

/* Of the arcs of nine, the best weakest pixel (brightest) and the best strongest one (darkest). Two
 * arcs that differ in their ends share eight pixels: min over them once, then the better of the two
 * ends. */
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

/* Of two opposite pairs: the brighter of each, then the darker of the two; and the other way round.
 */
static inline void pairs(const uint8_t *first, const uint8_t *first8, const uint8_t *second,
                         const uint8_t *second8, __m128i *bright, __m128i *dark)
{
    const __m128i a = load(first), b = load(first8), c = load(second), d = load(second8);
    *bright = MIN(*bright, MIN(MAX(a, b), MAX(c, d)));
    *dark = MAX(*dark, MAX(MIN(a, b), MIN(c, d)));
}

/* Bit k of the result: group k of sixteen pixels at c may hold corners. */
static inline uint32_t candidates(const uint8_t *c, ptrdiff_t s, __m128i t)
{
    const __m128i centre = load(c);
    __m128i bright = _mm_set1_epi8(-1), dark = _mm_setzero_si128();
    pairs(c - 3 * s, c + 3 * s, c + 3, c - 3, &bright, &dark);
    pairs(c - 2 * s + 2, c + 2 * s - 2, c + 2 * s + 2, c - 2 * s - 2, &bright, &dark);
    const __m128i beyond = MAX(_mm_subs_epu8(bright, _mm_adds_epu8(centre, t)),
                               _mm_subs_epu8(_mm_subs_epu8(centre, t), dark));
    return !_mm_testz_si128(beyond, beyond);
}

static inline void score_group(uint8_t *scores, const uint8_t *c, ptrdiff_t s, __m128i t)
{
    const __m128i p[16] = {
        load(c - 3 * s), load(c - 3 * s + 1), load(c - 2 * s + 2), load(c - s + 3),
        load(c + 3),     load(c + s + 3),     load(c + 2 * s + 2), load(c + 3 * s + 1),
        load(c + 3 * s), load(c + 3 * s - 1), load(c + 2 * s - 2), load(c + s - 3),
        load(c - 3),     load(c - s - 3),     load(c - 2 * s - 2), load(c - 3 * s - 1)};
    const __m128i centre = load(c);
    __m128i bright, dark;
    best_arcs(p, &bright, &dark);
    const __m128i best = MAX(_mm_subs_epu8(bright, centre), _mm_subs_epu8(centre, dark));
    const __m128i within = _mm_cmpeq_epi8(MAX(best, t), t);
    _mm_storeu_si128((__m128i *)scores,
                     _mm_andnot_si128(within, _mm_sub_epi8(best, _mm_set1_epi8(1))));
}

/* Two passes over a stretch of the row. The first asks of every group of sixteen pixels whether any
 * of them has, in each of four opposite pairs of the circle, a pixel beyond the threshold on the
 * same side: nine contiguous ones hold one of every pair. The second scores the groups that passed.
 * Listing them instead of branching spares the mispredictions. */
static void score_stretch(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                          const uint8_t *thresholds, int32_t count)
{
    int32_t groups[STRETCH / 16 + 1], found = 0;
    for (int32_t i = 0; i < count; i += 16) {
        _mm_storeu_si128((__m128i *)(scores + i), _mm_setzero_si128());
        groups[found] = i;
        found += (int32_t)candidates(pixels + i, stride_bytes, load(thresholds + i));
    }
    for (int32_t k = 0; k < found; k++)
        score_group(scores + groups[k], pixels + groups[k], stride_bytes,
                    load(thresholds + groups[k]));
}

void fv_k_fast_score_u8__sse4(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                              const uint8_t *thresholds, int32_t count)
{
    for (int32_t i = 0; i < count; i += STRETCH)
        score_stretch(scores + i, pixels + i, stride_bytes, thresholds + i,
                      count - i < STRETCH ? count - i : STRETCH);
}

/* Bit k of the result: pixel k of sixteen is greater than its eight neighbours. */
static inline uint32_t peaks(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    __m128i around = MAX(load(row - 1), load(row + 1));
    around = MAX(around, MAX(MAX(load(above - 1), load(above)), load(above + 1)));
    around = MAX(around, MAX(MAX(load(below - 1), load(below)), load(below + 1)));
    /* A lane of the saturated difference is zero where the centre is not greater. */
    const __m128i lower = _mm_cmpeq_epi8(_mm_subs_epu8(load(row), around), _mm_setzero_si128());
    return (uint32_t)_mm_movemask_epi8(lower) ^ 0xffffu;
}

static inline int has_scores(const uint8_t *row)
{
    const __m128i scores = load(row);
    return !_mm_testz_si128(scores, scores);
}

int32_t fv_k_fast_peaks_u8__sse4(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                 const uint8_t *below, int32_t from, int32_t to)
{
    return peaks_of_row(columns, above, row, below, from, to);
}
