#include "kernels/kernels.h"

#include <stdbool.h>

#include <immintrin.h>

/* As the SSE4 variant, twice as wide; all shuffles stay within lanes but for those that bring the
 * halves together. */
static inline __m256i blur7_two_rows(__m256i a, __m256i b, bool high, int weight_a, int weight_b)
{
    const __m256i both = high ? _mm256_unpackhi_epi8(a, b) : _mm256_unpacklo_epi8(a, b);
    return _mm256_maddubs_epi16(both, _mm256_set1_epi16((int16_t)(weight_b << 8 | weight_a)));
}

/* Sums of eight columns of each lane: the lower ones or the higher ones. */
static inline __m256i blur7_columns(const __m256i r[7], bool high)
{
    const __m256i outer = blur7_two_rows(r[0], r[6], high, 9, 9),
                  middle = blur7_two_rows(r[1], r[5], high, 17, 17);
    const __m256i inner = blur7_two_rows(r[2], r[4], high, 24, 24);
    const __m256i centre = blur7_two_rows(r[3], _mm256_setzero_si256(), high, 28, 0);
    return _mm256_add_epi16(_mm256_add_epi16(outer, middle), _mm256_add_epi16(inner, centre));
}

static inline void blur7_down(const uint8_t *const rows[7], int32_t x, uint16_t *column)
{
    __m256i r[7];
    for (int i = 0; i < 7; i++)
        r[i] = _mm256_loadu_si256((const __m256i *)(rows[i] + x));
    const __m256i low = blur7_columns(r, false), high = blur7_columns(r, true);
    _mm256_storeu_si256((__m256i *)(column + x), _mm256_permute2x128_si256(low, high, 0x20));
    _mm256_storeu_si256((__m256i *)(column + x + 16), _mm256_permute2x128_si256(low, high, 0x31));
}

/* A pair of weights for a pair of columns, times 4. */
static inline __m256i blur7_weights(int first, int second)
{
    return _mm256_set1_epi32(4 * second << 16 | 4 * first);
}

static inline __m256i blur7_sixteen(const uint16_t *column)
{
    const __m256i a = _mm256_loadu_si256((const __m256i *)(column - 3));
    const __m256i b = _mm256_loadu_si256((const __m256i *)(column - 1));
    const __m256i c = _mm256_loadu_si256((const __m256i *)(column + 1));
    const __m256i d = _mm256_loadu_si256((const __m256i *)(column + 3));
    const __m256i half = _mm256_set1_epi32(32768);
    const __m256i even =
        _mm256_add_epi32(_mm256_add_epi32(_mm256_madd_epi16(a, blur7_weights(9, 17)),
                                          _mm256_madd_epi16(b, blur7_weights(24, 28))),
                         _mm256_add_epi32(_mm256_madd_epi16(c, blur7_weights(24, 17)),
                                          _mm256_madd_epi16(d, blur7_weights(9, 0))));
    const __m256i odd =
        _mm256_add_epi32(_mm256_add_epi32(_mm256_madd_epi16(a, blur7_weights(0, 9)),
                                          _mm256_madd_epi16(b, blur7_weights(17, 24))),
                         _mm256_add_epi32(_mm256_madd_epi16(c, blur7_weights(28, 24)),
                                          _mm256_madd_epi16(d, blur7_weights(17, 9))));
    return _mm256_blend_epi16(_mm256_srli_epi32(_mm256_add_epi32(even, half), 16),
                              _mm256_add_epi32(odd, half), 0xaa);
}

