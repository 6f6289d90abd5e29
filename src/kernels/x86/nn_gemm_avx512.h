/* The matrix product with vpdpbusd, for the files of the VNNI and the Ice Lake set. A tile is ROWS
 * rows times BLOCKS blocks of 16 channels; its accumulators fill the registers. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_AVX512_H
#define FOVEA_KERNELS_X86_NN_GEMM_AVX512_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

enum { CHUNK_ROWS = 48, CHUNK_ROWS_MAX = 72, TILE_ROWS_MAX = 12, ROWS_HELD = 9 };

/* A tile: ROWS rows from `in` on, all of which are read. */
struct tile_job {
    const struct fv_nn_gemm *g;
    const uint8_t *const *in;
    const int32_t *offsets;  /* of groups of four inputs; NULL: they follow each other */
    const int8_t *weights;   /* of the first block */
    const int32_t *bias;     /* likewise */
    const int32_t *row_sums; /* times the factor, by row */
    uint8_t *const *out;
    ptrdiff_t column; /* of the outputs */
    int32_t rows;     /* of which outputs are wanted */
};

FV_INLINE __m512i broadcast4(const uint8_t *bytes)
{
    int32_t word;
    memcpy(&word, bytes, 4);
    return _mm512_set1_epi32(word);
}

/* The products of one group of four inputs, `at` bytes past each row. The address of the last rows
 * is read each time: there are not registers enough for all, and compilers would move addresses
 * from and to vector registers, which takes the place of products. */
FV_INLINE void accumulate_group(const uint8_t *const *row, const uint8_t *const volatile *rest,
                                ptrdiff_t at, const int8_t *w, ptrdiff_t block, const int ROWS,
                                const int BLOCKS, __m512i *acc)
{
    __m512i v[4];
#pragma GCC unroll 4
    for (int b = 0; b < BLOCKS; b++)
        v[b] = _mm512_load_si512(w + b * block);
#pragma GCC unroll 12
    for (int i = 0; i < ROWS; i++) {
        const uint8_t *from = i < ROWS_HELD ? row[i] : rest[i - ROWS_HELD];
        const __m512i x = broadcast4(from + at);
#pragma GCC unroll 4
        for (int b = 0; b < BLOCKS; b++)
            acc[i * BLOCKS + b] = _mm512_dpbusd_epi32(acc[i * BLOCKS + b], x, v[b]);
    }
}

/* `APART`: groups of inputs lie apart. */
FV_INLINE void accumulate(const struct tile_job *j, const int ROWS, const int BLOCKS,
                          const int APART, __m512i *acc)
{
    const uint8_t *row[ROWS_HELD], *volatile rest[TILE_ROWS_MAX - ROWS_HELD];
    const ptrdiff_t block = (ptrdiff_t)j->g->k4 * 64;
#pragma GCC unroll 12
    for (int i = 0; i < ROWS; i++) {
        if (i < ROWS_HELD)
            row[i] = j->in[i];
        else
            rest[i - ROWS_HELD] = j->in[i];
        const __m512i sum = _mm512_set1_epi32(j->row_sums[i]);
#pragma GCC unroll 4
        for (int b = 0; b < BLOCKS; b++)
            acc[i * BLOCKS + b] = _mm512_add_epi32(_mm512_load_si512(j->bias + 16 * b), sum);
    }
    const int8_t *w = j->weights;
    if (APART) {
        const int32_t *end = j->offsets + j->g->k4;
        for (const int32_t *offset = j->offsets; offset < end; offset++, w += 64)
            accumulate_group(row, rest, *offset, w, block, ROWS, BLOCKS, acc);
        return;
    }
    const ptrdiff_t bytes = (ptrdiff_t)j->g->k4 * 4;
    for (ptrdiff_t k = 0; k < bytes; k += 4, w += 64)
        accumulate_group(row, rest, k, w, block, ROWS, BLOCKS, acc);
}

struct store_job {
    struct down16 scale[4];
    struct table64 table;
    __m512i zero, low, high, order;
    __mmask64 mask;
    const uint8_t *lookup;
};

