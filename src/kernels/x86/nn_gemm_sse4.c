/* The matrix product on bytes with pmaddubsw, whose sums of 16 bits run as far as they fit
 * (nn_gemm_runs.h). A tile is four rows by 8 channels. Rows that are too few for one are multiplied
 * as 16-bit values throughout. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_sse4.h"

#define VECTOR __m128i
#define OP(name) _mm_##name
#define WHOLE(name) _mm_##name##_si128
#include "kernels/x86/nn_gemm_runs.h"

/* Written out: compilers move the sums around, or to the stack and back. `x` is used up. */
FV_INLINE void add_products(__m128i *low, __m128i *high, __m128i x, __m128i w0, __m128i w1)
{
    __m128i products;
    __asm__("movdqa %2, %3\n\tpmaddubsw %4, %3\n\tpaddw %3, %0\n\t"
            "pmaddubsw %5, %2\n\tpaddw %2, %1"
            : "+x"(*low), "+x"(*high), "+x"(x), "=&x"(products)
            : "x"(w0), "x"(w1));
}

/* Products of four rows with the groups of four k of a run; `weights`: of the 8 channels. */
FV_INLINE void add_run(const struct panel *p, int32_t from, int32_t end, const int8_t *weights,
                       const uint8_t *a, ptrdiff_t lda, __m128i acc[ROWS][2])
{
    const __m128i ones = _mm_set1_epi16(1);
    const uint16_t *group = p->groups + from, *last = p->groups + end;
    __m128i sum[ROWS][2];
#pragma GCC unroll 4
    for (int r = 0; r < ROWS; r++)
        sum[r][0] = sum[r][1] = _mm_setzero_si128();
    do {
        const int8_t *w = weights + 64 * (ptrdiff_t)*group;
        const __m128i w0 = load16(w), w1 = load16(w + 16);
        const uint8_t *row = a + 4 * (ptrdiff_t)*group++;
#pragma GCC unroll 4
        for (int r = 0; r < ROWS; r++)
            add_products(&sum[r][0], &sum[r][1], four_inputs(row + r * lda), w0, w1);
    } while (group != last);
#pragma GCC unroll 4
    for (int r = 0; r < ROWS; r++) {
        acc[r][0] = _mm_add_epi32(acc[r][0], _mm_madd_epi16(sum[r][0], ones));
        acc[r][1] = _mm_add_epi32(acc[r][1], _mm_madd_epi16(sum[r][1], ones));
    }
}

/* Products of four rows with a group of four k for any weights. */
FV_INLINE void add_wide(const uint8_t *a, ptrdiff_t lda, const int8_t *w, __m128i acc[ROWS][2])
{
#pragma GCC unroll 2
    for (int h = 0; h < 2; h++) {
        const __m128i both = load16(w + 16 * h), odd = _mm_srai_epi16(both, 8),
                      even = _mm_srai_epi16(_mm_slli_epi16(both, 8), 8);
#pragma GCC unroll 4
        for (int r = 0; r < ROWS; r++) {
            const __m128i x = four_inputs(a + r * lda);
            const __m128i low = _mm_and_si128(x, _mm_set1_epi16(255)), high = _mm_srli_epi16(x, 8);
            acc[r][h] = _mm_add_epi32(
                acc[r][h], _mm_add_epi32(_mm_madd_epi16(even, low), _mm_madd_epi16(odd, high)));
        }
    }
}

/* Factor times the sum of a row's k bytes. */
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

/* Products of one row with all groups: weights of two channels are widened at a time, and the two
 * sums of each are added at the end. */
FV_INLINE void add_row(const uint8_t *row, int32_t k4, const int8_t *weights, __m128i acc[2])
{
    __m128i sum[4];
    for (int c = 0; c < 4; c++)
        sum[c] = _mm_setzero_si128();
    for (int32_t i = 0; i < k4; i++, row += 4, weights += 64) {
        const __m128i x = _mm_cvtepu8_epi16(four_inputs(row));
#pragma GCC unroll 4
        for (int c = 0; c < 4; c++) {
            const __m128i *w = (const __m128i *)(const void *)(weights + 8 * (ptrdiff_t)c);
            sum[c] =
                _mm_add_epi32(sum[c], _mm_madd_epi16(_mm_cvtepi8_epi16(_mm_loadl_epi64(w)), x));
        }
    }
    acc[0] = _mm_add_epi32(acc[0], _mm_hadd_epi32(sum[0], sum[1]));
    acc[1] = _mm_add_epi32(acc[1], _mm_hadd_epi32(sum[2], sum[3]));
}

/* Accumulators of N rows by 8 channels, 8 h the first of the panel's; of one row without knowing
 * the groups. */
