#include "kernels/kernels.h"

#include <immintrin.h>

/* As the SSE4 variant, four times as wide; ends of rows by masks. */
static inline __m512i blur7_column(const uint8_t *const rows[7], int32_t x, __mmask32 mask)
{
    __m512i r[7];
    for (int i = 0; i < 7; i++)
        r[i] = _mm512_cvtepu8_epi16(_mm256_maskz_loadu_epi8(mask, rows[i] + x));
    const __m512i outer = _mm512_mullo_epi16(_mm512_add_epi16(r[0], r[6]), _mm512_set1_epi16(18));
    const __m512i middle = _mm512_mullo_epi16(_mm512_add_epi16(r[1], r[5]), _mm512_set1_epi16(34));
    const __m512i inner = _mm512_mullo_epi16(_mm512_add_epi16(r[2], r[4]), _mm512_set1_epi16(48));
    const __m512i centre = _mm512_mullo_epi16(r[3], _mm512_set1_epi16(56));
    const __m512i sum =
        _mm512_add_epi16(_mm512_add_epi16(outer, middle), _mm512_add_epi16(inner, centre));
    return _mm512_xor_si512(sum, _mm512_set1_epi16(INT16_MIN));
}

static inline __m512i blur7_thirtytwo(const uint16_t *column)
{
    const __m512i a = _mm512_loadu_si512(column - 3), b = _mm512_loadu_si512(column - 1);
    const __m512i c = _mm512_loadu_si512(column + 1), d = _mm512_loadu_si512(column + 3);
    const __m512i bias = _mm512_set1_epi32(256 * 32768 + 32768);
    const __m512i even =
        _mm512_add_epi32(_mm512_add_epi32(_mm512_madd_epi16(a, _mm512_set1_epi32(34 << 16 | 18)),
                                          _mm512_madd_epi16(b, _mm512_set1_epi32(56 << 16 | 48))),
                         _mm512_add_epi32(_mm512_madd_epi16(c, _mm512_set1_epi32(34 << 16 | 48)),
                                          _mm512_madd_epi16(d, _mm512_set1_epi32(18))));
    const __m512i odd =
        _mm512_add_epi32(_mm512_add_epi32(_mm512_madd_epi16(a, _mm512_set1_epi32(18 << 16)),
                                          _mm512_madd_epi16(b, _mm512_set1_epi32(48 << 16 | 34))),
                         _mm512_add_epi32(_mm512_madd_epi16(c, _mm512_set1_epi32(48 << 16 | 56)),
                                          _mm512_madd_epi16(d, _mm512_set1_epi32(18 << 16 | 34))));
    return _mm512_mask_blend_epi16(0xaaaaaaaau, _mm512_srli_epi32(_mm512_add_epi32(even, bias), 16),
                                   _mm512_add_epi32(odd, bias));
}

void fv_k_blur7_row_u8__avx512(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                               uint16_t *scratch)
{
    const uint8_t *const row[7] = {rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]};
    uint16_t *column = scratch + 16;
    for (int32_t x = 0; x < width; x += 32) {
        const __mmask32 mask = width - x >= 32 ? 0xffffffffu : (1u << (width - x)) - 1u;
        _mm512_mask_storeu_epi16(column + x, mask, blur7_column(row, x, mask));
    }
    for (int32_t i = 1; i <= FV_BLUR7_RADIUS; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0; x < width; x += 32) {
        const __mmask32 mask = width - x >= 32 ? 0xffffffffu : (1u << (width - x)) - 1u;
        _mm512_mask_cvtepi16_storeu_epi8(out + x, mask, blur7_thirtytwo(column + x));
    }
}

/* Two rows at once: row v in the low half, row -v in the high half. */
void fv_k_moments_u8__avx512(int32_t *m, const uint8_t *image, ptrdiff_t stride,
                             const int32_t *centres, int32_t count)
{
    const __m256i u_half =
        _mm256_setr_epi8(-16, -15, -14, -13, -12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1, 0,
                         1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m512i u = _mm512_broadcast_i64x4(u_half);
    const __m512i ones = _mm512_set1_epi8(1), one_words = _mm512_set1_epi16(1);
    __mmask32 mask[FV_MOMENTS_RADIUS + 1];
    __m512i across_weight[FV_MOMENTS_RADIUS + 1];
    for (int v = 0; v <= FV_MOMENTS_RADIUS; v++) {
        mask[v] = _mm256_cmple_epi8_mask(_mm256_abs_epi8(u_half),
                                         _mm256_set1_epi8((char)fv_moments_half_width[v]));
        across_weight[v] =
            _mm512_inserti64x4(_mm512_set1_epi16((int16_t)v), _mm256_set1_epi16((int16_t)-v), 1);
    }
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *row = image + centres[k] - 16;
        const __m512i middle = _mm512_zextsi256_si512(_mm256_maskz_loadu_epi8(mask[0], row));
        __m512i m10 = _mm512_madd_epi16(_mm512_maddubs_epi16(middle, u), one_words);
        __m512i m01 = _mm512_setzero_si512();
        for (int v = 1; v <= FV_MOMENTS_RADIUS; v++) {
            const __m256i below = _mm256_maskz_loadu_epi8(mask[v], row + v * stride);
            const __m256i above = _mm256_maskz_loadu_epi8(mask[v], row - v * stride);
            const __m512i both = _mm512_inserti64x4(_mm512_castsi256_si512(below), above, 1);
            m10 =
                _mm512_add_epi32(m10, _mm512_madd_epi16(_mm512_maddubs_epi16(both, u), one_words));
            m01 = _mm512_add_epi32(
                m01, _mm512_madd_epi16(_mm512_maddubs_epi16(both, ones), across_weight[v]));
        }
        m[2 * k] = _mm512_reduce_add_epi32(m10);
        m[2 * k + 1] = _mm512_reduce_add_epi32(m01);
    }
}

static inline __m512i brief_sixteen(const uint8_t *centre, const int8_t *positions, __m512i step)
{
    const __m512i position = _mm512_cvtepi8_epi16(_mm256_loadu_si256((const __m256i *)positions));
    const __m512i words = _mm512_i32gather_epi32(_mm512_madd_epi16(position, step), centre, 1);
    return _mm512_and_si512(words, _mm512_set1_epi32(255));
}

void fv_k_brief_u8__avx512(uint8_t descriptor[FV_DESCRIPTOR_BYTES], const uint8_t *centre,
                           const int8_t positions[4 * FV_BRIEF_BITS], int32_t along, int32_t across)
{
    const __m512i step = _mm512_set1_epi32((int32_t)((uint32_t)across << 16 | (uint16_t)along));
    for (int i = 0; i < FV_DESCRIPTOR_BYTES; i += 2, positions += 32) {
        const __m512i a = brief_sixteen(centre, positions, step);
        const __m512i b = brief_sixteen(centre, positions + 2 * FV_BRIEF_BITS, step);
        const __mmask16 less = _mm512_cmplt_epu32_mask(a, b);
        descriptor[i] = (uint8_t)less;
        descriptor[i + 1] = (uint8_t)(less >> 8);
    }
}
