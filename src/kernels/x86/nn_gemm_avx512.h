/* The matrix product with vpdpbusd, for the files of the VNNI and the Ice Lake set. A tile is ROWS
 * rows times BLOCKS blocks of 16 channels; its accumulators fill the registers. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_AVX512_H
#define FOVEA_KERNELS_X86_NN_GEMM_AVX512_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

enum { CHUNK_ROWS = 48, CHUNK_ROWS_MAX = 72, TILE_ROWS_MAX = 12 };

struct tile_job {
    const struct fv_nn_gemm *g;
    const uint8_t *a;
    ptrdiff_t lda;
    const int8_t *weights; /* of the first block */
    const int32_t *bias;
    const int32_t *row_sums; /* times the factor, by row; NULL: none */
    int32_t rows;            /* valid rows, at most ROWS */
};

FV_INLINE __m512i broadcast4(const uint8_t *bytes)
{
    int32_t word;
    memcpy(&word, bytes, 4);
    return _mm512_set1_epi32(word);
}

FV_INLINE void accumulate(const struct tile_job *j, const int ROWS, const int BLOCKS, __m512i *acc)
{
    const uint8_t *row[TILE_ROWS_MAX];
    const ptrdiff_t block = (ptrdiff_t)j->g->k4 * 64;
#pragma GCC unroll 12
    for (int i = 0; i < ROWS; i++) {
        const int at = i < j->rows ? i : j->rows - 1;
        row[i] = j->a + at * j->lda;
        const __m512i sum = _mm512_set1_epi32(j->row_sums == NULL ? 0 : j->row_sums[at]);
#pragma GCC unroll 4
        for (int b = 0; b < BLOCKS; b++)
            acc[i * BLOCKS + b] = _mm512_add_epi32(_mm512_load_si512(j->bias + 16 * b), sum);
    }
    const int8_t *w = j->weights;
    const ptrdiff_t bytes = (ptrdiff_t)j->g->k4 * 4;
    for (ptrdiff_t k = 0; k < bytes; k += 4, w += 64) {
        __m512i v[4];
#pragma GCC unroll 4
        for (int b = 0; b < BLOCKS; b++)
            v[b] = _mm512_load_si512(w + b * block);
#pragma GCC unroll 12
        for (int i = 0; i < ROWS; i++) {
            const __m512i x = broadcast4(row[i] + k);
#pragma GCC unroll 4
            for (int b = 0; b < BLOCKS; b++)
                acc[i * BLOCKS + b] = _mm512_dpbusd_epi32(acc[i * BLOCKS + b], x, v[b]);
        }
    }
}

struct store_job {
    struct down16 scale[4];
    struct table64 table;
    __m512i zero, low, high, order;
    __mmask64 mask;
    uint8_t *out;
    ptrdiff_t ldo;
    const uint8_t *lookup;
};

/* `group` rows of BLOCKS blocks fill one register of bytes. */
FV_INLINE void store_bytes(const struct store_job *s, __m512i bytes, int32_t first, int32_t rows,
                           const int BLOCKS)
{
    uint8_t *out = s->out + first * s->ldo;
    if (BLOCKS >= 3) {
        _mm512_mask_storeu_epi8(out, s->mask, bytes);
    } else if (BLOCKS == 2) {
        _mm256_mask_storeu_epi8(out, (__mmask32)s->mask, _mm512_castsi512_si256(bytes));
        if (rows > 1)
            _mm256_mask_storeu_epi8(out + s->ldo, (__mmask32)s->mask,
                                    _mm512_extracti64x4_epi64(bytes, 1));
    } else {
        _mm_mask_storeu_epi8(out, (__mmask16)s->mask, _mm512_castsi512_si128(bytes));
        if (rows > 1)
            _mm_mask_storeu_epi8(out + s->ldo, (__mmask16)s->mask,
                                 _mm512_extracti32x4_epi32(bytes, 1));
        if (rows > 2)
            _mm_mask_storeu_epi8(out + 2 * s->ldo, (__mmask16)s->mask,
                                 _mm512_extracti32x4_epi32(bytes, 2));
        if (rows > 3)
            _mm_mask_storeu_epi8(out + 3 * s->ldo, (__mmask16)s->mask,
                                 _mm512_extracti32x4_epi32(bytes, 3));
    }
}

