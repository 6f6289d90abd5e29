#include "kernels/kernels.h"

#include <immintrin.h>

#define FAST_LANES 32
#include "kernels/x86/fast_groups.h"
#include "kernels/x86/fast_peaks.h"

#define MIN _mm256_min_epu8
#define MAX _mm256_max_epu8

static inline __m256i load(const uint8_t *p)
{
    return _mm256_loadu_si256((const __m256i *)p);
}

/* Of two opposite pairs: the brighter of each, then the darker of the two; and the other way round.
 */
static inline void pairs(const uint8_t *first, const uint8_t *first8, const uint8_t *second,
                         const uint8_t *second8, __m256i *bright, __m256i *dark)
{
    const __m256i a = load(first), b = load(first8), c = load(second), d = load(second8);
    *bright = MIN(*bright, MIN(MAX(a, b), MAX(c, d)));
    *dark = MAX(*dark, MAX(MIN(a, b), MIN(c, d)));
}

/* Bit k of the result: pixel k may be a corner. */
static inline uint32_t candidates(const uint8_t *c, ptrdiff_t s, __m256i t)
{
    const __m256i centre = load(c);
    __m256i bright = _mm256_set1_epi8(-1), dark = _mm256_setzero_si256();
    pairs(c - 3 * s, c + 3 * s, c + 3, c - 3, &bright, &dark);
    pairs(c - 2 * s + 2, c + 2 * s - 2, c + 2 * s + 2, c - 2 * s - 2, &bright, &dark);
    const __m256i above = _mm256_adds_epu8(centre, t), below = _mm256_subs_epu8(centre, t);
    const __m256i within = _mm256_and_si256(_mm256_cmpeq_epi8(MIN(bright, above), bright),
                                            _mm256_cmpeq_epi8(MAX(dark, below), dark));
    return ~(uint32_t)_mm256_movemask_epi8(within);
}

/* Two passes over a stretch of the row. The first asks of every group of sixteen pixels whether any
 * of them has, in each of four opposite pairs of the circle, a pixel beyond the threshold on the
 * same side: nine contiguous ones hold one of every pair. The second scores the groups that passed.
 * Listing them instead of branching spares the mispredictions. */
static void score_stretch(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                          const uint8_t *thresholds, int32_t count)
{
    int32_t groups[FV_FAST_STRETCH / 16 + 2], found = 0;
    for (int32_t i = 0; i < count; i += 32) {
        const uint32_t lanes = candidates(pixels + i, stride_bytes, load(thresholds + i));
        _mm256_storeu_si256((__m256i *)(scores + i), _mm256_setzero_si256());
        groups[found] = i;
        found += (lanes & 0xffff) != 0;
        groups[found] = i + 16;
        found += (lanes >> 16) != 0;
    }
    fv_fast_score_listed(scores, pixels, stride_bytes, thresholds, groups, found, count);
}

void fv_k_fast_score_u8__avx2(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                              const uint8_t *thresholds, int32_t count)
{
    for (int32_t i = 0; i < count; i += FV_FAST_STRETCH)
        score_stretch(scores + i, pixels + i, stride_bytes, thresholds + i,
                      count - i < FV_FAST_STRETCH ? count - i : FV_FAST_STRETCH);
}

/* Bit k of the result: pixel k of 32 is greater than its eight neighbours. */
static inline uint32_t peaks(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    __m256i around = MAX(load(row - 1), load(row + 1));
    around = MAX(around, MAX(MAX(load(above - 1), load(above)), load(above + 1)));
    around = MAX(around, MAX(MAX(load(below - 1), load(below)), load(below + 1)));
    /* A lane of the saturated difference is zero where the centre is not greater. */
    const __m256i lower =
        _mm256_cmpeq_epi8(_mm256_subs_epu8(load(row), around), _mm256_setzero_si256());
    return ~(uint32_t)_mm256_movemask_epi8(lower);
}

static inline int has_scores(const uint8_t *row)
{
    const __m256i scores = load(row);
    return !_mm256_testz_si256(scores, scores);
}

int32_t fv_k_fast_peaks_u8__avx2(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                 const uint8_t *below, int32_t from, int32_t to)
{
    return peaks_of_row(columns, above, row, below, from, to);
}
