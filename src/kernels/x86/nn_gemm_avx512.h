/* The matrix product with vpdpbusd, for the files of the VNNI and the Ice Lake set. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_AVX512_H
#define FOVEA_KERNELS_X86_NN_GEMM_AVX512_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_gemm_pairs_avx512.h"
#include "kernels/x86/nn_gemm_run_avx512.h"

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

/* The tile at row `at` of a chunk. */
FV_INLINE void do_tile(struct tile_job *j, const struct store_job *s, const struct chunk *c,
                       int32_t at, const int ROWS, const int BLOCKS, const int AHEAD,
                       const int APART, const int from_zero)
{
    j->in = c->in + at;
    j->row_sums = c->sums == NULL ? NULL : c->sums + at;
    j->out = c->out + at;
    j->rows = c->m - at < ROWS ? c->m - at : ROWS;
    j->ahead = (BLOCKS + at / ROWS) * (ptrdiff_t)j->g->k4 * 64;
    tile_u8(j, s, ROWS, BLOCKS, AHEAD, APART, from_zero);
}

/* Where the tile for rows from `i` on begins: the last one of `m` overlaps the one before. */
FV_INLINE int32_t tile_at(int32_t i, int32_t m, const int ROWS)
{
    return i + ROWS > m && m >= ROWS ? m - ROWS : i;
}

FV_INLINE void column_u8(struct tile_job *j, const struct store_job *s, const struct chunk *c,
                         const int ROWS, const int BLOCKS, const int AHEAD, const int APART,
                         const int from_zero)
{
    for (int32_t i = 0; i < c->m; i += ROWS)
        do_tile(j, s, c, tile_at(i, c->m, ROWS), ROWS, BLOCKS, AHEAD, APART, from_zero);
}

/* The four variants of a function over tiles. */
#define VARIANTS(name, of, type, ...)                                                              \
    static __attribute__((noinline)) void name(struct tile_job *j, const struct store_job *s,      \
                                               const type *rows)                                   \
    {                                                                                              \
        const int from_zero = j->g->zero_out == 0, apart = j->offsets != NULL;                     \
        if (apart && from_zero)                                                                    \
            of(j, s, rows, __VA_ARGS__ 1, 1);                                                      \
        else if (apart)                                                                            \
            of(j, s, rows, __VA_ARGS__ 1, 0);                                                      \
        else if (from_zero)                                                                        \
            of(j, s, rows, __VA_ARGS__ 0, 1);                                                      \
        else                                                                                       \
            of(j, s, rows, __VA_ARGS__ 0, 0);                                                      \
    }
#define COLUMN(rows, blocks)                                                                       \
    VARIANTS(column_##rows##x##blocks, column_u8, struct chunk, rows, blocks, 0, )
COLUMN(6, 4)
COLUMN(5, 4)
/* For the only chunk of a product: each tile fetches weights of the next column, or layer. */
VARIANTS(ahead_5x4, column_u8, struct chunk, 5, 4, 1, )
VARIANTS(ahead_6x4, column_u8, struct chunk, 6, 4, 1, )
COLUMN(2, 4)
COLUMN(8, 3)
COLUMN(2, 3)
COLUMN(12, 2)
COLUMN(2, 2)
COLUMN(12, 1)
COLUMN(2, 1)
VARIANTS(run, run_u8, struct fv_nn_rows, )

static inline void column(int32_t blocks, struct tile_job *j, const struct store_job *s,
                          const struct chunk *c)
{
    const int few = c->m <= 2;
    const int by_fives = (c->m + 4) / 5 * 5 < (c->m + 5) / 6 * 6; /* they do fewer rows twice */
    if (blocks == 4 && !few && c->is_only)
        (by_fives ? ahead_5x4 : ahead_6x4)(j, s, c);
    else if (blocks == 4)
        (few ? column_2x4 : by_fives ? column_5x4 : column_6x4)(j, s, c);
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
    s->clamp = clamp_of(g->zero_out, g->act_min, g->act_max);
    s->order = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
    s->lookup = g->table;
    load_table(&s->table, g->table);
}

/* How the results of block `block`, the c-th of a column, are rounded. */
static inline void load_rounding(struct store_job *s, const struct fv_nn_gemm *g, int32_t block,
                                 int32_t c)
{
    const float *real = g->real == NULL ? NULL : g->real + (ptrdiff_t)block * 32;
    s->is_real[c] = real != NULL && real[0] != 0.0F;
    if (s->is_real[c])
        s->real[c] = (struct real16){_mm512_load_ps(real), _mm512_load_ps(real + 16)};
    else
        load_down(&s->scale[c], g->multiplier + 16 * block, g->shift + 16 * block);
}

/* `count` blocks from `b` on. */
static inline void begin_column(struct tile_job *j, struct store_job *s, int32_t b, int32_t count)
{
    const struct fv_nn_gemm *g = j->g;
    const int32_t width = g->n - 16 * b < 16 * count ? g->n - 16 * b : 16 * count;
    for (int32_t c = 0; c < count; c++)
        load_rounding(s, g, b + c, c);
    s->mask = ~UINT64_C(0) >> (64 - width);
    j->weights = g->weights + (ptrdiff_t)b * g->k4 * 64;
    j->bias = g->bias + 16 * b;
    j->column = 16 * b;
}

/* All channels of a chunk, a column of tiles after the other. */
static inline void columns(struct tile_job *j, struct store_job *s, const struct chunk *chunk)
{
    const struct fv_nn_gemm *g = j->g;
    const int32_t blocks = (g->n + 15) / 16;
    for (int32_t b = 0, count; b < blocks; b += count) {
        count = next_blocks(blocks - b);
        begin_column(j, s, b, count);
        if (chunk->pairs != NULL)
            pair_column(j, s, chunk);
        else
            column(count, j, s, chunk);
    }
}

/* Rows of the next chunk. */
static inline int32_t next_rows(int32_t left)
{
    return left <= CHUNK_ROWS_MAX ? left : CHUNK_ROWS;
}

/* Addresses of rows, up to 7 more than there are. */
static inline void list_rows(void *to, const uint8_t *first, ptrdiff_t step, int32_t rows)
{
    const __m512i turns = _mm512_setr_epi64(0, step, 2 * step, 3 * step, 4 * step, 5 * step,
                                            6 * step, 7 * step),
                  more = _mm512_set1_epi64(8 * step);
    __m512i eight = _mm512_add_epi64(_mm512_set1_epi64((int64_t)(intptr_t)first), turns);
    for (int32_t r = 0; r < rows; r += 8, eight = _mm512_add_epi64(eight, more))
        _mm512_storeu_si512((uint8_t *)to + 8 * r, eight);
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
    struct pairs pairs;
    const int paired = m >= PAIR_ROWS && find_pairs(&pairs, g, NULL);
    const uint8_t *from[CHUNK_ROWS_MAX + 8];
    uint8_t *to[CHUNK_ROWS_MAX + 8];
    int32_t sums[CHUNK_ROWS_MAX] = {0};
    const int has_sums = g->row_sum_factor != 0;
    init_store(&s, g);
    if (!paired && is_long_run(g, m)) {
        begin_column(&j, &s, 0, 1);
        run(&j, &s, &(struct fv_nn_rows){a, out, lda, ldo, m});
        return;
    }
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = next_rows(m - i);
        list_rows((void *)from, a + i * lda, lda, rows);
        list_rows((void *)to, out + i * ldo, ldo, rows);
        for (int32_t r = rows; r < TILE_ROWS_MAX; r++) /* read in place of what is not there */
            from[r] = from[rows - 1];
        if (has_sums) sum_rows(g, a + i * lda, lda, rows, sums);
        const struct chunk chunk = {.in = from,
                                    .out = to,
                                    .sums = has_sums ? sums : NULL,
                                    .pairs = paired ? &pairs : NULL,
                                    .m = rows,
                                    .is_only = rows == m};
        columns(&j, &s, &chunk);
    }
}

