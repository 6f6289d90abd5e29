#include "kernels/kernels.h"

#include <stdbool.h>

#include <immintrin.h>

/* The weights halved, 9 17 24 28 24 17 9: then a sum down a column has 15 bits, which multiply-adds
 * of signed words take, and along the row they are doubled again, so that 16 bits are rounded off
 * as the contract says. */
static inline __m128i blur7_two_rows(__m128i a, __m128i b, bool high, int weight_a, int weight_b)
{
    const __m128i both = high ? _mm_unpackhi_epi8(a, b) : _mm_unpacklo_epi8(a, b);
    return _mm_maddubs_epi16(both, _mm_set1_epi16((int16_t)(weight_b << 8 | weight_a)));
}

/* Sums of the lower eight columns of sixteen or of the higher ones. */
static inline __m128i blur7_columns(const __m128i r[7], bool high)
{
    const __m128i outer = blur7_two_rows(r[0], r[6], high, 9, 9),
                  middle = blur7_two_rows(r[1], r[5], high, 17, 17);
    const __m128i inner = blur7_two_rows(r[2], r[4], high, 24, 24);
    const __m128i centre = blur7_two_rows(r[3], _mm_setzero_si128(), high, 28, 0);
    return _mm_add_epi16(_mm_add_epi16(outer, middle), _mm_add_epi16(inner, centre));
}

static inline void blur7_down(const uint8_t *const rows[7], int32_t x, uint16_t *column)
{
    __m128i r[7];
    for (int i = 0; i < 7; i++)
        r[i] = _mm_loadu_si128((const __m128i *)(rows[i] + x));
    _mm_storeu_si128((__m128i *)(column + x), blur7_columns(r, false));
    _mm_storeu_si128((__m128i *)(column + x + 8), blur7_columns(r, true));
}

/* A pair of weights for a pair of columns, times 4. */
static inline __m128i blur7_weights(int first, int second)
{
    return _mm_set1_epi32(4 * second << 16 | 4 * first);
}

/* Eight outputs as words: the same four loads serve the even and the odd pixels. */
static inline __m128i blur7_eight(const uint16_t *column)
{
    const __m128i a = _mm_loadu_si128((const __m128i *)(column - 3));
    const __m128i b = _mm_loadu_si128((const __m128i *)(column - 1));
    const __m128i c = _mm_loadu_si128((const __m128i *)(column + 1));
    const __m128i d = _mm_loadu_si128((const __m128i *)(column + 3));
    const __m128i half = _mm_set1_epi32(32768);
    const __m128i even = _mm_add_epi32(_mm_add_epi32(_mm_madd_epi16(a, blur7_weights(9, 17)),
                                                     _mm_madd_epi16(b, blur7_weights(24, 28))),
                                       _mm_add_epi32(_mm_madd_epi16(c, blur7_weights(24, 17)),
                                                     _mm_madd_epi16(d, blur7_weights(9, 0))));
    const __m128i odd = _mm_add_epi32(_mm_add_epi32(_mm_madd_epi16(a, blur7_weights(0, 9)),
                                                    _mm_madd_epi16(b, blur7_weights(17, 24))),
                                      _mm_add_epi32(_mm_madd_epi16(c, blur7_weights(28, 24)),
                                                    _mm_madd_epi16(d, blur7_weights(17, 9))));
    return _mm_blend_epi16(_mm_srli_epi32(_mm_add_epi32(even, half), 16), _mm_add_epi32(odd, half),
                           0xaa);
}

void fv_k_blur7_row_u8__sse4(uint8_t *out, const uint8_t *const rows[7], int32_t width,
                             uint16_t *scratch)
{
    if (width < 16) {
        fv_k_blur7_row_u8__c(out, rows, width, scratch);
        return;
    }
    const uint8_t *const row[7] = {rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]};
    uint16_t *column = scratch + 8;
    for (int32_t x = 0;; x += 16) {
        if (x > width - 16) x = width - 16; /* the last vector overlaps the one before */
        blur7_down(row, x, column);
        if (x == width - 16) break;
    }
    for (int32_t i = 1; i <= FV_BLUR7_RADIUS; i++) {
        column[-i] = column[i];
        column[width - 1 + i] = column[width - 1 - i];
    }
    for (int32_t x = 0;; x += 16) {
        if (x > width - 16) x = width - 16;
        const __m128i low = blur7_eight(column + x), high = blur7_eight(column + x + 8);
        _mm_storeu_si128((__m128i *)(out + x), _mm_packus_epi16(low, high));
        if (x == width - 16) break;
    }
}

/* Both moments of the columns -16..-1 or 0..15 + 1 of the circle: `u` holds the columns' weights.
 */
struct fv_moment_sums {
    __m128i m10, m01;
};

