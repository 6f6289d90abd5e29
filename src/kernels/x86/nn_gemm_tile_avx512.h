/* A tile of the matrix product with vpdpbusd: ROWS rows times BLOCKS blocks of 16 channels. Its
 * accumulators fill the registers. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_TILE_AVX512_H
#define FOVEA_KERNELS_X86_NN_GEMM_TILE_AVX512_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

enum { CHUNK_ROWS = 48, CHUNK_ROWS_MAX = 72, TILE_ROWS_MAX = 12, ROWS_HELD = 8 };

/* A tile: ROWS rows from `in` on, all of which are read. */
struct tile_job {
    const struct fv_nn_gemm *g;
    const uint8_t *const *in;
    const int32_t *offsets;  /* of groups of four inputs; NULL: they follow each other */
    const int8_t *weights;   /* of the first block */
    const int32_t *bias;     /* likewise */
    const int32_t *row_sums; /* times the factor, by row; NULL: all 0 */
    uint8_t *const *out;
    ptrdiff_t column; /* of the outputs */
    int32_t rows;     /* of which outputs are wanted */
    ptrdiff_t ahead;  /* bytes from weights to those that are fetched meanwhile */
};

FV_INLINE __m512i broadcast4(const uint8_t *bytes)
{
    int32_t word;
    memcpy(&word, bytes, 4);
    return _mm512_set1_epi32(word);
}

/* The products of one group of four inputs, `at` bytes past each row. `AHEAD`: weights that many
 * bytes further are fetched into the second-level cache. The address of the last rows
 * is read each time: there are not registers enough for all, and compilers would move addresses
 * from and to vector registers, which takes the place of products. */
FV_INLINE void accumulate_group(const uint8_t *const *row, const uint8_t *const volatile *rest,
                                ptrdiff_t at, const int8_t *w, ptrdiff_t block, ptrdiff_t ahead,
                                const int ROWS, const int BLOCKS, const int AHEAD, __m512i *acc)
{
    __m512i v[4];
    if (AHEAD) _mm_prefetch((const void *)((uintptr_t)w + (uintptr_t)ahead), _MM_HINT_T1);
#pragma GCC unroll 4
    for (int b = 0; b < BLOCKS; b++)
        v[b] = _mm512_load_si512(w + b * block);
#pragma GCC unroll 16
    for (int i = 0; i < ROWS; i++) {
        const uint8_t *from = i < ROWS_HELD ? row[i] : rest[i - ROWS_HELD];
        const __m512i x = broadcast4(from + at);
#pragma GCC unroll 4
        for (int b = 0; b < BLOCKS; b++)
            acc[i * BLOCKS + b] = _mm512_dpbusd_epi32(acc[i * BLOCKS + b], x, v[b]);
    }
}

/* The sums begin with the biases and what is known of the rows. */
FV_INLINE void start_sums(const struct tile_job *j, const int ROWS, const int BLOCKS, __m512i *acc)
{
#pragma GCC unroll 4
    for (int b = 0; b < BLOCKS; b++) {
        const __m512i bias = _mm512_load_si512(j->bias + 16 * b);
#pragma GCC unroll 16
        for (int i = 0; i < ROWS; i++)
            acc[i * BLOCKS + b] = bias;
    }
    if (j->row_sums == NULL) return;
#pragma GCC unroll 16
    for (int i = 0; i < ROWS; i++) {
#pragma GCC unroll 4
        for (int b = 0; b < BLOCKS; b++)
            acc[i * BLOCKS + b] =
                _mm512_add_epi32(acc[i * BLOCKS + b], _mm512_set1_epi32(j->row_sums[i]));
    }
}

/* `APART`: groups of inputs lie apart. */
FV_INLINE void accumulate(const struct tile_job *j, const int ROWS, const int BLOCKS,
                          const int APART, const int AHEAD, __m512i *acc)
{
    const uint8_t *row[ROWS_HELD], *volatile rest[TILE_ROWS_MAX - ROWS_HELD];
    const ptrdiff_t block = (ptrdiff_t)j->g->k4 * 64;
#pragma GCC unroll 16
    for (int i = 0; i < ROWS; i++) {
        if (i < ROWS_HELD)
            row[i] = j->in[i];
        else
            rest[i - ROWS_HELD] = j->in[i];
    }
    start_sums(j, ROWS, BLOCKS, acc);
    const int8_t *w = j->weights;
    if (APART) {
        const int32_t *end = j->offsets + j->g->k4;
        for (const int32_t *offset = j->offsets; offset < end; offset++, w += 64)
            accumulate_group(row, rest, *offset, w, block, j->ahead, ROWS, BLOCKS, AHEAD, acc);
        return;
    }
    const ptrdiff_t bytes = (ptrdiff_t)j->g->k4 * 4;
    for (ptrdiff_t k = 0; k < bytes; k += 4, w += 64)
        accumulate_group(row, rest, k, w, block, j->ahead, ROWS, BLOCKS, AHEAD, acc);
}

struct pairs;

/* Rows that are done together: at least as many `in` and `sums` as a tile has rows. */
struct chunk {
    const uint8_t *const *in;
    uint8_t *const *out;
    const int32_t *sums;
    const struct pairs *pairs; /* NULL: groups are taken one by one */
    int32_t m;
    int is_only; /* of its product: weights are read once, and not again */
};

