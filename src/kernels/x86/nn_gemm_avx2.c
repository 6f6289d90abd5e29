/* The matrix product on bytes with vpmaddubsw, whose sums of 16 bits run as far as they fit
 * (nn_gemm_runs.h). A tile is four rows by 16 channels, or eight rows by the last 8 channels. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_gemm_tiles_avx2.h"
#include "kernels/x86/nn_real_avx2.h"

enum { WIDENED = 512 };

/* Eight channels, from vectors of four with two sums of each. */
FV_INLINE __m256i add_pairs(__m256i low, __m256i high)
{
    return _mm256_permute4x64_epi64(_mm256_hadd_epi32(low, high), 0xD8);
}

/* One row, without knowing the groups: bytes widened to 16 bits, four channels by four k in a
 * vector. */
FV_INLINE void accumulate_one(const int8_t *weights, int32_t k4, const uint8_t *row,
                              __m256i acc[1][2])
{
    __m256i sum[4];
    _Alignas(32) uint16_t wide[4 * WIDENED];
    for (int i = 0; i < 4; i++)
        sum[i] = _mm256_setzero_si256();
    for (int32_t from = 0; from < k4; from += WIDENED) {
        const int32_t count = k4 - from < WIDENED ? k4 - from : WIDENED;
        for (int32_t i = 0; i < count; i += 4) {
            const void *bytes = row + 4 * (ptrdiff_t)(from + i);
            _mm256_store_si256((__m256i *)(void *)(wide + 4 * (ptrdiff_t)i),
                               _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)bytes)));
        }
        for (int32_t i = 0; i < count; i++, weights += 64) {
            const void *four = wide + 4 * (ptrdiff_t)i;
            const __m256i x = _mm256_broadcastq_epi64(_mm_loadl_epi64((const __m128i *)four));
#pragma GCC unroll 4
            for (int v = 0; v < 4; v++) {
                const void *from_w = weights + 16 * v;
                const __m256i w = _mm256_cvtepi8_epi16(_mm_load_si128((const __m128i *)from_w));
                sum[v] = _mm256_add_epi32(sum[v], _mm256_madd_epi16(x, w));
            }
        }
    }
    acc[0][0] = _mm256_add_epi32(acc[0][0], add_pairs(sum[0], sum[1]));
    acc[0][1] = _mm256_add_epi32(acc[0][1], add_pairs(sum[2], sum[3]));
}

/* The sum of a row's bytes as four parts of 64 bits; `rest` masks those of the last 32. */
FV_INLINE __m256i sum_parts(const uint8_t *row, int32_t k, __m256i rest)
{
    const __m256i zero = _mm256_setzero_si256();
    __m256i sum = zero;
    int32_t i = 0;
    for (; i + 32 <= k; i += 32) {
        const __m256i some = _mm256_loadu_si256((const __m256i *)(const void *)(row + i));
        sum = _mm256_add_epi64(sum, _mm256_sad_epu8(some, zero));
    }
    if (i == k) return sum;
    const __m256i last = _mm256_loadu_si256((const __m256i *)(const void *)(row + i));
    return _mm256_add_epi64(sum, _mm256_sad_epu8(_mm256_and_si256(rest, last), zero));
}

/* Factor times the sum of a row's k bytes, for each of `rows` rows, and up to three words more;
 * four at a time. */
static void sum_rows(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, int32_t rows,
                     int32_t *sums)
{
    static const uint8_t ends[64] = {255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255,
                                     255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255,
                                     255, 255, 255, 255, 255, 255, 255, 255, 255, 255};
    const __m256i rest = _mm256_loadu_si256((const __m256i *)(const void *)(ends + 32 - g->k % 32));
    const __m128i factor = _mm_set1_epi32(g->row_sum_factor);
    if (g->row_sum_factor == 0) return;
    for (int32_t i = 0; i < rows; i += ROWS, a += ROWS * lda) {
        __m256i parts[ROWS];
#pragma GCC unroll 4
        for (int32_t r = 0; r < ROWS; r++)
            parts[r] = sum_parts(a + (i + r < rows ? r : 0) * lda, g->k, rest);
        const __m256i first = _mm256_add_epi64(_mm256_unpacklo_epi64(parts[0], parts[1]),
                                               _mm256_unpackhi_epi64(parts[0], parts[1]));
        const __m256i last = _mm256_add_epi64(_mm256_unpacklo_epi64(parts[2], parts[3]),
                                              _mm256_unpackhi_epi64(parts[2], parts[3]));
        const __m256i words = low_words(first, last);
        const __m128i sum =
            _mm_add_epi32(_mm256_castsi256_si128(words), _mm256_extracti128_si256(words, 1));
        _mm_storeu_si128((__m128i *)(void *)(sums + i), _mm_mullo_epi32(sum, factor));
    }
}