static inline void moments_rows(struct fv_moment_sums *sums, __m128i below, __m128i above,
                                __m128i u, int v)
{
    const __m128i ones = _mm_set1_epi8(1);
    const __m128i along = _mm_add_epi16(_mm_maddubs_epi16(below, u), _mm_maddubs_epi16(above, u));
    const __m128i across =
        _mm_sub_epi16(_mm_maddubs_epi16(below, ones), _mm_maddubs_epi16(above, ones));
    sums->m10 = _mm_add_epi32(sums->m10, _mm_madd_epi16(along, _mm_set1_epi16(1)));
    sums->m01 = _mm_add_epi32(sums->m01, _mm_madd_epi16(across, _mm_set1_epi16((int16_t)v)));
}

void fv_k_moments_u8__sse4(int32_t *m, const uint8_t *image, ptrdiff_t stride,
                           const int32_t *centres, int32_t count)
{
    const __m128i u_left =
        _mm_setr_epi8(-16, -15, -14, -13, -12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1);
    const __m128i u_right = _mm_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    __m128i left_mask[FV_MOMENTS_RADIUS + 1], right_mask[FV_MOMENTS_RADIUS + 1];
    for (int v = 0; v <= FV_MOMENTS_RADIUS; v++) {
        const __m128i half = _mm_set1_epi8((char)fv_moments_half_width[v]);
        left_mask[v] = _mm_cmpgt_epi8(u_left, _mm_sub_epi8(_mm_set1_epi8(-1), half));
        right_mask[v] = _mm_cmpgt_epi8(_mm_add_epi8(half, _mm_set1_epi8(1)), u_right);
    }
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *row = image + centres[k];
        struct fv_moment_sums sums = {_mm_setzero_si128(), _mm_setzero_si128()};
        const __m128i zero = _mm_setzero_si128();
        moments_rows(&sums,
                     _mm_and_si128(_mm_loadu_si128((const __m128i *)(row - 16)), left_mask[0]),
                     zero, u_left, 0);
        moments_rows(&sums, _mm_and_si128(_mm_loadu_si128((const __m128i *)row), right_mask[0]),
                     zero, u_right, 0);
        for (int v = 1; v <= FV_MOMENTS_RADIUS; v++) {
            const uint8_t *below = row + v * stride, *above = row - v * stride;
            moments_rows(
                &sums, _mm_and_si128(_mm_loadu_si128((const __m128i *)(below - 16)), left_mask[v]),
                _mm_and_si128(_mm_loadu_si128((const __m128i *)(above - 16)), left_mask[v]), u_left,
                v);
            moments_rows(
                &sums, _mm_and_si128(_mm_loadu_si128((const __m128i *)below), right_mask[v]),
                _mm_and_si128(_mm_loadu_si128((const __m128i *)above), right_mask[v]), u_right, v);
        }
        const __m128i pairs = _mm_hadd_epi32(sums.m10, sums.m01);
        _mm_storel_epi64((__m128i *)(m + 2 * k), _mm_hadd_epi32(pairs, pairs));
    }
}

/* Sampled into arrays first: the vector loads that compare come long after the byte stores that
 * they need. */
static inline void brief_sample(uint8_t samples[2 * FV_BRIEF_BITS], const uint8_t *centre,
                                const int8_t *positions, __m128i step)
{
    for (int i = 0; i < 2 * FV_BRIEF_BITS; i += 4) {
        const __m128i position =
            _mm_cvtepi8_epi16(_mm_loadl_epi64((const __m128i *)(positions + 2 * i)));
        const __m128i offset = _mm_madd_epi16(position, step);
        const uint64_t low = (uint64_t)_mm_cvtsi128_si64(offset),
                       high = (uint64_t)_mm_extract_epi64(offset, 1);
        samples[i] = centre[(int32_t)low];
        samples[i + 1] = centre[(int64_t)low >> 32];
        samples[i + 2] = centre[(int32_t)high];
        samples[i + 3] = centre[(int64_t)high >> 32];
    }
}

void fv_k_brief_u8__sse4(uint8_t descriptor[FV_DESCRIPTOR_BYTES], const uint8_t *centre,
                         const int8_t positions[4 * FV_BRIEF_BITS], int32_t along, int32_t across)
{
    uint8_t samples[2 * FV_BRIEF_BITS];
    brief_sample(samples, centre, positions,
                 _mm_set1_epi32((int32_t)((uint32_t)across << 16 | (uint16_t)along)));
    for (int i = 0; i < FV_BRIEF_BITS; i += 16) {
        const __m128i a = _mm_loadu_si128((const __m128i *)(samples + i));
        const __m128i b = _mm_loadu_si128((const __m128i *)(samples + FV_BRIEF_BITS + i));
        const unsigned less = ~(unsigned)_mm_movemask_epi8(_mm_cmpeq_epi8(_mm_max_epu8(a, b), a));
        descriptor[i / 8] = (uint8_t)less;
        descriptor[i / 8 + 1] = (uint8_t)(less >> 8);
    }
}
