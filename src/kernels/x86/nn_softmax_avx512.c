/* Softmax of short rows, 16 beside each other: a lane holds a row, so that all steps but the
 * look-up of the exponentials are done for 16 rows at once. Longer rows are left to AVX2. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

enum { ROWS = 16, DEPTH_MAX = 16, GROUPS = 8 };

/* 16 rows, of which the first `count` are there. */
struct rows {
    const uint8_t *in;
    uint8_t *out;
    int32_t depth, count;
};

/* fv_nn_high_product, of two that are not both -2^31. */
FV_INLINE __m512i high_product(__m512i a, __m512i b)
{
    const __m512i half = _mm512_set1_epi64(INT64_C(1) << 30);
    const __m512i even = _mm512_add_epi64(_mm512_mul_epi32(a, b), half);
    const __m512i odd = _mm512_add_epi64(
        _mm512_mul_epi32(_mm512_srli_epi64(a, 32), _mm512_srli_epi64(b, 32)), half);
    return _mm512_mask_mov_epi32(_mm512_srli_epi64(even, 31), 0xAAAA, _mm512_slli_epi64(odd, 1));
}

FV_INLINE __mmask16 row_mask(const struct rows *r, int row)
{
    return row < r->count ? (__mmask16)((1u << r->depth) - 1) : 0;
}

FV_INLINE __m128i load_row(const struct rows *r, int row)
{
    return _mm_maskz_loadu_epi8(row_mask(r, row), r->in + row * r->depth);
}

/* Rows to columns: vector q has columns 4 q to 4 q + 3, of 16 bytes each; zeros where no input is.
 */
FV_INLINE void load_columns(const struct rows *r, __m512i columns[4])
{
    const __m512i order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    __m512i v[4];
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++) { /* a lane has row i, i + 4, i + 8 or i + 12 */
        v[i] = _mm512_castsi128_si512(load_row(r, i));
        v[i] = _mm512_inserti32x4(v[i], load_row(r, i + 4), 1);
        v[i] = _mm512_inserti32x4(v[i], load_row(r, i + 8), 2);
        v[i] = _mm512_inserti32x4(v[i], load_row(r, i + 12), 3);
    }
    const __m512i low[2] = {_mm512_unpacklo_epi8(v[0], v[1]), _mm512_unpacklo_epi8(v[2], v[3])};
    const __m512i high[2] = {_mm512_unpackhi_epi8(v[0], v[1]), _mm512_unpackhi_epi8(v[2], v[3])};
    columns[0] = _mm512_permutexvar_epi32(order, _mm512_unpacklo_epi16(low[0], low[1]));
    columns[1] = _mm512_permutexvar_epi32(order, _mm512_unpackhi_epi16(low[0], low[1]));
    columns[2] = _mm512_permutexvar_epi32(order, _mm512_unpacklo_epi16(high[0], high[1]));
    columns[3] = _mm512_permutexvar_epi32(order, _mm512_unpackhi_epi16(high[0], high[1]));
}

/* The distance of each element from the largest of its row, by columns. */
FV_INLINE void distances(const struct rows *r, uint8_t *to)
{
    __m512i columns[4];
    load_columns(r, columns);
    __m512i most = _mm512_max_epu8(_mm512_max_epu8(columns[0], columns[1]),
                                   _mm512_max_epu8(columns[2], columns[3]));
    most = _mm512_max_epu8(most, _mm512_shuffle_i32x4(most, most, 0x4E));
    most = _mm512_max_epu8(most, _mm512_shuffle_i32x4(most, most, 0xB1));
#pragma GCC unroll 4
    for (int q = 0; q < 4; q++)
        _mm512_storeu_si512(to + 64 * q, _mm512_sub_epi8(most, columns[q]));
}

/* fv_nn_reciprocal of 16 sums, each at least 2^19, and what the products are shifted by: no step
 * saturates but the last, where the mantissa is 0. */
FV_INLINE __m512i reciprocals(__m512i sums, __m512i *exponent)
{
    const __m512i zeros = _mm512_lzcnt_epi32(sums);
    *exponent =
        _mm512_min_epi32(_mm512_max_epi32(_mm512_sub_epi32(_mm512_set1_epi32(12 + 31 - 8), zeros),
                                          _mm512_setzero_si512()),
                         _mm512_set1_epi32(31));
    const __m512i mantissa =
        _mm512_sub_epi32(_mm512_sllv_epi32(sums, zeros), _mm512_set1_epi32(INT32_MIN));
    const __m512i half =
        _mm512_add_epi32(_mm512_srli_epi32(mantissa, 1), _mm512_set1_epi32(1 << 30));
    __m512i y = _mm512_add_epi32(_mm512_set1_epi32(1515870810),
                                 high_product(half, _mm512_set1_epi32(-1010580540)));
    for (int i = 0; i < 3; i++) {
        const __m512i error = _mm512_sub_epi32(_mm512_set1_epi32(1 << 29), high_product(half, y));
        y = _mm512_add_epi32(y, _mm512_slli_epi32(high_product(y, error), 2));
    }
    const __m512i twice = _mm512_add_epi32(y, y); /* at most 2^31, from which one is taken off */
    return _mm512_sub_epi32(twice, _mm512_srli_epi32(twice, 31));
}

/* Bytes of 16 rows from vectors of four columns: lane l of vector q has columns 4 q to 4 q + 3 of
 * rows 4 l to 4 l + 3. */