struct store_job {
    struct down16 scale[4];
    struct real16 real[4];
    int is_real[4]; /* which of both rounds the block */
    struct table64 table;
    struct clamp64 clamp;
    __m512i order;
    __mmask64 mask;
    const uint8_t *lookup;
};

/* Whether `count` rows follow each other without gap, `width` bytes each. */
FV_INLINE int are_dense(uint8_t *const *out, int count, ptrdiff_t width)
{
    int dense = out[1] - out[0] == width;
    for (int i = 2; i < count; i++)
        dense &= out[i] - out[0] == i * width;
    return dense;
}

/* The rows of one register of bytes by one store, where they are whole blocks, or half ones, that
 * follow each other. 0: they are not. */
FV_INLINE int store_dense(__mmask64 mask, __m512i bytes, uint8_t *const *out, int32_t rows,
                          const int BLOCKS)
{
    const __m512i halves = _mm512_setr_epi64(0, 2, 4, 6, 0, 2, 4, 6);
    if (BLOCKS == 2 && rows > 1 && mask == 0xFFFFFFFF && are_dense(out, 2, 32)) {
        _mm512_storeu_si512(out[0], bytes);
    } else if (BLOCKS == 1 && rows > 3 && mask == 0xFFFF && are_dense(out, 4, 16)) {
        _mm512_storeu_si512(out[0], bytes);
    } else if (BLOCKS == 1 && rows > 3 && mask == 0xFF && are_dense(out, 4, 8)) {
        const __m512i four = _mm512_permutexvar_epi64(halves, bytes);
        _mm256_storeu_si256((__m256i *)(void *)out[0], _mm512_castsi512_si256(four));
    } else {
        return 0;
    }
    return 1;
}

/* `group` rows of BLOCKS blocks fill one register of bytes. */
FV_INLINE void store_bytes(__mmask64 mask, __m512i bytes, uint8_t *const *out, ptrdiff_t column,
                           int32_t rows, const int BLOCKS)
{
    if (BLOCKS >= 3) {
        _mm512_mask_storeu_epi8(out[0] + column, mask, bytes);
    } else if (store_dense(mask, bytes, out, rows, BLOCKS)) {
        return;
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
FV_INLINE void scale_block(__m512i *acc, const struct store_job *s, const int ROWS,
                           const int BLOCKS, const int b, const int from_zero)
{
    if (s->is_real[b]) {
        const struct real16 real = s->real[b];
#pragma GCC unroll 16
        for (int i = 0; i < ROWS; i++)
            acc[i * BLOCKS + b] = requantize_real(acc[i * BLOCKS + b], &real, from_zero);
        return;
    }
    const struct down16 scale = s->scale[b];
#pragma GCC unroll 16
    for (int i = 0; i < ROWS; i++)
        acc[i * BLOCKS + b] = requantize_down(acc[i * BLOCKS + b], &scale, from_zero);
}

/* From here on other registers: else gcc, which has none left below, keeps some of the accumulators
 * in memory, in the innermost loop too. */
FV_INLINE void change_registers(__m512i *acc, const int COUNT)
{
#ifndef __clang__
#pragma GCC unroll 24
    for (int i = 0; i < COUNT; i++)
        __asm__("" : "+v"(acc[i]));
#else
    (void)acc;
    (void)COUNT;
#endif
}

FV_INLINE void tile_u8(const struct tile_job *j, const struct store_job *s, const int ROWS,
                       const int BLOCKS, const int AHEAD, const int APART, const int from_zero)
{
    const int group = BLOCKS == 1 ? 4 : BLOCKS == 2 ? 2 : 1;
    __m512i acc[24];
    accumulate(j, ROWS, BLOCKS, APART, AHEAD, acc);
    change_registers(acc, ROWS * BLOCKS);
    if (BLOCKS > 0) scale_block(acc, s, ROWS, BLOCKS, 0, from_zero);
    if (BLOCKS > 1) scale_block(acc, s, ROWS, BLOCKS, 1, from_zero);
    if (BLOCKS > 2) scale_block(acc, s, ROWS, BLOCKS, 2, from_zero);
    if (BLOCKS > 3) scale_block(acc, s, ROWS, BLOCKS, 3, from_zero);
#pragma GCC unroll 16
    for (int i = 0; i < ROWS; i += group) {
        if (i >= j->rows) break;
        __m512i r[4];
#pragma GCC unroll 4
        for (int b = 0; b < 4; b++) {
            const int row = i + b / BLOCKS;
            const int used = BLOCKS == 3 ? b < 3 : row < ROWS;
            r[b] = used ? acc[row * BLOCKS + b % BLOCKS] : r[0];
        }
        __m512i bytes = pack_lanes(r[0], r[1], r[2], r[3], &s->clamp, from_zero);
        if (s->lookup != NULL) bytes = look_up(bytes, &s->table);
        store_bytes(s->mask, _mm512_permutexvar_epi32(s->order, bytes), j->out + i, j->column,
                    j->rows - i, BLOCKS);
    }
}

#endif
