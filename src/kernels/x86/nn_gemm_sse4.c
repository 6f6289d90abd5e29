/* The matrix product on bytes with pmaddwd: pmaddubsw saturates at 16 bits, so both factors are
 * widened. Four neighbouring inputs, twice, are multiplied by the weights of two channels, and the
 * two sums of each channel are added at the end.
 *
 * Three rows run together over eight channels. Their inputs are widened once for all channels, as
 * far as there is room for them. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

/* Groups of four k that are kept widened; blocks of 16 channels whose scales are kept. */
enum { ROWS = 3, WIDE_MAX = 384, SCALES_MAX = 12 };

struct rows {
    __m128i wide[WIDE_MAX][ROWS];
    int32_t sums[ROWS]; /* the row's sum times row_sum_factor */
};

struct scales {
    struct scale4 of[SCALES_MAX][4];
};

static void load_block(const struct fv_nn_gemm *g, int32_t c, struct scale4 s[4])
{
    for (int i = 0; i < 4; i++)
        load_scale(&s[i], g->multiplier + c + 4 * i, g->shift + c + 4 * i);
}

FV_INLINE __m128i four_inputs(const uint8_t *bytes)
{
    int32_t word;
    memcpy(&word, bytes, 4);
    return _mm_cvtepu8_epi16(_mm_set1_epi32(word));
}

FV_INLINE __m128i two_weights(const int8_t *w)
{
    return _mm_cvtepi8_epi16(_mm_loadl_epi64((const __m128i *)(const void *)w));
}

static int32_t sum_of(const struct fv_nn_gemm *g, const uint8_t *row)
{
    __m128i sum = _mm_setzero_si128();
    int32_t k = 0;
    if (g->row_sum_factor == 0) return 0;
    for (; k + 16 <= g->k; k += 16)
        sum = _mm_add_epi64(sum, _mm_sad_epu8(load16(row + k), _mm_setzero_si128()));
    uint32_t total = (uint32_t)_mm_cvtsi128_si32(sum) + (uint32_t)_mm_extract_epi32(sum, 2);
    for (; k < g->k; k++)
        total += row[k];
    return (int32_t)(total * (uint32_t)g->row_sum_factor);
}

static void widen(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, const int N,
                  struct rows *rows)
{
    for (int r = 0; r < N; r++)
        rows->sums[r] = sum_of(g, a + r * lda);
    if (g->k4 > WIDE_MAX) return;
    for (int32_t i = 0; i < g->k4; i++) {
        for (int r = 0; r < N; r++)
            rows->wide[i][r] = four_inputs(a + r * lda + 4 * (ptrdiff_t)i);
    }
}

/* Accumulators of N rows by 8 channels, of which `weights` and `bias` are the first; out[row][0..3]
 * and [4..7]. */
FV_INLINE void accumulate(const struct fv_nn_gemm *g, const struct rows *rows, const uint8_t *a,
                          ptrdiff_t lda, const int N, const int wide, const int8_t *weights,
                          const int32_t *bias, __m128i out[][2])
{
    __m128i acc[ROWS][4];
#pragma GCC unroll 3
    for (int r = 0; r < N; r++)
        acc[r][0] = acc[r][1] = acc[r][2] = acc[r][3] = _mm_setzero_si128();
#pragma GCC unroll 1
    for (int32_t i = 0; i < g->k4; i++, weights += 64) {
        __m128i x[ROWS];
#pragma GCC unroll 3
        for (int r = 0; r < N; r++)
            x[r] = wide ? rows->wide[i][r] : four_inputs(a + r * lda + 4 * (ptrdiff_t)i);
#pragma GCC unroll 4
        for (int c = 0; c < 4; c++) {
            const __m128i w = two_weights(weights + 8 * (ptrdiff_t)c);
#pragma GCC unroll 3
            for (int r = 0; r < N; r++)
                acc[r][c] = _mm_add_epi32(acc[r][c], _mm_madd_epi16(w, x[r]));
        }
    }
#pragma GCC unroll 3
    for (int r = 0; r < N; r++) {
        const __m128i sum = _mm_set1_epi32(rows->sums[r]);
        out[r][0] =
            _mm_add_epi32(_mm_add_epi32(load16(bias), sum), _mm_hadd_epi32(acc[r][0], acc[r][1]));
        out[r][1] = _mm_add_epi32(_mm_add_epi32(load16(bias + 4), sum),
                                  _mm_hadd_epi32(acc[r][2], acc[r][3]));
    }
}