FV_INLINE void store_rows(const struct rows *r, const __m512i fours[4])
{
    const __m512i turn =
        _mm512_broadcast_i32x4(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
    __m512i v[4], row[4];
#pragma GCC unroll 4
    for (int q = 0; q < 4; q++)
        v[q] = _mm512_shuffle_epi8(fours[q], turn);
    const __m512i low[2] = {_mm512_unpacklo_epi32(v[0], v[1]), _mm512_unpacklo_epi32(v[2], v[3])};
    const __m512i high[2] = {_mm512_unpackhi_epi32(v[0], v[1]), _mm512_unpackhi_epi32(v[2], v[3])};
    row[0] = _mm512_unpacklo_epi64(low[0], low[1]);
    row[1] = _mm512_unpackhi_epi64(low[0], low[1]);
    row[2] = _mm512_unpacklo_epi64(high[0], high[1]);
    row[3] = _mm512_unpackhi_epi64(high[0], high[1]);
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++) {
        uint8_t *to = r->out + i * r->depth;
        _mm_mask_storeu_epi8(to, row_mask(r, i), _mm512_castsi512_si128(row[i]));
        _mm_mask_storeu_epi8(to + 4 * r->depth, row_mask(r, i + 4),
                             _mm512_extracti32x4_epi32(row[i], 1));
        _mm_mask_storeu_epi8(to + 8 * r->depth, row_mask(r, i + 8),
                             _mm512_extracti32x4_epi32(row[i], 2));
        _mm_mask_storeu_epi8(to + 12 * r->depth, row_mask(r, i + 12),
                             _mm512_extracti32x4_epi32(row[i], 3));
    }
}

/* GROUPS times 16 rows, step by step: the steps of one group wait for each other, those of all do
 * not. A column of the exponentials `e` has those of 16 rows. */
struct groups {
    struct rows of[GROUPS];
    int32_t count;
    uint8_t away[GROUPS][DEPTH_MAX * ROWS];
    int32_t e[GROUPS][DEPTH_MAX * ROWS];
    __m512i factor[GROUPS], exponent[GROUPS];
};

FV_INLINE void look_up_exponentials(struct groups *g, const int32_t *exps, int32_t depth)
{
    for (int32_t i = 0; i < g->count; i++) {
        for (int32_t k = 0; k < depth * ROWS; k++)
            g->e[i][k] = exps[g->away[i][k]];
    }
}

FV_INLINE void scale_group(struct groups *g, int32_t i, int32_t depth)
{
    __m512i sums = _mm512_setzero_si512();
    for (int32_t c = 0; c < depth; c++) {
        const __m512i some =
            _mm512_max_epi32(_mm512_loadu_si512(g->e[i] + c * ROWS), _mm512_setzero_si512());
        sums = _mm512_add_epi32(
            sums, _mm512_srli_epi32(_mm512_add_epi32(some, _mm512_set1_epi32(1 << 11)), 12));
    }
    g->factor[i] = reciprocals(sums, &g->exponent[i]);
}

FV_INLINE void store_group(const struct groups *g, int32_t i, int32_t depth)
{
    const __m512i zero = _mm512_setzero_si512(), factor = g->factor[i], exponent = g->exponent[i];
    const __m512i bias = _mm512_srli_epi32(_mm512_sllv_epi32(_mm512_set1_epi32(1), exponent), 1);
    __m512i fours[4] = {zero, zero, zero, zero};
    for (int32_t q = 0; 4 * q < depth; q++) {
        __m512i v[4];
#pragma GCC unroll 4
        for (int k = 0; k < 4; k++) { /* what is left out is -1: its product is zero or below */
            const int32_t c = 4 * q + k < depth ? 4 * q + k : depth - 1;
            const __m512i some = high_product(_mm512_loadu_si512(g->e[i] + c * ROWS), factor);
            v[k] =
                _mm512_srlv_epi32(_mm512_add_epi32(_mm512_max_epi32(some, zero), bias), exponent);
        }
        fours[q] =
            _mm512_packus_epi16(_mm512_packs_epi32(v[0], v[1]), _mm512_packs_epi32(v[2], v[3]));
    }
    store_rows(&g->of[i], fours);
}

static inline void some_groups(struct groups *g, const int32_t *exps, int32_t depth)
{
    for (int32_t i = 0; i < g->count; i++)
        distances(&g->of[i], g->away[i]);
    look_up_exponentials(g, exps, depth);
    for (int32_t i = 0; i < g->count; i++)
        scale_group(g, i, depth);
    for (int32_t i = 0; i < g->count; i++)
        store_group(g, i, depth);
}

void fv_k_nn_softmax_u8__avx512(const int32_t *exps, const uint8_t *in, uint8_t *out, int32_t depth,
                                int32_t rows)
{
    struct groups g;
    if (depth > DEPTH_MAX) {
        fv_k_nn_softmax_u8__avx2(exps, in, out, depth, rows);
        return;
    }
    for (int32_t first = 0; first < rows;) {
        for (g.count = 0; g.count < GROUPS && first < rows; g.count++, first += ROWS) {
            const ptrdiff_t at = (ptrdiff_t)first * depth;
            g.of[g.count] = (struct rows){.in = in + at,
                                          .out = out + at,
                                          .depth = depth,
                                          .count = rows - first < ROWS ? rows - first : ROWS};
        }
        some_groups(&g, exps, depth);
    }
}