/* Block by block, so that its constants are loaded once. */
FV_INLINE void scale_block(__m512i *acc, const struct down16 *constants, const int ROWS,
                           const int BLOCKS, const int b, const int above)
{
    const struct down16 scale = *constants;
#pragma GCC unroll 12
    for (int i = 0; i < ROWS; i++)
        acc[i * BLOCKS + b] = requantize_down(acc[i * BLOCKS + b], &scale, above);
}

FV_INLINE void tile_u8(const struct tile_job *j, const struct store_job *s, const int ROWS,
                       const int BLOCKS, const int above)
{
    const int group = BLOCKS == 1 ? 4 : BLOCKS == 2 ? 2 : 1;
    __m512i acc[24];
    accumulate(j, ROWS, BLOCKS, acc);
#ifndef __clang__
    /* From here on other registers: else gcc, which has none left below, keeps some of the
     * accumulators in memory, in the innermost loop too. */
#pragma GCC unroll 24
    for (int i = 0; i < ROWS * BLOCKS; i++)
        __asm__("" : "+v"(acc[i]));
#endif
    if (BLOCKS > 0) scale_block(acc, &s->scale[0], ROWS, BLOCKS, 0, above);
    if (BLOCKS > 1) scale_block(acc, &s->scale[1], ROWS, BLOCKS, 1, above);
    if (BLOCKS > 2) scale_block(acc, &s->scale[2], ROWS, BLOCKS, 2, above);
    if (BLOCKS > 3) scale_block(acc, &s->scale[3], ROWS, BLOCKS, 3, above);
#pragma GCC unroll 12
    for (int i = 0; i < ROWS; i += group) {
        if (i >= j->rows) break;
        __m512i r[4];
#pragma GCC unroll 4
        for (int b = 0; b < 4; b++) {
            const int row = i + b / BLOCKS;
            const int used = BLOCKS == 3 ? b < 3 : row < ROWS;
            r[b] = used ? acc[row * BLOCKS + b % BLOCKS] : r[0];
        }
        __m512i bytes = pack_lanes(r[0], r[1], r[2], r[3], s->zero, s->low, s->high);
        if (s->lookup != NULL) bytes = look_up(bytes, &s->table);
        store_bytes(s, _mm512_permutexvar_epi32(s->order, bytes), i, j->rows - i, BLOCKS);
    }
}

/* Factor times the sum of a row's k bytes, for each row of a chunk. */
static inline void sum_rows(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                            int32_t rows, int32_t *sums)
{
    const __m512i ones = _mm512_set1_epi8(1);
    for (int32_t i = 0; i < rows; i++, a += lda) {
        __m512i sum = _mm512_setzero_si512();
        int32_t k = 0;
        for (; k + 64 <= g->k; k += 64)
            sum = _mm512_dpbusd_epi32(sum, _mm512_loadu_si512(a + k), ones);
        if (k < g->k) {
            const __mmask64 rest = ~UINT64_C(0) >> (64 - (g->k - k));
            sum = _mm512_dpbusd_epi32(sum, _mm512_maskz_loadu_epi8(rest, a + k), ones);
        }
        sums[i] = (int32_t)((uint32_t)_mm512_reduce_add_epi32(sum) * (uint32_t)g->row_sum_factor);
    }
}

