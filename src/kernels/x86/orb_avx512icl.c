#include "kernels/kernels.h"

#include <stdbool.h>

#include <immintrin.h>

/* The weights halved, 9 17 24 28 24 17 9: then a sum down a column has 15 bits, which multiply-adds
 * of signed words take, and along the row they are doubled again, so that 16 bits are rounded off
 * as the contract says.
 */
static inline __m512i blur7_two_rows(__m512i a, __m512i b, bool high, int weight_a, int weight_b)
{
    const __m512i both = high ? _mm512_unpackhi_epi8(a, b) : _mm512_unpacklo_epi8(a, b);
    return _mm512_maddubs_epi16(both, _mm512_set1_epi16((int16_t)(weight_b << 8 | weight_a)));
}

/* Sums of eight columns of each 128-bit lane: the lower ones or the higher ones. */
static inline __m512i blur7_columns(const __m512i r[7], bool high)
{
    const __m512i outer = blur7_two_rows(r[0], r[6], high, 9, 9),
                  middle = blur7_two_rows(r[1], r[5], high, 17, 17);
    const __m512i inner = blur7_two_rows(r[2], r[4], high, 24, 24);
    const __m512i centre = blur7_two_rows(r[3], _mm512_setzero_si512(), high, 28, 0);
    return _mm512_add_epi16(_mm512_add_epi16(outer, middle), _mm512_add_epi16(inner, centre));
}

static inline void blur7_down(const uint8_t *const rows[7], int32_t x, uint16_t *column)
{
    const __m512i first = _mm512_setr_epi64(0, 1, 8, 9, 2, 3, 10, 11),
                  second = _mm512_setr_epi64(4, 5, 12, 13, 6, 7, 14, 15);
    __m512i r[7];
    for (int i = 0; i < 7; i++)
        r[i] = _mm512_loadu_si512(rows[i] + x);
    const __m512i low = blur7_columns(r, false), high = blur7_columns(r, true);
    _mm512_storeu_si512(column + x, _mm512_permutex2var_epi64(low, first, high));
    _mm512_storeu_si512(column + x + 32, _mm512_permutex2var_epi64(low, second, high));
}

/* A pair of weights for a pair of columns, times 4. */
static inline __m512i blur7_weights(int first, int second)
{
    return _mm512_set1_epi32(4 * second << 16 | 4 * first);
}

/* 32 outputs in the low bytes of words: even ones from the pairs that begin three columns before
 * them, odd ones likewise. */
static inline __m512i blur7_along(const uint16_t *column)
{
    const __m512i a = _mm512_loadu_si512(column - 3), b = _mm512_loadu_si512(column - 1);
    const __m512i c = _mm512_loadu_si512(column + 1), d = _mm512_loadu_si512(column + 3);
    __m512i even = _mm512_set1_epi32(32768), odd = even;
    even = _mm512_dpwssd_epi32(even, a, blur7_weights(9, 17));
    even = _mm512_dpwssd_epi32(even, b, blur7_weights(24, 28));
    even = _mm512_dpwssd_epi32(even, c, blur7_weights(24, 17));
    even = _mm512_dpwssd_epi32(even, d, blur7_weights(9, 0));
    odd = _mm512_dpwssd_epi32(odd, a, blur7_weights(0, 9));
    odd = _mm512_dpwssd_epi32(odd, b, blur7_weights(17, 24));
    odd = _mm512_dpwssd_epi32(odd, c, blur7_weights(28, 24));
    odd = _mm512_dpwssd_epi32(odd, d, blur7_weights(17, 9));
    return _mm512_mask_blend_epi16(0xaaaaaaaau, _mm512_srli_epi32(even, 16), odd);
}

static inline void blur7_out(uint8_t *out, const uint16_t *column)
{
    const __m512i order = _mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7);
    const __m512i packed = _mm512_packus_epi16(blur7_along(column), blur7_along(column + 32));
    _mm512_storeu_si512(out, _mm512_permutexvar_epi64(order, packed));
}

void fv_k_blur7_row_u8__avx512icl(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                                  uint16_t *scratch)
{
    if (width < 64) {
        fv_k_blur7_row_u8__avx512(out, rows, width, scratch);
        return;
    }
    const uint8_t *const row[7] = {rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]};
    uint16_t *column = scratch + 16;
    const int32_t last = width - 64; /* the last vectors overlap the ones before */
    for (int32_t x = 0; x < last; x += 64)
        blur7_down(row, x, column);
    blur7_down(row, last, column);
    for (int32_t i = 1; i <= FV_BLUR7_RADIUS; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0; x < last; x += 64)
        blur7_out(out + x, column + x);
    blur7_out(out + last, column + last);
}
