/* The matrix product with vpmaddwd on 16-bit values: exact, unlike the saturating 8-bit form. A tile is three rows by 16
 * channels; a register of accumulators holds, for four channels, the sums over even and odd pairs of k. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

enum { ROWS = 3 };

static int32_t sum_row(const struct fv_nn_gemm *g, const uint8_t *row)
{
    if (g->row_sum_factor == 0) return 0;
    __m256i sum = _mm256_setzero_si256();
    int32_t k = 0;
    for (; k + 32 <= g->k; k += 32) {
        sum = _mm256_add_epi64(sum, _mm256_sad_epu8(_mm256_loadu_si256((const __m256i *)(const void *)(row + k)), _mm256_setzero_si256()));
    }
    uint64_t part[4];
    _mm256_storeu_si256((__m256i *)(void *)part, sum);
    uint32_t total = (uint32_t)(part[0] + part[1] + part[2] + part[3]);
    for (; k < g->k; ++k) total += row[k];
    return (int32_t)(total * (uint32_t)g->row_sum_factor);
}

FV_INLINE __m256i four_inputs(const uint8_t *bytes)
{
    int32_t word;
    memcpy(&word, bytes, 4);
    return _mm256_cvtepu8_epi16(_mm_set1_epi32(word));
}

/* Sums of 8 channels from two registers of pairs. */
FV_INLINE __m256i join(__m256i a, __m256i b)
{
    return _mm256_permute4x64_epi64(_mm256_hadd_epi32(a, b), 0xD8);
}

/* acc: for each row 16 channels in order, without the bias. */
FV_INLINE void accumulate(const struct fv_nn_gemm *g, const uint8_t *const row[ROWS], const int8_t *w, __m256i acc[ROWS][2])
{
    __m256i pair[ROWS][4];
#pragma GCC unroll 3
    for (int r = 0; r < ROWS; ++r) {
#pragma GCC unroll 4
        for (int q = 0; q < 4; ++q) pair[r][q] = _mm256_setzero_si256();
    }
    const ptrdiff_t bytes = (ptrdiff_t)g->k4 * 4;
    for (ptrdiff_t k = 0; k < bytes; k += 4, w += 64) {
        __m256i x[ROWS];
#pragma GCC unroll 3
        for (int r = 0; r < ROWS; ++r) x[r] = four_inputs(row[r] + k);
#pragma GCC unroll 4
        for (int q = 0; q < 4; ++q) {
            const __m256i v = _mm256_cvtepi8_epi16(_mm_load_si128((const __m128i *)(const void *)(w + 16 * q)));
#pragma GCC unroll 3
            for (int r = 0; r < ROWS; ++r) pair[r][q] = _mm256_add_epi32(pair[r][q], _mm256_madd_epi16(x[r], v));
        }
    }
#pragma GCC unroll 3
    for (int r = 0; r < ROWS; ++r) {
        acc[r][0] = join(pair[r][0], pair[r][1]);
        acc[r][1] = join(pair[r][2], pair[r][3]);
    }
}

struct tile {
    const uint8_t *row[ROWS];
    int32_t rows, sum[ROWS];
};

static void init_tile(struct tile *t, const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t left)
{
    t->rows = left < ROWS ? left : ROWS;
    for (int32_t r = 0; r < ROWS; ++r) {
        t->row[r] = a + (r < t->rows ? r : t->rows - 1) * lda;
        t->sum[r] = sum_row(g, t->row[r]);
    }
}

static void tile_u8(const struct tile *t, const struct fv_nn_gemm *g, int32_t block, const struct scale8 scale[2], const struct output *o,
                    uint8_t *out, ptrdiff_t ldo, int above)
{
    __m256i acc[ROWS][2];
    const int32_t *bias = g->bias + 16 * block;
    const __m256i bias_low = _mm256_load_si256((const __m256i *)(const void *)bias);
    const __m256i bias_high = _mm256_load_si256((const __m256i *)(const void *)(bias + 8));
    accumulate(g, t->row, g->weights + (ptrdiff_t)block * g->k4 * 64, acc);
    for (int32_t r = 0; r < t->rows; ++r) {
        const __m256i sum = _mm256_set1_epi32(t->sum[r]);
        const __m256i low = _mm256_add_epi32(_mm256_add_epi32(acc[r][0], bias_low), sum);
        const __m256i high = _mm256_add_epi32(_mm256_add_epi32(acc[r][1], bias_high), sum);
        const __m256i a = above ? requantize(low, &scale[0], 1) : requantize(low, &scale[0], 0);
        const __m256i b = above ? requantize(high, &scale[1], 1) : requantize(high, &scale[1], 0);
        store16(o, _mm256_permute4x64_epi64(_mm256_packs_epi32(a, b), 0xD8), out + r * ldo);
    }
}

void fv_k_nn_gemm_u8__avx2(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    enum { CHUNK_TILES = 16 };
    const int32_t blocks = (g->n + 15) / 16;
    struct tile tiles[CHUNK_TILES];
    struct output o;
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    for (int32_t i = 0; i < m; i += CHUNK_TILES * ROWS) {
        int32_t count = 0;
        for (; count < CHUNK_TILES && i + count * ROWS < m; ++count) {
            init_tile(&tiles[count], g, a + (i + count * ROWS) * lda, lda, m - i - count * ROWS);
        }
        for (int32_t b = 0; b < blocks; ++b) {
            struct scale8 scale[2];
            for (int h = 0; h < 2; ++h) {
                load_scale(&scale[h], _mm256_load_si256((const __m256i *)(const void *)(g->multiplier + 16 * b + 8 * h)),
                           _mm256_load_si256((const __m256i *)(const void *)(g->shift + 16 * b + 8 * h)));
            }
            o.width = g->n - 16 * b < 16 ? g->n - 16 * b : 16;
            for (int32_t t = 0; t < count; ++t) {
                tile_u8(&tiles[t], g, b, scale, &o, out + (i + t * ROWS) * ldo + 16 * b, ldo, g->act_min >= g->zero_out);
            }
        }
    }
}

void fv_k_nn_gemm_i32__avx2(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t *out, ptrdiff_t ldo, int32_t m)
{
    const int32_t blocks = (g->n + 15) / 16;
    for (int32_t i = 0; i < m; i += ROWS) {
        struct tile t;
        init_tile(&t, g, a + i * lda, lda, m - i);
        for (int32_t b = 0; b < blocks; ++b) {
            __m256i acc[ROWS][2];
            accumulate(g, t.row, g->weights + (ptrdiff_t)b * g->k4 * 64, acc);
            for (int32_t r = 0; r < t.rows; ++r) {
                for (int h = 0; h < 2; ++h) {
                    const __m256i bias = _mm256_load_si256((const __m256i *)(const void *)(g->bias + 16 * b + 8 * h));
                    const __m256i sum = _mm256_add_epi32(_mm256_add_epi32(acc[r][h], bias), _mm256_set1_epi32(t.sum[r]));
                    _mm256_storeu_si256((__m256i *)(void *)(out + (i + r) * ldo + 16 * b + 8 * h), sum);
                }
            }
        }
    }
}
