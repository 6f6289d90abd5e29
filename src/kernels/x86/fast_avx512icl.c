#include "kernels/kernels.h"

#include <immintrin.h>

#define MAX _mm512_max_epu8

static inline __m512i load(const uint8_t *p)
{
    return _mm512_loadu_si512(p);
}

/* No branches, which would often be mispredicted: the peaks of each vector are moved together, of
 * two neighbours one at most, and as many as there are get stored. */
int32_t fv_k_fast_peaks_u8__avx512icl(uint16_t *columns, const uint8_t *above, const uint8_t *row,
                                      const uint8_t *below, int32_t from, int32_t to)
{
    uint8_t counted[64];
    for (int k = 0; k < 64; k++)
        counted[k] = (uint8_t)k;
    const __m512i position = load(counted);
    int32_t found = 0;
    for (int32_t i = from; i < to; i += 64) {
        const __m512i centre = load(row + i);
        __m512i around = MAX(load(row + i - 1), load(row + i + 1));
        around = MAX(around, MAX(MAX(load(above + i - 1), load(above + i)), load(above + i + 1)));
        around = MAX(around, MAX(MAX(load(below + i - 1), load(below + i)), load(below + i + 1)));
        uint64_t peaks = _mm512_cmpgt_epu8_mask(centre, around);
        if (to - i < 64) peaks &= (UINT64_C(1) << (to - i)) - 1u;
        const __m512i together = _mm512_maskz_compress_epi8(peaks, position);
        const int32_t count = (int32_t)_mm_popcnt_u64(peaks);
        _mm512_mask_storeu_epi16(
            columns + found, _bzhi_u32(UINT32_MAX, (uint32_t)count),
            _mm512_add_epi16(_mm512_cvtepu8_epi16(_mm512_castsi512_si256(together)),
                             _mm512_set1_epi16((int16_t)i)));
        found += count;
    }
    return found;
}