/* Rows that are left to do: from row `done` of the first on. */
struct rows_left {
    const struct fv_nn_rows *rows;
    int32_t done;
};

/* Addresses of the next `count` rows, up to 7 more than there are. */
static inline void list_apart(struct rows_left *l, int32_t count, const uint8_t **in, uint8_t **out)
{
    for (int32_t i = 0, some; i < count; i += some) {
        const struct fv_nn_rows *r = l->rows;
        some = r->count - l->done < count - i ? r->count - l->done : count - i;
        list_rows((void *)(in + i), r->in + l->done * r->in_step, r->in_step, some);
        list_rows((void *)(out + i), r->out + l->done * r->out_step, r->out_step, some);
        l->done += some;
        if (l->done < r->count) continue;
        l->done = 0;
        l->rows++;
    }
}

/* Rows of all runs, chunk by chunk. */
static inline void chunks_apart(struct tile_job *j, struct store_job *s, const struct pairs *pairs,
                                const struct fv_nn_rows *rows, int32_t m)
{
    struct rows_left left = {rows, 0};
    const uint8_t *in[CHUNK_ROWS_MAX + 8];
    uint8_t *out[CHUNK_ROWS_MAX + 8];
    const int is_only = m <= CHUNK_ROWS_MAX;
    for (int32_t some; m > 0; m -= some) {
        some = next_rows(m);
        list_apart(&left, some, in, out);
        for (int32_t r = some; r < TILE_ROWS_MAX; r++) /* read in place of what is not there */
            in[r] = in[some - 1];
        const struct chunk chunk = {
            .in = in, .out = out, .pairs = pairs, .m = some, .is_only = is_only};
        columns(j, s, &chunk);
    }
}

static inline void apart_u8(const struct fv_nn_gemm *g, const int32_t *offsets,
                            const struct fv_nn_rows *rows, int32_t count)
{
    if (!all_down(g->multiplier, g->shift, g->n)) {
        fv_k_nn_apart_u8__c(g, offsets, rows, count);
        return;
    }
    struct tile_job j = {.g = g, .offsets = offsets};
    struct store_job s;
    struct pairs pairs;
    int32_t m = 0, are_long = 1;
    for (int32_t i = 0; i < count; i++) {
        m += rows[i].count;
        are_long &= is_long_run(g, rows[i].count);
    }
    init_store(&s, g);
    if (m >= PAIR_ROWS && find_pairs(&pairs, g, offsets)) {
        chunks_apart(&j, &s, &pairs, rows, m);
    } else if (are_long) {
        begin_column(&j, &s, 0, 1);
        for (int32_t i = 0; i < count; i++)
            run(&j, &s, &rows[i]);
    } else {
        chunks_apart(&j, &s, NULL, rows, m);
    }
}

#endif