FV_INLINE void column_u8(struct tile_job *j, struct store_job *s, const uint8_t *a,
                         const int32_t *sums, int32_t m, uint8_t *out, const int ROWS,
                         const int BLOCKS, const int above)
{
    for (int32_t i = 0; i < m; i += ROWS) {
        const int32_t at =
            i + ROWS > m && m >= ROWS ? m - ROWS : i; /* the last tile overlaps the one before */
        j->a = a + at * j->lda;
        j->row_sums = sums == NULL ? NULL : sums + at;
        j->rows = m - at < ROWS ? m - at : ROWS;
        s->out = out + at * s->ldo;
        tile_u8(j, s, ROWS, BLOCKS, above);
    }
}

#define COLUMN(rows, blocks)                                                                       \
    static __attribute__((noinline)) void column_##rows##x##blocks(                                \
        struct tile_job *j, struct store_job *s, const uint8_t *a, const int32_t *sums, int32_t m, \
        uint8_t *out, int above)                                                                   \
    {                                                                                              \
        if (above)                                                                                 \
            column_u8(j, s, a, sums, m, out, rows, blocks, 1);                                     \
        else                                                                                       \
            column_u8(j, s, a, sums, m, out, rows, blocks, 0);                                     \
    }
COLUMN(6, 4)
COLUMN(2, 4)
COLUMN(8, 3)
COLUMN(2, 3)
COLUMN(12, 2)
COLUMN(2, 2)
COLUMN(12, 1)
COLUMN(2, 1)

static inline void column(int32_t blocks, struct tile_job *j, struct store_job *s, const uint8_t *a,
                          const int32_t *sums, int32_t m, uint8_t *out, int above)
{
    const int few = m <= 2;
    if (blocks == 4)
        (few ? column_2x4 : column_6x4)(j, s, a, sums, m, out, above);
    else if (blocks == 3)
        (few ? column_2x3 : column_8x3)(j, s, a, sums, m, out, above);
    else if (blocks == 2)
        (few ? column_2x2 : column_12x2)(j, s, a, sums, m, out, above);
    else
        (few ? column_2x1 : column_12x1)(j, s, a, sums, m, out, above);
}

/* Blocks for the next column of tiles: fours, and what is left in equal parts. */
static inline int32_t next_blocks(int32_t left)
{
    return left == 5 ? 3 : left >= 4 ? 4 : left;
}

static inline void gemm_u8(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    if (!all_down(g->multiplier, g->shift, g->n)) {
        fv_k_nn_gemm_u8__avx2(g, a, lda, out, ldo, m);
        return;
    }
    const int32_t blocks = (g->n + 15) / 16;
    const int above = g->act_min >= g->zero_out;
    struct tile_job j = {.g = g, .lda = lda};
    struct store_job s;
    int32_t sums[CHUNK_ROWS_MAX];
    s.zero = _mm512_set1_epi16((short)g->zero_out);
    s.low = _mm512_set1_epi8((char)g->act_min);
    s.high = _mm512_set1_epi8((char)g->act_max);
    s.order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    s.ldo = ldo;
    s.lookup = g->table;
    load_table(&s.table, g->table);
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = m - i <= CHUNK_ROWS_MAX ? m - i : CHUNK_ROWS;
        if (g->row_sum_factor != 0) sum_rows(g, a + i * lda, lda, rows, sums);
        for (int32_t b = 0, count; b < blocks; b += count) {
            count = next_blocks(blocks - b);
            const int32_t width = g->n - 16 * b < 16 * count ? g->n - 16 * b : 16 * count;
            for (int32_t c = 0; c < count; c++)
                load_down(&s.scale[c], g->multiplier + 16 * (b + c), g->shift + 16 * (b + c));
            s.mask = ~UINT64_C(0) >> (64 - width);
            j.weights = g->weights + (ptrdiff_t)b * g->k4 * 64;
            j.bias = g->bias + 16 * b;
            column(count, &j, &s, a + i * lda, g->row_sum_factor != 0 ? sums : NULL, rows,
                   out + i * ldo + 16 * b, above);
        }
    }
}

#endif
