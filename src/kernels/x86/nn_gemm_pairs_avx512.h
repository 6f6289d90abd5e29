/* Tiles of the matrix product for at most 8 channels: two groups of four inputs that follow each
 * other come with one load, in turns, beside weights of both, so that one product does both. Their
 * sums are added in the end, and two rows are rounded together.
 *
 * Lanes of a pair are [c a, c b, c + 1 a, ...]: channel c of the first group, then of the second;
 * those of results channel c of a row, then of the next row. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_PAIRS_AVX512_H
#define FOVEA_KERNELS_X86_NN_GEMM_PAIRS_AVX512_H

#include "kernels/x86/nn_gemm_tile_avx512.h"

enum { PAIR_ROWS = 8, PAIR_CHANNELS = 8, PAIRS_MAX = 24 };

/* Pairs of groups, then groups that stand alone, whose second weights are zero: where each begins
 * from the kernel's corner on. */
struct pairs {
    __m512i weights[PAIRS_MAX];
    int32_t at[PAIRS_MAX];
    int32_t count, all;
};

FV_INLINE __m512i in_turns(__m512i first, __m512i second)
{
    return _mm512_permutex2var_epi32(
        first, _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23), second);
}

static inline void add_pair(struct pairs *p, const struct fv_nn_gemm *g, int32_t group, int32_t at,
                            int both)
{
    const int8_t *from = g->weights + (ptrdiff_t)group * 64;
    p->weights[p->all] = in_turns(_mm512_load_si512(from),
                                  both ? _mm512_load_si512(from + 64) : _mm512_setzero_si512());
    p->at[p->all++] = at;
}

/* `offsets`: NULL where groups follow each other. 0: taking them one by one is no slower. */
static inline int find_pairs(struct pairs *p, const struct fv_nn_gemm *g, const int32_t *offsets)
{
    int32_t alone[PAIRS_MAX], alone_count = 0;
    p->all = 0;
    if (g->n > PAIR_CHANNELS) return 0;
    for (int32_t i = 0; i < g->k4; i++) {
        const int32_t at = offsets == NULL ? 4 * i : offsets[i];
        if (p->all + alone_count == PAIRS_MAX) return 0;
        if (i + 1 < g->k4 && (offsets == NULL || offsets[i + 1] == at + 4))
            add_pair(p, g, i++, at, 1);
        else
            alone[alone_count++] = i;
    }
    p->count = p->all;
    for (int32_t i = 0; i < alone_count; i++)
        add_pair(p, g, alone[i], offsets == NULL ? 4 * alone[i] : offsets[alone[i]], 0);
    return p->all < g->k4;
}

FV_INLINE __m512i broadcast8(const uint8_t *bytes)
{
    int64_t word;
    memcpy(&word, bytes, 8);
    return _mm512_set1_epi64(word);
}

/* A register of sums for each row. */
FV_INLINE void sum_pairs(const struct tile_job *j, const struct pairs *p, __m512i acc[PAIR_ROWS])
{
    const uint8_t *row[PAIR_ROWS];
    const __m512i bias = _mm512_load_si512(j->bias);
#pragma GCC unroll 8
    for (int i = 0; i < PAIR_ROWS; i++) {
        const int32_t sum = j->row_sums == NULL ? 0 : j->row_sums[i];
        row[i] = j->in[i];
        acc[i] = in_turns(_mm512_add_epi32(bias, _mm512_set1_epi32(sum)), _mm512_setzero_si512());
    }
    int32_t k = 0;
    for (; k < p->count; k++) {
#pragma GCC unroll 8
        for (int i = 0; i < PAIR_ROWS; i++)
            acc[i] = _mm512_dpbusd_epi32(acc[i], broadcast8(row[i] + p->at[k]), p->weights[k]);
    }
    for (; k < p->all; k++) {
#pragma GCC unroll 8
        for (int i = 0; i < PAIR_ROWS; i++)
            acc[i] = _mm512_dpbusd_epi32(acc[i], broadcast4(row[i] + p->at[k]), p->weights[k]);
    }
}