void fv_k_blur7_row_u8__avx2(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                             uint16_t *scratch)
{
    if (width < 32) {
        fv_k_blur7_row_u8__c(out, rows, width, scratch);
        return;
    }
    const uint8_t *const row[7] = {rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]};
    uint16_t *column = scratch + 16;
    for (int32_t x = 0;; x += 32) {
        if (x > width - 32) x = width - 32; /* the last vector overlaps the one before */
        blur7_down(row, x, column);
        if (x == width - 32) break;
    }
    for (int32_t i = 1; i <= FV_BLUR7_RADIUS; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0;; x += 32) {
        if (x > width - 32) x = width - 32;
        const __m256i packed =
            _mm256_packus_epi16(blur7_sixteen(column + x), blur7_sixteen(column + x + 16));
        _mm256_storeu_si256((__m256i *)(out + x), _mm256_permute4x64_epi64(packed, 0xd8));
        if (x == width - 32) break;
    }
}

void fv_k_moments_u8__avx2(int32_t *m, const uint8_t *image, ptrdiff_t stride,
                           const int32_t *centres, int32_t count)
{
    const __m256i u =
        _mm256_setr_epi8(-16, -15, -14, -13, -12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1, 0,
                         1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m256i ones = _mm256_set1_epi8(1), one_words = _mm256_set1_epi16(1);
    __m256i mask[FV_MOMENTS_RADIUS + 1];
    for (int v = 0; v <= FV_MOMENTS_RADIUS; v++)
        mask[v] = _mm256_cmpgt_epi8(_mm256_set1_epi8((char)(fv_moments_half_width[v] + 1)),
                                    _mm256_abs_epi8(u));
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *row = image + centres[k] - 16;
        const __m256i middle = _mm256_and_si256(_mm256_loadu_si256((const __m256i *)row), mask[0]);
        __m256i m10 = _mm256_madd_epi16(_mm256_maddubs_epi16(middle, u), one_words);
        __m256i m01 = _mm256_setzero_si256();
        for (int v = 1; v <= FV_MOMENTS_RADIUS; v++) {
            const __m256i below =
                _mm256_and_si256(_mm256_loadu_si256((const __m256i *)(row + v * stride)), mask[v]);
            const __m256i above =
                _mm256_and_si256(_mm256_loadu_si256((const __m256i *)(row - v * stride)), mask[v]);
            const __m256i along =
                _mm256_add_epi16(_mm256_maddubs_epi16(below, u), _mm256_maddubs_epi16(above, u));
            const __m256i across = _mm256_sub_epi16(_mm256_maddubs_epi16(below, ones),
                                                    _mm256_maddubs_epi16(above, ones));
            m10 = _mm256_add_epi32(m10, _mm256_madd_epi16(along, one_words));
            m01 = _mm256_add_epi32(m01, _mm256_madd_epi16(across, _mm256_set1_epi16((int16_t)v)));
        }
        const __m256i pairs = _mm256_hadd_epi32(m10, m01);
        const __m128i sum =
            _mm_add_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256(pairs, 1));
        _mm_storel_epi64((__m128i *)(m + 2 * k), _mm_hadd_epi32(sum, sum));
    }
}

static inline __m256i brief_eight(const uint8_t *centre, const int8_t *positions, __m256i step)
{
    const __m256i position = _mm256_cvtepi8_epi16(_mm_loadu_si128((const __m128i *)positions));
    const __m256i words = _mm256_i32gather_epi32((const int *)(const void *)centre,
                                                 _mm256_madd_epi16(position, step), 1);
    return _mm256_and_si256(words, _mm256_set1_epi32(255));
}

void fv_k_brief_u8__avx2(uint8_t descriptor[FV_DESCRIPTOR_BYTES], const uint8_t *centre,
                         const int8_t positions[4 * FV_BRIEF_BITS], int32_t along, int32_t across)
{
    const __m256i step = _mm256_set1_epi32((int32_t)((uint32_t)across << 16 | (uint16_t)along));
    for (int i = 0; i < FV_DESCRIPTOR_BYTES; i++, positions += 16) {
        const __m256i a = brief_eight(centre, positions, step);
        const __m256i b = brief_eight(centre, positions + 2 * FV_BRIEF_BITS, step);
        descriptor[i] = (uint8_t)_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(b, a)));
    }
}