FV_INLINE void accumulate(const struct fv_nn_gemm *g, const struct panel *p, int32_t c, int h,
                          const uint8_t *a, ptrdiff_t lda, const int32_t *sums, const int N,
                          __m128i acc[][2])
{
    const int8_t *weights = g->weights + (ptrdiff_t)c * g->k4 * 4 + 32 * (ptrdiff_t)h;
    const int32_t *bias = g->bias + c + 8 * h;
#pragma GCC unroll 4
    for (int r = 0; r < N; r++) {
        const __m128i sum = _mm_set1_epi32(sums[r]);
        acc[r][0] = _mm_add_epi32(load16(bias), sum);
        acc[r][1] = _mm_add_epi32(load16(bias + 4), sum);
    }
    if (N == 1) {
        add_row(a, g->k4, weights, acc[0]);
        return;
    }
    for (int32_t i = 0, from = 0; i < p->run_count; from = p->end[i++])
        add_run(p, from, p->end[i], weights, a, lda, acc);
    for (int32_t i = 1; i <= p->wide_count; i++) {
        const ptrdiff_t group = p->groups[GROUPS_MAX - i];
        add_wide(a + 4 * group, lda, weights + 64 * group, acc);
    }
}

/* Bytes of 16 channels of N rows. */
FV_INLINE void tile_u8(const struct fv_nn_gemm *g, const struct panel *p, int32_t c,
                       const struct scale4 s[4], const struct output *o, const uint8_t *a,
                       ptrdiff_t lda, const int32_t *sums, uint8_t *out, ptrdiff_t ldo, const int N)
{
    const int above = g->act_min >= g->zero_out;
    __m128i low[ROWS][2], high[ROWS][2];
    accumulate(g, p, c, 0, a, lda, sums, N, low);
    accumulate(g, p, c, 1, a, lda, sums, N, high);
    for (int r = 0; r < N; r++) {
        const __m128i bytes =
            to_bytes(o, requantize(low[r][0], &s[0], above), requantize(low[r][1], &s[1], above),
                     requantize(high[r][0], &s[2], above), requantize(high[r][1], &s[3], above));
        store_bytes(o, out + r * ldo, bytes, g->n - c < 16 ? g->n - c : 16);
    }
}

/* The accumulators themselves. */
FV_INLINE void tile_i32(const struct fv_nn_gemm *g, const struct panel *p, int32_t c,
                        const uint8_t *a, ptrdiff_t lda, const int32_t *sums, int32_t *out,
                        ptrdiff_t ldo, const int N)
{
    __m128i acc[ROWS][2];
    for (int h = 0; h < 2; h++) {
        accumulate(g, p, c, h, a, lda, sums, N, acc);
        for (int r = 0; r < N; r++) {
            __m128i *to = (__m128i *)(void *)(out + r * ldo + 8 * (ptrdiff_t)h);
            _mm_storeu_si128(to, acc[r][0]);
            _mm_storeu_si128(to + 1, acc[r][1]);
        }
    }
}

/* What is known of the next rows; returns whether they are enough for tiles. */
static int look_at(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t rows,
                   struct maxima *most, int32_t *sums)
{
    for (int32_t r = 0; r < rows; r++)
        sums[r] = sum_of(g, a + r * lda);
    if (rows < ROWS || g->k4 > GROUPS_MAX) return 0;
    init_maxima(most, g->k, a, lda, rows);
    return 1;
}

void fv_k_nn_gemm_u8__sse4(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    struct panel p;
    struct maxima most;
    struct output o;
    int32_t sums[CHUNK_ROWS_MAX];
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    for (int32_t i = 0, rows; i < m; i += rows, a += rows * lda, out += rows * ldo) {
        rows = next_rows(m - i);
        const int tiles = look_at(g, a, lda, rows, &most, sums);
        for (int32_t c = 0; c < g->n; c += 16) {
            struct scale4 s[4];
            for (int q = 0; q < 4; q++)
                load_scale(&s[q], g->multiplier + c + 4 * q, g->shift + c + 4 * q);
            if (tiles) init_panel(&p, g->weights + (ptrdiff_t)c * g->k4 * 4, g->k4, &most);
            for (int32_t r = 0; r < rows; r += tiles ? ROWS : 1) {
                const int32_t at = tiles ? tile_row(r, rows) : r;
                if (tiles)
                    tile_u8(g, &p, c, s, &o, a + at * lda, lda, sums + at, out + at * ldo + c, ldo,
                            ROWS);
                else
                    tile_u8(g, &p, c, s, &o, a + at * lda, lda, sums + at, out + at * ldo + c, ldo,
                            1);
            }
        }
    }
}

void fv_k_nn_gemm_i32__sse4(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                            int32_t *out, ptrdiff_t ldo, int32_t m)
{
    struct panel p;
    struct maxima most;
    int32_t sums[CHUNK_ROWS_MAX];
    for (int32_t i = 0, rows; i < m; i += rows, a += rows * lda, out += rows * ldo) {
        rows = next_rows(m - i);
        const int tiles = look_at(g, a, lda, rows, &most, sums);
        for (int32_t c = 0; c < g->n; c += 16) {
            if (tiles) init_panel(&p, g->weights + (ptrdiff_t)c * g->k4 * 4, g->k4, &most);
            for (int32_t r = 0; r < rows; r += tiles ? ROWS : 1) {
                const int32_t at = tiles ? tile_row(r, rows) : r;
                if (tiles)
                    tile_i32(g, &p, c, a + at * lda, lda, sums + at, out + at * ldo + c, ldo, ROWS);
                else
                    tile_i32(g, &p, c, a + at * lda, lda, sums + at, out + at * ldo + c, ldo, 1);
            }
        }
    }
}