/* 16 channels of the rows of a chunk. */
struct strip {
    const int32_t *bias, *sums;
    const uint8_t *a;
    uint8_t *out;
    ptrdiff_t lda, ldo;
    int32_t rows, width;
    struct scale8 scale[2];
};

/* Scale eight rows of 8 accumulators and store the first `width` of each. */
FV_INLINE void store_8(const struct output *o, const struct scale8 *scale, __m256i acc[EIGHT],
                       uint8_t *out, ptrdiff_t ldo, int32_t width, const int mode)
{
#pragma GCC unroll 8
    for (int r = 0; r < EIGHT; r++)
        acc[r] = requantize(acc[r], scale, mode);
#pragma GCC unroll 2
    for (int r = 0; r < EIGHT; r += 4) {
        const __m256i bytes = two_rows(o, &acc[r], &acc[r + 2], mode);
        const __m128i two[2] = {_mm256_castsi256_si128(bytes), _mm256_extracti128_si256(bytes, 1)};
#pragma GCC unroll 2
        for (int h = 0; h < 2; h++, out += 2 * ldo) {
            if (width == 8) {
                _mm_storel_epi64((__m128i *)(void *)out, two[h]);
                _mm_storeh_pi((__m64 *)(void *)(out + ldo), _mm_castsi128_ps(two[h]));
            } else {
                store_some(out, two[h], width);
                store_some(out + ldo, _mm_srli_si128(two[h], 8), width);
            }
        }
    }
}

FV_INLINE void strip_8_u8(const struct panel *p, const struct strip *s, const struct output *o,
                          const int mode)
{
    __m256i acc[EIGHT];
    for (int32_t i = 0; i < s->rows; i += EIGHT) {
        const int32_t at = i + EIGHT > s->rows ? s->rows - EIGHT : i;
        accumulate_8(p, s->bias, s->sums == NULL ? NULL : s->sums + at, s->a + at * s->lda, s->lda,
                     acc);
        store_8(o, s->scale, acc, s->out + at * s->ldo, s->ldo, s->width, mode);
    }
}

FV_INLINE void strip_u8(const struct panel *p, const struct strip *s, const struct output *o,
                        const int mode)
{
    __m256i acc[ROWS][2];
    for (int32_t i = 0; i < s->rows; i += ROWS) {
        const int32_t at = tile_row(i, s->rows);
        accumulate(p, s->bias, s->sums == NULL ? NULL : s->sums + at, s->a + at * s->lda, s->lda,
                   acc);
        store_tile(o, s->scale, acc, ROWS, s->out + at * s->ldo, s->ldo, s->width, mode);
    }
}

/* Inline, as all that is reached by addresses: what bytes are stored to is known not to be it. */
FV_INLINE void strip_in_mode(const struct panel *p, const struct strip *s, const struct output *o,
                             int mode)
{
    switch (mode) {
    case REAL | ABOVE_ZERO:
        strip_u8(p, s, o, REAL | ABOVE_ZERO);
        break;
    case REAL:
        strip_u8(p, s, o, REAL);
        break;
    case LESSENED | ABOVE_ZERO:
        strip_u8(p, s, o, LESSENED | ABOVE_ZERO);
        break;
    case LESSENED:
        strip_u8(p, s, o, LESSENED);
        break;
    case LESSENED | TABLED:
        strip_u8(p, s, o, LESSENED | TABLED);
        break;
    default:
        strip_u8(p, s, o, TABLED);
    }
}

FV_INLINE void strip_8_in_mode(const struct panel *p, const struct strip *s, const struct output *o,
                               int mode)
{
    switch (mode) {
    case REAL | ABOVE_ZERO:
        strip_8_u8(p, s, o, REAL | ABOVE_ZERO);
        break;
    case REAL:
        strip_8_u8(p, s, o, REAL);
        break;
    case LESSENED | ABOVE_ZERO:
    case LESSENED:
        strip_8_u8(p, s, o, LESSENED);
        break;
    case LESSENED | TABLED:
        strip_8_u8(p, s, o, LESSENED | TABLED);
        break;
    default:
        strip_8_u8(p, s, o, TABLED);
    }
}

/* How the results of 16 channels are made; where `real` is not 0 they are rounded as that says. */
static int load_mode(struct strip *s, const struct fv_nn_gemm *g, int32_t c, int real,
                     const struct scale8 *scale)
{
    if (real != 0) {
        s->scale[0].factor = scale->factor;
        s->scale[0].offset = scale->offset;
        return real;
    }
    const int mode = load_any_scales(s->scale, g->multiplier + c, g->shift + c);
    if (mode == 0 || g->table != NULL) return mode | TABLED;
    return g->act_min >= g->zero_out ? mode | ABOVE_ZERO : mode;
}

