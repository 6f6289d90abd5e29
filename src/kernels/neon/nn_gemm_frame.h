/* The frame of the matrix product around a tile of 4 rows by 16 channels, which each file defines
 * for its instruction set: `accumulate` and `start_of` below. */
#ifndef FOVEA_KERNELS_NEON_NN_GEMM_FRAME_H
#define FOVEA_KERNELS_NEON_NN_GEMM_FRAME_H

#include "kernels/neon/nn_neon.h"

enum { TILE_ROWS = 4 };

FV_INLINE int32_t sum_row(const struct fv_nn_gemm *g, const uint8_t *row)
{
    if (g->row_sum_factor == 0) return 0;
    uint32_t sum = 0;
    int32_t k = 0;
    for (; k + 16 <= g->k; k += 16)
        sum += vaddlvq_u8(vld1q_u8(row + k));
    for (; k < g->k; k++)
        sum += row[k];
    return (int32_t)(sum * (uint32_t)g->row_sum_factor);
}

/* Sums of one tile: 4 rows by 16 channels from packed weights, added to acc. */
FV_INLINE void accumulate(const uint8_t *const row[TILE_ROWS], const int8_t *w, int32_t k4,
                          int32x4_t acc[TILE_ROWS][4]);
/* What a block's accumulators start with besides the bias, for kernels that multiply other numbers
 * than the bytes. */
FV_INLINE void start_of(const int8_t *w, int32_t k4, int32x4_t start[4]);

struct tile {
    const uint8_t *row[TILE_ROWS];
    int32_t rows, sum[TILE_ROWS];
};

FV_INLINE void init_tile(struct tile *t, const struct fv_nn_gemm *g, const uint8_t *a,
                         ptrdiff_t lda, int32_t left)
{
    t->rows = left < TILE_ROWS ? left : TILE_ROWS;
    for (int32_t r = 0; r < TILE_ROWS; r++) {
        t->row[r] = a + (r < t->rows ? r : t->rows - 1) * lda;
        t->sum[r] = sum_row(g, t->row[r]);
    }
}

FV_INLINE void sums_of(const struct tile *t, const struct fv_nn_gemm *g, int32_t block,
                       const int32x4_t start[4], int32x4_t acc[TILE_ROWS][4])
{
    for (int r = 0; r < TILE_ROWS; r++) {
        for (int i = 0; i < 4; i++)
            acc[r][i] = vaddq_s32(start[i], vdupq_n_s32(t->sum[r]));
    }
    accumulate(t->row, g->weights + (ptrdiff_t)block * g->k4 * 64, g->k4, acc);
}

FV_INLINE void start_block(const struct fv_nn_gemm *g, int32_t block, int32x4_t start[4])
{
    start_of(g->weights + (ptrdiff_t)block * g->k4 * 64, g->k4, start);
    for (int i = 0; i < 4; i++)
        start[i] = vaddq_s32(start[i], vld1q_s32(g->bias + 16 * block + 4 * i));
}

FV_INLINE void gemm_u8(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, uint8_t *out,
                       ptrdiff_t ldo, int32_t m)
{
    enum { CHUNK_TILES = 16 };
    const int32_t blocks = (g->n + 15) / 16;
    struct tile tiles[CHUNK_TILES];
    struct output o;
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    for (int32_t i = 0; i < m; i += CHUNK_TILES * TILE_ROWS) {
        int32_t count = 0;
        for (; count < CHUNK_TILES && i + count * TILE_ROWS < m; count++) {
            init_tile(&tiles[count], g, a + (i + count * TILE_ROWS) * lda, lda,
                      m - i - count * TILE_ROWS);
        }
        for (int32_t b = 0; b < blocks; b++) {
            struct scale16 s;
            int32x4_t start[4];
            load_scale(&s, g->multiplier + 16 * b, g->shift + 16 * b);
            start_block(g, b, start);
            const int32_t width = g->n - 16 * b < 16 ? g->n - 16 * b : 16;
            for (int32_t t = 0; t < count; t++) {
                int32x4_t acc[TILE_ROWS][4];
                sums_of(&tiles[t], g, b, start, acc);
                for (int32_t r = 0; r < tiles[t].rows; r++) {
                    requantize16(acc[r], &s);
                    store16(&o, acc[r], out + (i + t * TILE_ROWS + r) * ldo + 16 * b, width);
                }
            }
        }
    }
}

FV_INLINE void gemm_i32(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t *out,
                        ptrdiff_t ldo, int32_t m)
{
    const int32_t blocks = (g->n + 15) / 16;
    for (int32_t b = 0; b < blocks; b++) {
        int32x4_t start[4];
        start_block(g, b, start);
        for (int32_t i = 0; i < m; i += TILE_ROWS) {
            struct tile t;
            int32x4_t acc[TILE_ROWS][4];
            init_tile(&t, g, a + i * lda, lda, m - i);
            sums_of(&t, g, b, start, acc);
            for (int32_t r = 0; r < t.rows; r++) {
                for (int c = 0; c < 4; c++)
                    vst1q_s32(out + (i + r) * ldo + 16 * b + 4 * c, acc[r][c]);
            }
        }
    }
}

#endif
