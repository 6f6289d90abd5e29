#include "kernels/kernels.h"

#include <immintrin.h>

#include "kernels/x86/fast_groups.h"

#define MIN _mm512_min_epu8
#define MAX _mm512_max_epu8

static inline __m512i load(const uint8_t *p)
{
    return _mm512_loadu_si512(p);
}

/* Of two opposite pairs: the brighter of each, then the darker of the two; and the other way round.
 */
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
    const __m512i centre = load(c), above = _mm512_adds_epu8(centre, t),
                  below = _mm512_subs_epu8(centre, t);
    __m512i bright, dark, bright2, dark2;
    pairs(c - 3 * s, c + 3 * s, c + 3, c - 3, &bright, &dark);
    pairs(c - 2 * s + 2, c + 2 * s - 2, c + 2 * s + 2, c - 2 * s - 2, &bright2, &dark2);
    const __mmask64 brighter =
        _mm512_mask_cmpgt_epu8_mask(_mm512_cmpgt_epu8_mask(bright, above), bright2, above);
    const __mmask64 darker =
        _mm512_mask_cmplt_epu8_mask(_mm512_cmplt_epu8_mask(dark, below), dark2, below);
    return brighter | darker;
}

/* As the AVX2 variant, asking of 64 pixels at a time. */
static void score_stretch(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                          const uint8_t *thresholds, int32_t count)
{
    int32_t groups[FV_FAST_STRETCH / 16 + 4], found = 0;
    for (int32_t i = 0; i < count; i += 64) {
        const uint64_t lanes = candidates(pixels + i, stride_bytes, load(thresholds + i));
        _mm512_storeu_si512(scores + i, _mm512_setzero_si512());
        for (int32_t k = 0; k < 64; k += 16) {
            groups[found] = i + k;
            found += (lanes >> k & 0xffff) != 0;
        }
    }
    fv_fast_score_listed(scores, pixels, stride_bytes, thresholds, groups, found, count);
}

void fv_k_fast_score_u8__avx512(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                                const uint8_t *thresholds, int32_t count)
{
    for (int32_t i = 0; i < count; i += FV_FAST_STRETCH)
        score_stretch(scores + i, pixels + i, stride_bytes, thresholds + i,
                      count - i < FV_FAST_STRETCH ? count - i : FV_FAST_STRETCH);
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