/* The sums of both groups, those of row `a` in the even lanes, those of `b` in the odd ones. */
FV_INLINE __m512i add_groups(__m512i a, __m512i b)
{
    return _mm512_mask_add_epi32(_mm512_add_epi32(a, _mm512_srli_epi64(a, 32)), 0xAAAA, b,
                                 _mm512_slli_epi64(b, 32));
}

/* How the lanes of add_groups are rounded: as the first block is, each channel twice. */
static inline void load_pair_rounding(struct store_job *s, const struct fv_nn_gemm *g)
{
    const __m512i twice = _mm512_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7);
    if (s->is_real[0]) {
        s->real[0].factor = _mm512_permutexvar_ps(twice, s->real[0].factor);
        s->real[0].offset = _mm512_permutexvar_ps(twice, s->real[0].offset);
    } else {
        load_down_of(&s->scale[0],
                     _mm512_permutexvar_epi32(twice, _mm512_loadu_si512(g->multiplier)),
                     _mm512_permutexvar_epi32(twice, _mm512_loadu_si512(g->shift)));
    }
}

/* Bytes of pack_lanes to rows of 8 channels: first pairs of bytes within each 16, then these. */
FV_INLINE __m512i order_rows(__m512i bytes)
{
    const __m512i turns =
        _mm512_broadcast_i32x4(_mm_setr_epi8(0, 2, 1, 3, 4, 6, 5, 7, 8, 10, 9, 11, 12, 14, 13, 15));
    const __m512i rows =
        _mm512_set_epi16(31, 23, 15, 7, 30, 22, 14, 6, 29, 21, 13, 5, 28, 20, 12, 4, 27, 19, 11, 3,
                         26, 18, 10, 2, 25, 17, 9, 1, 24, 16, 8, 0);
    return _mm512_permutexvar_epi16(rows, _mm512_shuffle_epi8(bytes, turns));
}

/* The first `rows` rows of 8 bytes each, of which `mask` are stored. */
static inline void store_rows_of_8(__mmask64 mask, __m512i bytes, uint8_t *const *out, int32_t rows)
{
    _Alignas(64) uint8_t all[64];
    if (rows == PAIR_ROWS && mask == 0xFF && are_dense(out, PAIR_ROWS, 8)) {
        _mm512_storeu_si512(out[0], bytes);
        return;
    }
    _mm512_store_si512(all, bytes);
    for (int32_t i = 0; i < rows; i++) {
        const __m128i row = _mm_loadl_epi64((const __m128i *)(const void *)(all + 8 * i));
        _mm_mask_storeu_epi8(out[i], (__mmask16)mask, row);
    }
}

FV_INLINE void pair_tile(const struct tile_job *j, const struct store_job *s, const struct pairs *p,
                         const int from_zero)
{
    __m512i acc[PAIR_ROWS], sums[4];
    sum_pairs(j, p, acc);
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++)
        sums[i] = add_groups(acc[2 * i], acc[2 * i + 1]);
    scale_block(sums, s, 4, 1, 0, from_zero);
    __m512i bytes =
        order_rows(pack_lanes(sums[0], sums[1], sums[2], sums[3], &s->clamp, from_zero));
    if (s->lookup != NULL) bytes = look_up(bytes, &s->table);
    store_rows_of_8(s->mask, bytes, j->out, j->rows);
}

/* The last tile overlaps the one before: a chunk has at least as many rows. */
FV_INLINE void pair_rows(struct tile_job *j, const struct store_job *s, const struct chunk *c,
                         const int from_zero)
{
    for (int32_t i = 0; i < c->m; i += PAIR_ROWS) {
        const int32_t at = i + PAIR_ROWS > c->m ? c->m - PAIR_ROWS : i;
        j->in = c->in + at;
        j->row_sums = c->sums == NULL ? NULL : c->sums + at;
        j->out = c->out + at;
        j->rows = PAIR_ROWS;
        pair_tile(j, s, c->pairs, from_zero);
    }
}

static __attribute__((noinline)) void pair_column(struct tile_job *j, struct store_job *s,
                                                  const struct chunk *c)
{
    load_pair_rounding(s, j->g);
    if (j->g->zero_out == 0)
        pair_rows(j, s, c, 1);
    else
        pair_rows(j, s, c, 0);
}

#endif
