#include "kernels/bilateral_ends.h"

#include <immintrin.h>

/* Weights as tables of their low and high bytes, which VBMI looks up in registers. */
struct byte_tables {
    _Alignas(64) uint8_t low[3][256], high[3][256];
};

static void split(struct byte_tables *tables, const uint16_t weights[3][256])
{
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 256; i += 32) {
            const __m512i w = _mm512_loadu_si512(weights[k] + i);
            _mm256_store_si256((__m256i *)(tables->low[k] + i), _mm512_cvtepi16_epi8(w));
            _mm256_store_si256((__m256i *)(tables->high[k] + i),
                               _mm512_cvtepi16_epi8(_mm512_srli_epi16(w, 8)));
        }
}

/* Sums of 64 pixels: words in the order of unpacklo_epi8 and unpackhi_epi8, and of these again for
 * 32 bits. */
struct sums {
    __m512i norm[2], sum[4];
};

/* Pixels and weights of one tap as words. */
struct tap {
    __m512i pixel[2], weight[2];
};

static inline __m512i look_up(__m512i index, __mmask64 upper, const __m512i part[4])
{
    return _mm512_mask_mov_epi8(_mm512_permutex2var_epi8(part[0], index, part[1]), upper,
                                _mm512_permutex2var_epi8(part[2], index, part[3]));
}

static inline struct tap tap_at(const uint8_t *from, __mmask64 mask, __m512i centre,
                                const __m512i low[4], const __m512i high[4])
{
    const __m512i zero = _mm512_setzero_si512();
    const __m512i p = _mm512_maskz_loadu_epi8(mask, from);
    const __m512i difference =
        _mm512_sub_epi8(_mm512_max_epu8(p, centre), _mm512_min_epu8(p, centre));
    const __mmask64 upper = _mm512_movepi8_mask(difference);
    const __m512i a = look_up(difference, upper, low), b = look_up(difference, upper, high);
    return (struct tap){{_mm512_unpacklo_epi8(p, zero), _mm512_unpackhi_epi8(p, zero)},
                        {_mm512_unpacklo_epi8(a, b), _mm512_unpackhi_epi8(a, b)}};
}

static inline void add_pair(struct sums *sums, const struct tap *a, const struct tap *b)
{
    for (int i = 0; i < 2; i++) {
        sums->norm[i] =
            _mm512_add_epi16(sums->norm[i], _mm512_add_epi16(a->weight[i], b->weight[i]));
        sums->sum[2 * i] =
            _mm512_dpwssd_epi32(sums->sum[2 * i], _mm512_unpacklo_epi16(a->weight[i], b->weight[i]),
                                _mm512_unpacklo_epi16(a->pixel[i], b->pixel[i]));
        sums->sum[2 * i + 1] = _mm512_dpwssd_epi32(
            sums->sum[2 * i + 1], _mm512_unpackhi_epi16(a->weight[i], b->weight[i]),
            _mm512_unpackhi_epi16(a->pixel[i], b->pixel[i]));
    }
}

/* (sum + norm / 2) / norm rounded down (bilateral_ends.h). */
static inline __m512i divided(__m512i sum, __m512i norm)
{
    const __m512i dividend = _mm512_add_epi32(sum, _mm512_srli_epi32(norm, 1));
    return _mm512_cvttps_epi32(
        _mm512_div_ps(_mm512_cvtepi32_ps(dividend), _mm512_cvtepi32_ps(norm)));
}

static inline __m512i sixty_four(const uint8_t *const rows[5], int32_t x, __mmask64 mask,
                                 const struct byte_tables *tables)
{
    /* pairs of taps of each distance: row and column of both */
    static const int8_t pairs[3][2][4] = {{{2, -1, 2, 1}, {1, 0, 3, 0}},
                                          {{1, -1, 1, 1}, {3, -1, 3, 1}},
                                          {{2, -2, 2, 2}, {0, 0, 4, 0}}};
    const __m512i zero = _mm512_setzero_si512();
    const __m512i centre = _mm512_maskz_loadu_epi8(mask, rows[2] + x);
    struct sums sums;
    for (int i = 0; i < 2; i++) {
        const __m512i words =
            i == 0 ? _mm512_unpacklo_epi8(centre, zero) : _mm512_unpackhi_epi8(centre, zero);
        sums.norm[i] = _mm512_set1_epi16(FV_BILATERAL_WEIGHT_MAX);
        sums.sum[2 * i] = _mm512_slli_epi32(_mm512_unpacklo_epi16(words, zero), 11);
        sums.sum[2 * i + 1] = _mm512_slli_epi32(_mm512_unpackhi_epi16(words, zero), 11);
    }
    for (int k = 0; k < 3; k++) {
        __m512i low[4], high[4];
        for (int i = 0; i < 4; i++) {
            low[i] = _mm512_load_si512(tables->low[k] + 64 * i);
            high[i] = _mm512_load_si512(tables->high[k] + 64 * i);
        }
        for (int i = 0; i < 2; i++) {
            const int8_t *at = pairs[k][i];
            const struct tap a = tap_at(rows[at[0]] + x + at[1], mask, centre, low, high);
            const struct tap b = tap_at(rows[at[2]] + x + at[3], mask, centre, low, high);
            add_pair(&sums, &a, &b);
        }
    }
    __m512i words[2];
    for (int i = 0; i < 2; i++)
        words[i] = _mm512_packus_epi32(
            divided(sums.sum[2 * i], _mm512_unpacklo_epi16(sums.norm[i], zero)),
            divided(sums.sum[2 * i + 1], _mm512_unpackhi_epi16(sums.norm[i], zero)));
    return _mm512_packus_epi16(words[0], words[1]);
}

void fv_k_bilateral_row_u8__avx512icl(uint8_t *out, const uint8_t *const *rows, int32_t width,
                                      const uint16_t weights[3][256])
{
    struct byte_tables tables;
    const uint8_t *const five[5] = {rows[0], rows[1], rows[2], rows[3], rows[4]};
    split(&tables, weights);
    bilateral_ends(out, rows, width, weights);
    for (int32_t x = 2; x < width - 2; x += 64) {
        const int32_t left = width - 2 - x;
        const __mmask64 mask = left >= 64 ? ~UINT64_C(0) : (UINT64_C(1) << left) - 1;
        _mm512_mask_storeu_epi8(out + x, mask, sixty_four(five, x, mask, &tables));
    }
}