/* 16 channels of N rows. */
FV_INLINE void both_halves(const struct fv_nn_gemm *g, const struct rows *rows, const uint8_t *a,
                           ptrdiff_t lda, const int N, int32_t c, __m128i low[][2],
                           __m128i high[][2])
{
    const int8_t *weights = g->weights + (ptrdiff_t)c * g->k4 * 4;
    if (g->k4 <= WIDE_MAX) {
        accumulate(g, rows, a, lda, N, 1, weights, g->bias + c, low);
        accumulate(g, rows, a, lda, N, 1, weights + 32, g->bias + c + 8, high);
    } else {
        accumulate(g, rows, a, lda, N, 0, weights, g->bias + c, low);
        accumulate(g, rows, a, lda, N, 0, weights + 32, g->bias + c + 8, high);
    }
}

FV_INLINE void strip_u8(const struct fv_nn_gemm *g, const struct rows *rows,
                        const struct scales *scales, const uint8_t *a, ptrdiff_t lda, uint8_t *out,
                        ptrdiff_t ldo, const int N, const struct output *o)
{
    const int above = g->act_min >= g->zero_out;
    for (int32_t c = 0; c < g->n; c += 16) {
        __m128i low[ROWS][2], high[ROWS][2];
        struct scale4 own[4];
        const struct scale4 *s = scales->of[c / 16 % SCALES_MAX];
        both_halves(g, rows, a, lda, N, c, low, high);
        if (c >= 16 * SCALES_MAX) {
            load_block(g, c, own);
            s = own;
        }
        for (int r = 0; r < N; r++) {
            const __m128i bytes = to_bytes(
                o, requantize(low[r][0], &s[0], above), requantize(low[r][1], &s[1], above),
                requantize(high[r][0], &s[2], above), requantize(high[r][1], &s[3], above));
            store_bytes(o, out + r * ldo + c, bytes, g->n - c < 16 ? g->n - c : 16);
        }
    }
}

void fv_k_nn_gemm_u8__sse4(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    struct rows rows;
    struct scales scales;
    struct output o;
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    for (int32_t c = 0; c < g->n && c < 16 * SCALES_MAX; c += 16)
        load_block(g, c, scales.of[c / 16]);
    int32_t i = 0;
    for (; i + ROWS <= m; i += ROWS) {
        widen(g, a + i * lda, lda, ROWS, &rows);
        strip_u8(g, &rows, &scales, a + i * lda, lda, out + i * ldo, ldo, ROWS, &o);
    }
    for (; i < m; i++) {
        widen(g, a + i * lda, lda, 1, &rows);
        strip_u8(g, &rows, &scales, a + i * lda, lda, out + i * ldo, ldo, 1, &o);
    }
}

FV_INLINE void strip_i32(const struct fv_nn_gemm *g, const struct rows *rows, const uint8_t *a,
                         ptrdiff_t lda, int32_t *out, ptrdiff_t ldo, const int N)
{
    for (int32_t c = 0; c < g->n; c += 16) {
        __m128i low[ROWS][2], high[ROWS][2];
        both_halves(g, rows, a, lda, N, c, low, high);
        for (int r = 0; r < N; r++) {
            __m128i *to = (__m128i *)(void *)(out + r * ldo + c);
            _mm_storeu_si128(to, low[r][0]);
            _mm_storeu_si128(to + 1, low[r][1]);
            _mm_storeu_si128(to + 2, high[r][0]);
            _mm_storeu_si128(to + 3, high[r][1]);
        }
    }
}

void fv_k_nn_gemm_i32__sse4(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                            int32_t *out, ptrdiff_t ldo, int32_t m)
{
    struct rows rows;
    int32_t i = 0;
    for (; i + ROWS <= m; i += ROWS) {
        widen(g, a + i * lda, lda, ROWS, &rows);
        strip_i32(g, &rows, a + i * lda, lda, out + i * ldo, ldo, ROWS);
    }
    for (; i < m; i++) {
        widen(g, a + i * lda, lda, 1, &rows);
        strip_i32(g, &rows, a + i * lda, lda, out + i * ldo, ldo, 1);
    }
}