/* `group` rows of BLOCKS blocks fill one register of bytes. */
FV_INLINE void store_bytes(__mmask64 mask, __m512i bytes, uint8_t *const *out, ptrdiff_t column,
                           int32_t rows, const int BLOCKS)
{
    if (BLOCKS >= 3) {
        _mm512_mask_storeu_epi8(out[0] + column, mask, bytes);
    } else if (BLOCKS == 2) {
        _mm256_mask_storeu_epi8(out[0] + column, (__mmask32)mask, _mm512_castsi512_si256(bytes));
        if (rows > 1)
            _mm256_mask_storeu_epi8(out[1] + column, (__mmask32)mask,
                                    _mm512_extracti64x4_epi64(bytes, 1));
    } else {
        _mm_mask_storeu_epi8(out[0] + column, (__mmask16)mask, _mm512_castsi512_si128(bytes));
        if (rows > 1)
            _mm_mask_storeu_epi8(out[1] + column, (__mmask16)mask,
                                 _mm512_extracti32x4_epi32(bytes, 1));
        if (rows > 2)
            _mm_mask_storeu_epi8(out[2] + column, (__mmask16)mask,
                                 _mm512_extracti32x4_epi32(bytes, 2));
        if (rows > 3)
            _mm_mask_storeu_epi8(out[3] + column, (__mmask16)mask,
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
                       const int BLOCKS, const int APART, const int above)
{
    const int group = BLOCKS == 1 ? 4 : BLOCKS == 2 ? 2 : 1;
    __m512i acc[24];
    accumulate(j, ROWS, BLOCKS, APART, acc);
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
        store_bytes(s->mask, _mm512_permutexvar_epi32(s->order, bytes), j->out + i, j->column,
                    j->rows - i, BLOCKS);
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

/* Rows that are done together: at least as many `in` and `sums` as a tile has rows. */
struct chunk {
    const uint8_t *const *in;
    uint8_t *const *out;
    const int32_t *sums;
    int32_t m;
};

FV_INLINE void column_u8(struct tile_job *j, const struct store_job *s, const struct chunk *c,
                         const int ROWS, const int BLOCKS, const int APART, const int above)
{
    const int32_t m = c->m;
    for (int32_t i = 0; i < m; i += ROWS) {
        const int32_t at =
            i + ROWS > m && m >= ROWS ? m - ROWS : i; /* the last tile overlaps the one before */
        j->in = c->in + at;
        j->row_sums = c->sums + at;
        j->out = c->out + at;
        j->rows = m - at < ROWS ? m - at : ROWS;
        tile_u8(j, s, ROWS, BLOCKS, APART, above);
    }
}

#define COLUMN(rows, blocks)                                                                       \
    static __attribute__((noinline)) void column_##rows##x##blocks(                                \
        struct tile_job *j, const struct store_job *s, const struct chunk *c)                      \
    {                                                                                              \
        const int above = j->g->act_min >= j->g->zero_out, apart = j->offsets != NULL;             \
        if (apart && above)                                                                        \
            column_u8(j, s, c, rows, blocks, 1, 1);                                                \
        else if (apart)                                                                            \
            column_u8(j, s, c, rows, blocks, 1, 0);                                                \
        else if (above)                                                                            \
            column_u8(j, s, c, rows, blocks, 0, 1);                                                \
        else                                                                                       \
            column_u8(j, s, c, rows, blocks, 0, 0);                                                \
    }
COLUMN(6, 4)
COLUMN(2, 4)
COLUMN(8, 3)
COLUMN(2, 3)
COLUMN(12, 2)
COLUMN(2, 2)
COLUMN(12, 1)
COLUMN(2, 1)

static inline void column(int32_t blocks, struct tile_job *j, const struct store_job *s,
                          const struct chunk *c)
{
    const int few = c->m <= 2;
    if (blocks == 4)
        (few ? column_2x4 : column_6x4)(j, s, c);
    else if (blocks == 3)
        (few ? column_2x3 : column_8x3)(j, s, c);
    else if (blocks == 2)
        (few ? column_2x2 : column_12x2)(j, s, c);
    else
        (few ? column_2x1 : column_12x1)(j, s, c);
}

/* Blocks for the next column of tiles: fours, and what is left in equal parts. */
static inline int32_t next_blocks(int32_t left)
{
    return left == 5 ? 3 : left >= 4 ? 4 : left;
}

static inline void init_store(struct store_job *s, const struct fv_nn_gemm *g)
{
    s->zero = _mm512_set1_epi16((short)g->zero_out);
    s->low = _mm512_set1_epi8((char)g->act_min);
    s->high = _mm512_set1_epi8((char)g->act_max);
    s->order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    s->lookup = g->table;
    load_table(&s->table, g->table);
}

/* All channels of a chunk, a column of tiles after the other. */
static inline void columns(struct tile_job *j, struct store_job *s, const struct chunk *chunk)
{
    const struct fv_nn_gemm *g = j->g;
    const int32_t blocks = (g->n + 15) / 16;
    for (int32_t b = 0, count; b < blocks; b += count) {
        count = next_blocks(blocks - b);
        const int32_t width = g->n - 16 * b < 16 * count ? g->n - 16 * b : 16 * count;
        for (int32_t c = 0; c < count; c++)
            load_down(&s->scale[c], g->multiplier + 16 * (b + c), g->shift + 16 * (b + c));
        s->mask = ~UINT64_C(0) >> (64 - width);
        j->weights = g->weights + (ptrdiff_t)b * g->k4 * 64;
        j->bias = g->bias + 16 * b;
        j->column = 16 * b;
        column(count, j, s, chunk);
    }
}

/* Rows of the next chunk. */
static inline int32_t next_rows(int32_t left)
{
    return left <= CHUNK_ROWS_MAX ? left : CHUNK_ROWS;
}

static inline void gemm_u8(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    if (!all_down(g->multiplier, g->shift, g->n)) {
        fv_k_nn_gemm_u8__avx2(g, a, lda, out, ldo, m);
        return;
    }
    struct tile_job j = {.g = g};
    struct store_job s;
    const uint8_t *from[CHUNK_ROWS_MAX];
    uint8_t *to[CHUNK_ROWS_MAX];
    int32_t sums[CHUNK_ROWS_MAX] = {0};
    init_store(&s, g);
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = next_rows(m - i);
        for (int32_t r = 0; r < rows; r++) {
            from[r] = a + (i + r) * lda;
            to[r] = out + (i + r) * ldo;
        }
        for (int32_t r = rows; r < TILE_ROWS_MAX; r++) /* read in place of what is not there */
            from[r] = from[rows - 1];
        if (g->row_sum_factor != 0) sum_rows(g, a + i * lda, lda, rows, sums);
        const struct chunk chunk = {.in = from, .out = to, .sums = sums, .m = rows};
        columns(&j, &s, &chunk);
    }
}

static inline void apart_u8(const struct fv_nn_gemm *g, const uint8_t *const *in,
                            const int32_t *offsets, uint8_t *const *out, int32_t m)
{
    if (!all_down(g->multiplier, g->shift, g->n)) {
        fv_k_nn_apart_u8__c(g, in, offsets, out, m);
        return;
    }
    struct tile_job j = {.g = g, .offsets = offsets};
    struct store_job s;
    const uint8_t *few[TILE_ROWS_MAX];
    const int32_t sums[CHUNK_ROWS_MAX] = {0};
    init_store(&s, g);
    if (m < TILE_ROWS_MAX) {
        for (int32_t r = 0; r < TILE_ROWS_MAX; r++)
            few[r] = in[r < m ? r : m - 1];
        in = few;
    }
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = next_rows(m - i);
        const struct chunk chunk = {.in = in + i, .out = out + i, .sums = sums, .m = rows};
        columns(&j, &s, &chunk);
    }
}

#endif
