/* Tiles of the matrix product for at most 16 channels and a run of rows at equal distances. The
 * addresses of 16 rows take few registers, so that nothing but inputs and weights is loaded in the
 * innermost loop: with one product for each input, loads are what it waits for. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_RUN_AVX512_H
#define FOVEA_KERNELS_X86_NN_GEMM_RUN_AVX512_H

#include "kernels/x86/nn_gemm_tile_avx512.h"

enum { RUN_ROWS = 16, RUN_REST = 8 };

/* Whether tiles fit the run: as the last one overlaps the one before, some rows are done twice, at
 * most a quarter of them. */
static inline int is_long_run(const struct fv_nn_gemm *g, int32_t count)
{
    const int32_t twice = (RUN_REST - count % RUN_REST) % RUN_REST;
    return g->n <= 16 && g->row_sum_factor == 0 && count >= RUN_ROWS && 4 * twice <= count;
}

/* The products of one group of four inputs, `at` bytes past each row, by fours of rows. */
FV_INLINE void accumulate_fours(const uint8_t *const *row, ptrdiff_t step, ptrdiff_t at,
                                const int8_t *w, const int ROWS, __m512i *acc)
{
    const __m512i v = _mm512_load_si512(w);
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++, at += step) {
#pragma GCC unroll 4
        for (int f = 0; f < ROWS / 4; f++)
            acc[4 * f + i] = _mm512_dpbusd_epi32(acc[4 * f + i], broadcast4(row[f] + at), v);
    }
}

FV_INLINE void accumulate_run(const struct tile_job *j, const uint8_t *in, ptrdiff_t step,
                              const int ROWS, const int APART, __m512i *acc)
{
    const uint8_t *row[RUN_ROWS / 4];
    const __m512i bias = _mm512_load_si512(j->bias);
    const int8_t *w = j->weights;
#pragma GCC unroll 4
    for (int f = 0; f < ROWS / 4; f++)
        row[f] = in + 4 * f * step;
#pragma GCC unroll 16
    for (int i = 0; i < ROWS; i++)
        acc[i] = bias;
    if (APART) {
        const int32_t *end = j->offsets + j->g->k4;
        for (const int32_t *offset = j->offsets; offset < end; offset++, w += 64)
            accumulate_fours(row, step, *offset, w, ROWS, acc);
        return;
    }
    for (ptrdiff_t k = 0; k < (ptrdiff_t)j->g->k4 * 4; k += 4, w += 64)
        accumulate_fours(row, step, k, w, ROWS, acc);
}

/* Four rows; `is_dense`: of 16 bytes without gap. */
FV_INLINE void store_four(__m512i bytes, uint8_t *out, ptrdiff_t step, __mmask16 mask, int is_dense)
{
    if (is_dense) {
        _mm512_storeu_si512(out, bytes);
        return;
    }
    _mm_mask_storeu_epi8(out, mask, _mm512_castsi512_si128(bytes));
    _mm_mask_storeu_epi8(out + step, mask, _mm512_extracti32x4_epi32(bytes, 1));
    _mm_mask_storeu_epi8(out + 2 * step, mask, _mm512_extracti32x4_epi32(bytes, 2));
    _mm_mask_storeu_epi8(out + 3 * step, mask, _mm512_extracti32x4_epi32(bytes, 3));
}

/* Rows from `at` on. */
FV_INLINE void run_tile(const struct tile_job *j, const struct store_job *s,
                        const struct fv_nn_rows *r, ptrdiff_t at, const int ROWS, const int APART,
                        const int from_zero)
{
    const __mmask16 mask = (__mmask16)s->mask;
    const int is_dense = mask == 0xFFFF && r->out_step == 16;
    uint8_t *out = r->out + at * r->out_step;
    __m512i acc[RUN_ROWS];
    accumulate_run(j, r->in + at * r->in_step, r->in_step, ROWS, APART, acc);
    change_registers(acc, ROWS);
    scale_block(acc, s, ROWS, 1, 0, from_zero);
#pragma GCC unroll 4
    for (int f = 0; f < ROWS; f += 4, out += 4 * r->out_step) {
        __m512i bytes =
            pack_lanes(acc[f], acc[f + 1], acc[f + 2], acc[f + 3], &s->clamp, from_zero);
        if (s->lookup != NULL) bytes = look_up(bytes, &s->table);
        store_four(_mm512_permutexvar_epi32(s->order, bytes), out, r->out_step, mask, is_dense);
    }
}

FV_INLINE void run_u8(const struct tile_job *j, const struct store_job *s,
                      const struct fv_nn_rows *r, const int APART, const int from_zero)
{
    int32_t i = 0;
    for (; i + RUN_REST < r->count; i += RUN_ROWS) {
        const int32_t at = i + RUN_ROWS > r->count ? r->count - RUN_ROWS : i;
        run_tile(j, s, r, at, RUN_ROWS, APART, from_zero);
    }
    if (i < r->count) run_tile(j, s, r, r->count - RUN_REST, RUN_REST, APART, from_zero);
}

#endif
