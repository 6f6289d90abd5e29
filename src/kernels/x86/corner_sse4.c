#include "kernels/kernels.h"

#include <immintrin.h>

/* Largest minimum and smallest maximum over all arcs of nine of the circle. Two arcs that differ in
 * their ends share eight pixels: min over them once, by doubling, then the better of the two ends.
 */
static inline void corner_arcs(const __m128i ring[16], __m128i *brightest, __m128i *darkest)
{
    __m128i low[8], high[8], low_4[8], high_4[8];
    for (int i = 0; i < 8; i++) {
        low[i] = _mm_min_epu8(ring[2 * i + 1], ring[(2 * i + 2) % 16]);
        high[i] = _mm_max_epu8(ring[2 * i + 1], ring[(2 * i + 2) % 16]);
    }
    for (int i = 0; i < 8; i++) {
        low_4[i] = _mm_min_epu8(low[i], low[(i + 1) % 8]);
        high_4[i] = _mm_max_epu8(high[i], high[(i + 1) % 8]);
    }
    *brightest = _mm_setzero_si128();
    *darkest = _mm_set1_epi8(-1);
    for (int i = 0; i < 8; i++) {
        const __m128i one_end = ring[2 * i], other_end = ring[(2 * i + 9) % 16];
        const __m128i low_8 = _mm_min_epu8(low_4[i], low_4[(i + 2) % 8]);
        const __m128i high_8 = _mm_max_epu8(high_4[i], high_4[(i + 2) % 8]);
        *brightest =
            _mm_max_epu8(*brightest, _mm_min_epu8(low_8, _mm_max_epu8(one_end, other_end)));
        *darkest = _mm_min_epu8(*darkest, _mm_max_epu8(high_8, _mm_min_epu8(one_end, other_end)));
    }
}

/* Scores of two rows of eight pixels, `apart` bytes from each other. */
static inline __m128i corner_two_rows(const uint8_t *row, ptrdiff_t apart,
                                      const ptrdiff_t offsets[16])
{
    __m128i ring[16], brightest, darkest;
    for (int i = 0; i < 16; i++)
        ring[i] = _mm_unpacklo_epi64(_mm_loadl_epi64((const __m128i *)(row + offsets[i])),
                                     _mm_loadl_epi64((const __m128i *)(row + offsets[i] + apart)));
    const __m128i centre = _mm_unpacklo_epi64(_mm_loadl_epi64((const __m128i *)row),
                                              _mm_loadl_epi64((const __m128i *)(row + apart)));
    corner_arcs(ring, &brightest, &darkest);
    return _mm_max_epu8(_mm_subs_epu8(brightest, centre), _mm_subs_epu8(centre, darkest));
}

void fv_k_corner_scores_u8__sse4(uint8_t *scores, const uint8_t *image, ptrdiff_t stride_bytes,
                                 const int32_t *centres, int32_t count)
{
    ptrdiff_t offsets[16];
    for (int i = 0; i < 16; i++)
        offsets[i] = fv_corner_circle[1][i] * stride_bytes + fv_corner_circle[0][i];
    for (int32_t k = 0; k < count; k++, scores += FV_CORNER_SCORES) {
        const uint8_t *row = image + centres[k] - 2 * stride_bytes - 2;
        for (int v = 0; v < 4; v += 2)
            _mm_storeu_si128((__m128i *)(scores + 8 * v),
                             corner_two_rows(row + v * stride_bytes, stride_bytes, offsets));
        _mm_storel_epi64((__m128i *)(scores + 32),
                         corner_two_rows(row + 4 * stride_bytes, 0, offsets));
    }
}
