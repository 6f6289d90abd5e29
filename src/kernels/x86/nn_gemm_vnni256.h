/* The matrix product with vpdpbusd on 256 bits, compiled twice: with the VEX form of AVX-VNNI
 * (processors without AVX-512) and with the EVEX form, so that any processor with AVX-512 VNNI
 * tests this page. The file that includes it defines DOT(sum, bytes, weights).
 *
 * A tile is six rows by 16 channels: twelve sums, which hide the latency of the products. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_VNNI256_H
#define FOVEA_KERNELS_X86_NN_GEMM_VNNI256_H

#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

enum { ROWS = 6, CHUNK_ROWS = 48 };

/* Factor times the sum of a row's k bytes, for each of `rows` rows. */
static void sum_rows(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t rows,
                     int32_t *sums)
{
    static const uint8_t ends[64] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
                                     1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
    const __m256i ones = _mm256_set1_epi8(1);
    const __m256i rest = _mm256_loadu_si256((const __m256i *)(const void *)(ends + 32 - g->k % 32));
    for (int32_t i = 0; i < rows; i++, a += lda) {
        __m256i sum = _mm256_setzero_si256();
        int32_t k = 0;
        sums[i] = 0;
        if (g->row_sum_factor == 0) continue;
        for (; k + 32 <= g->k; k += 32)
            sum = DOT(sum, _mm256_loadu_si256((const __m256i *)(const void *)(a + k)), ones);
        if (k < g->k)
            sum = DOT(sum, _mm256_loadu_si256((const __m256i *)(const void *)(a + k)), rest);
        const __m128i four =
            _mm_add_epi32(_mm256_castsi256_si128(sum), _mm256_extracti128_si256(sum, 1));
        const __m128i two = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4E));
        const __m128i one = _mm_add_epi32(two, _mm_shuffle_epi32(two, 0xB1));
        sums[i] = (int32_t)((uint32_t)_mm_cvtsi128_si32(one) * (uint32_t)g->row_sum_factor);
    }
}

/* Sums of N rows and the 16 channels from `c` on. */
FV_INLINE void accumulate(const struct fv_nn_gemm *g, int32_t c, const uint8_t *a, ptrdiff_t lda,
                          const int32_t *sums, const int N, __m256i acc[][2])
{
    const int8_t *w = g->weights + (ptrdiff_t)c * g->k4 * 4;
    const uint8_t *row[ROWS];
#pragma GCC unroll 6
    for (int r = 0; r < N; r++) {
        const __m256i sum = _mm256_set1_epi32(sums[r]);
        row[r] = a + r * lda;
        acc[r][0] = _mm256_add_epi32(load32(g->bias + c), sum);
        acc[r][1] = _mm256_add_epi32(load32(g->bias + c + 8), sum);
    }
    const ptrdiff_t bytes = (ptrdiff_t)g->k4 * 4;
    for (ptrdiff_t k = 0; k < bytes; k += 4, w += 64) {
        const __m256i w0 = load32(w), w1 = load32(w + 32);
#pragma GCC unroll 6
        for (int r = 0; r < N; r++) {
            const __m256i x = four_inputs(row[r] + k);
            acc[r][0] = DOT(acc[r][0], x, w0);
            acc[r][1] = DOT(acc[r][1], x, w1);
        }
    }
}

/* A whole tile, through memory: what is done with its sums has no claim on the registers of the
 * loop. */
static __attribute__((noinline)) void accumulate_tile(const struct fv_nn_gemm *g, int32_t c,
                                                      const uint8_t *a, ptrdiff_t lda,
                                                      const int32_t *sums, __m256i out[][2])
{
    __m256i acc[ROWS][2];
    accumulate(g, c, a, lda, sums, ROWS, acc);
#pragma GCC unroll 6
    for (int r = 0; r < ROWS; r++) {
        out[r][0] = acc[r][0];
        out[r][1] = acc[r][1];
    }
}

/* 16 channels of the rows of a chunk. */
struct strip {
    const struct fv_nn_gemm *g;
    const uint8_t *a;
    const int32_t *sums;
    uint8_t *out;
    ptrdiff_t lda, ldo;
    int32_t c, rows, width;
    struct scale8 scale[2];
};

FV_INLINE void strip_u8(const struct strip *s, const struct output *o, const int mode)
{
    __m256i acc[ROWS][2];
    int32_t i = 0;
    for (; i + ROWS <= s->rows; i += ROWS) {
        accumulate_tile(s->g, s->c, s->a + i * s->lda, s->lda, s->sums + i, acc);
        store_tile(o, s->scale, acc, ROWS, s->out + i * s->ldo, s->ldo, s->width, mode);
    }
    for (; i + 2 <= s->rows; i += 2) {
        accumulate(s->g, s->c, s->a + i * s->lda, s->lda, s->sums + i, 2, acc);
        store_tile(o, s->scale, acc, 2, s->out + i * s->ldo, s->ldo, s->width, mode);
    }
    if (i < s->rows) {
        accumulate(s->g, s->c, s->a + i * s->lda, s->lda, s->sums + i, 1, acc);
        store_tile(o, s->scale, acc, 1, s->out + i * s->ldo, s->ldo, s->width, mode);
    }
}

FV_INLINE void gemm_u8(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, uint8_t *out,
                       ptrdiff_t ldo, int32_t m)
{
    struct output o;
    int32_t sums[CHUNK_ROWS];
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = m - i < CHUNK_ROWS ? m - i : CHUNK_ROWS;
        sum_rows(g, a + i * lda, lda, rows, sums);
        for (int32_t c = 0; c < g->n; c += 16) {
            struct strip s = {.g = g,
                              .a = a + i * lda,
                              .sums = sums,
                              .out = out + i * ldo + c,
                              .lda = lda,
                              .ldo = ldo,
                              .c = c,
                              .rows = rows,
                              .width = g->n - c < 16 ? g->n - c : 16};
            load_scales(s.scale, g->multiplier + c, g->shift + c);
            if (g->act_min >= g->zero_out)
                strip_u8(&s, &o, TABLED | ABOVE_ZERO);
            else
                strip_u8(&s, &o, TABLED);
        }
    }
}

FV_INLINE void store_words(__m256i acc[][2], const int N, int32_t *out, ptrdiff_t ldo)
{
#pragma GCC unroll 6
    for (int r = 0; r < N; r++) {
        _mm256_storeu_si256((__m256i *)(void *)(out + r * ldo), acc[r][0]);
        _mm256_storeu_si256((__m256i *)(void *)(out + r * ldo + 8), acc[r][1]);
    }
}

FV_INLINE void gemm_i32(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t *out,
                        ptrdiff_t ldo, int32_t m)
{
    int32_t sums[CHUNK_ROWS];
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = m - i < CHUNK_ROWS ? m - i : CHUNK_ROWS;
        sum_rows(g, a + i * lda, lda, rows, sums);
        for (int32_t c = 0; c < g->n; c += 16) {
            __m256i acc[ROWS][2];
            int32_t r = 0;
            for (; r + ROWS <= rows; r += ROWS) {
                accumulate_tile(g, c, a + (i + r) * lda, lda, sums + r, acc);
                store_words(acc, ROWS, out + (i + r) * ldo + c, ldo);
            }
            for (; r < rows; r++) {
                accumulate(g, c, a + (i + r) * lda, lda, sums + r, 1, acc);
                store_words(acc, 1, out + (i + r) * ldo + c, ldo);
            }
        }
    }
}

#endif