/* Fewer than a tile has. */
static __attribute__((noinline)) void few_rows_u8(const struct fv_nn_gemm *g, const uint8_t *a,
                                                  ptrdiff_t lda, uint8_t *out, ptrdiff_t ldo,
                                                  int32_t m)
{
    struct output o;
    int32_t sums[2 * ROWS] = {0};
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    sum_rows(g, a, lda, m, sums);
    for (int32_t c = 0; c < g->n; c += 16) {
        struct scale8 scale[2];
        const int32_t width = g->n - c < 16 ? g->n - c : 16;
        load_scales(scale, g->multiplier + c, g->shift + c);
        for (int32_t i = 0; i < m; i++) {
            __m256i acc[1][2];
            start(g->bias + c, sums + i, 1, acc);
            accumulate_one(g->weights + (ptrdiff_t)c * g->k4 * 4, g->k4, a + i * lda, acc);
            store_tile(&o, scale, acc, 1, out + i * ldo + c, ldo, width, TABLED);
        }
    }
}

void fv_k_nn_gemm_u8__avx2(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    if (g->k4 > GROUPS_MAX) {
        fv_k_nn_gemm_u8__c(g, a, lda, out, ldo, m);
        return;
    }
    if (m < ROWS) {
        few_rows_u8(g, a, lda, out, ldo, m);
        return;
    }
    struct panel p;
    struct maxima most;
    struct output o;
    struct scale8 scale;
    int32_t sums[CHUNK_ROWS_MAX + ROWS];
    int real = 0;
    if (g->table == NULL && (int64_t)m * g->n >= REAL_RESULTS_LEAST &&
        have_one_scale(g->multiplier, g->shift, g->n))
        real =
            find_real(&scale, g->multiplier[0], g->shift[0], g->zero_out, g->act_min, g->act_max);
    init_output(&o, g->zero_out, g->act_min, g->act_max, g->table);
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = next_rows(m - i);
        sum_rows(g, a + i * lda, lda, rows, sums);
        init_maxima(&most, g->k, a + i * lda, lda, rows);
        for (int32_t c = 0; c < g->n; c += 16) {
            struct strip s = {.bias = g->bias + c,
                              .sums = g->row_sum_factor == 0 ? NULL : sums,
                              .a = a + i * lda,
                              .out = out + i * ldo + c,
                              .lda = lda,
                              .ldo = ldo,
                              .rows = rows,
                              .width = g->n - c < 16 ? g->n - c : 16};
            const int mode = load_mode(&s, g, c, real, &scale);
            p.weights = g->weights + (ptrdiff_t)c * g->k4 * 4;
            init_panel(&p, p.weights, g->k4, &most);
            if (s.width <= 8 && rows >= EIGHT)
                strip_8_in_mode(&p, &s, &o, mode);
            else
                strip_in_mode(&p, &s, &o, mode);
        }
    }
}

FV_INLINE void store_words(__m256i acc[][2], const int N, int32_t *out, ptrdiff_t ldo)
{
    for (int r = 0; r < N; r++) {
        _mm256_storeu_si256((__m256i *)(void *)(out + r * ldo), acc[r][0]);
        _mm256_storeu_si256((__m256i *)(void *)(out + r * ldo + 8), acc[r][1]);
    }
}

void fv_k_nn_gemm_i32__avx2(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                            int32_t *out, ptrdiff_t ldo, int32_t m)
{
    struct panel p;
    struct maxima most;
    p.run_count = p.wide_count = 0;
    int32_t sums[CHUNK_ROWS_MAX + ROWS];
    for (int32_t i = 0, rows; i < m; i += rows) {
        rows = next_rows(m - i);
        const int tiles = rows >= ROWS && g->k4 <= GROUPS_MAX;
        sum_rows(g, a + i * lda, lda, rows, sums);
        if (tiles) init_maxima(&most, g->k, a + i * lda, lda, rows);
        for (int32_t c = 0; c < g->n; c += 16) {
            const int8_t *weights = g->weights + (ptrdiff_t)c * g->k4 * 4;
            if (tiles) init_panel(&p, weights, g->k4, &most);
            for (int32_t r = 0; r < rows; r += tiles ? ROWS : 1) {
                const int32_t at = tiles ? tile_row(r, rows) : r;
                const uint8_t *row = a + (i + at) * lda;
                int32_t *to = out + (i + at) * ldo + c;
                __m256i acc[ROWS][2];
                const int32_t *some = g->row_sum_factor == 0 ? NULL : sums + at;
                if (tiles) {
                    accumulate(&p, g->bias + c, some, row, lda, acc);
                } else {
                    start(g->bias + c, some, 1, acc);
                    accumulate_one(weights, g->k4, row, acc);
                }
                store_words(acc, tiles ? ROWS : 1, to, ldo);
            }
        }
    }
}
