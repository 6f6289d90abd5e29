/* The matrix product on bytes with vpmaddubsw, whose sums of 16 bits run as far as they fit
 * (nn_gemm_runs.h). A tile is four rows by 16 channels. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_real_avx2.h"

#define VECTOR __m256i
#define OP(name) _mm256_##name
#define WHOLE(name) _mm256_##name##_si256
#include "kernels/x86/nn_gemm_runs.h"

/* Where four rows of inputs begin. */
struct rows4 {
    const uint8_t *row[ROWS];
};

#define LOAD_GROUP                                                                                 \
    "movzwl (%[group]), %k[at]\n\t"                                                                \
    "add $2, %[group]\n\t"                                                                         \
    "vpbroadcastd (%[a],%[at],4), %[x]\n\t"                                                        \
    "vpbroadcastd (%[b],%[at],4), %[y]\n\t"                                                        \
    "vpbroadcastd (%[c],%[at],4), %[z]\n\t"                                                        \
    "vpbroadcastd (%[d],%[at],4), %[u]\n\t"                                                        \
    "shl $6, %[at]\n\t"                                                                            \
    "vmovdqa (%[w],%[at]), %[w0]\n\t"                                                              \
    "vmovdqa 32(%[w],%[at]), %[w1]\n\t"
#define FIRST_OF(x, s0, s1)                                                                        \
    "vpmaddubsw %[w0], %[" x "], %[" s0 "]\n\t"                                                    \
    "vpmaddubsw %[w1], %[" x "], %[" s1 "]\n\t"
#define NEXT_OF(x, s0, s1)                                                                         \
    "vpmaddubsw %[w0], %[" x "], %[t]\n\t"                                                         \
    "vpmaddubsw %[w1], %[" x "], %[" x "]\n\t"                                                     \
    "vpaddw %[t], %[" s0 "], %[" s0 "]\n\t"                                                        \
    "vpaddw %[" x "], %[" s1 "], %[" s1 "]\n\t"

#define FIRST_GROUP                                                                                \
    LOAD_GROUP                                                                                     \
    FIRST_OF("x", "a0", "a1")                                                                      \
    FIRST_OF("y", "b0", "b1") FIRST_OF("z", "c0", "c1") FIRST_OF("u", "d0", "d1")
#define NEXT_GROUP                                                                                 \
    LOAD_GROUP                                                                                     \
    NEXT_OF("x", "a0", "a1")                                                                       \
    NEXT_OF("y", "b0", "b1") NEXT_OF("z", "c0", "c1") NEXT_OF("u", "d0", "d1")

/* Products of four rows with the groups of four k of a run, in sums of 16 bits. Written out:
 * compilers move the sums around, or to the stack and back. */
FV_INLINE void sum_run(const struct panel *p, int32_t from, int32_t end, const struct rows4 *in,
                       __m256i sum[ROWS][2])
{
    const uint16_t *group = p->groups + from, *last = p->groups + end;
    __m256i x, y, z, u, w0, w1, t, a0, a1, b0, b1, c0, c1, d0, d1;
    uint64_t at;
    __asm__(FIRST_GROUP "cmp %[group], %[last]\n\t"
                        "je 2f\n"
                        "1:\n\t" NEXT_GROUP "cmp %[group], %[last]\n\t"
                        "jne 1b\n"
                        "2:"
            : [group] "+r"(group), [at] "=&r"(at), [x] "=&x"(x), [y] "=&x"(y), [z] "=&x"(z),
              [u] "=&x"(u), [w0] "=&x"(w0), [w1] "=&x"(w1), [t] "=&x"(t), [a0] "=&x"(a0),
              [a1] "=&x"(a1), [b0] "=&x"(b0), [b1] "=&x"(b1), [c0] "=&x"(c0), [c1] "=&x"(c1),
              [d0] "=&x"(d0), [d1] "=&x"(d1)
            : [last] "r"(last), [w] "r"(p->weights), [a] "r"(in->row[0]), [b] "r"(in->row[1]),
              [c] "r"(in->row[2]), [d] "r"(in->row[3])
            : "cc", "memory");
    sum[0][0] = a0;
    sum[0][1] = a1;
    sum[1][0] = b0;
    sum[1][1] = b1;
    sum[2][0] = c0;
    sum[2][1] = c1;
    sum[3][0] = d0;
    sum[3][1] = d1;
}

/* Adds the sums of a run, pair by pair, to those so far. */
FV_INLINE void add_sums(__m256i sum[ROWS][2], __m256i so_far[ROWS][2], __m256i acc[ROWS][2])
{
    const __m256i ones = _mm256_set1_epi16(1);
#pragma GCC unroll 4
    for (int r = 0; r < ROWS; r++) {
        acc[r][0] = _mm256_add_epi32(so_far[r][0], _mm256_madd_epi16(sum[r][0], ones));
        acc[r][1] = _mm256_add_epi32(so_far[r][1], _mm256_madd_epi16(sum[r][1], ones));
    }
}

/* Products of N rows with a group of four k for any weights. */
FV_INLINE void add_wide(const uint8_t *a, ptrdiff_t lda, const int N, const int8_t *w,
                        __m256i acc[][2])
{
    const __m256i w0 = load32(w), w1 = load32(w + 32);
    const __m256i even0 = _mm256_srai_epi16(_mm256_slli_epi16(w0, 8), 8),
                  odd0 = _mm256_srai_epi16(w0, 8);
    const __m256i even1 = _mm256_srai_epi16(_mm256_slli_epi16(w1, 8), 8),
                  odd1 = _mm256_srai_epi16(w1, 8);
#pragma GCC unroll 4
    for (int r = 0; r < N; r++) {
        const __m256i x = four_inputs(a + r * lda);
        const __m256i even = _mm256_and_si256(x, _mm256_set1_epi16(255)),
                      odd = _mm256_srli_epi16(x, 8);
        acc[r][0] = _mm256_add_epi32(acc[r][0], _mm256_madd_epi16(even, even0));
        acc[r][1] = _mm256_add_epi32(acc[r][1], _mm256_madd_epi16(even, even1));
        acc[r][0] = _mm256_add_epi32(acc[r][0], _mm256_madd_epi16(odd, odd0));
        acc[r][1] = _mm256_add_epi32(acc[r][1], _mm256_madd_epi16(odd, odd1));
    }
}

/* `sums`: NULL where nothing is to be added. */
FV_INLINE void start(const int32_t *bias, const int32_t *sums, const int N, __m256i acc[][2])
{
#pragma GCC unroll 4
    for (int r = 0; r < N; r++) {
        acc[r][0] = load32(bias);
        acc[r][1] = load32(bias + 8);
    }
    if (sums == NULL) return;
#pragma GCC unroll 4
    for (int r = 0; r < N; r++) {
        const __m256i sum = _mm256_set1_epi32(sums[r]);
        acc[r][0] = _mm256_add_epi32(acc[r][0], sum);
        acc[r][1] = _mm256_add_epi32(acc[r][1], sum);
    }
}

/* Sums that stand in memory while other loops need the registers. */
FV_INLINE void put_aside(__m256i acc[ROWS][2], __m256i to[ROWS][2])
{
    for (int r = 0; r < ROWS; r++) {
        _mm256_store_si256(&to[r][0], acc[r][0]);
        _mm256_store_si256(&to[r][1], acc[r][1]);
    }
}

/* The first run stands before the start: until it ends no other sums take registers. */
FV_INLINE void accumulate(const struct panel *p, const int32_t *bias, const int32_t *sums,
                          const uint8_t *a, ptrdiff_t lda, __m256i acc[ROWS][2])
{
    const struct rows4 rows = {{a, a + lda, a + 2 * lda, a + 3 * lda}};
    __m256i sum[ROWS][2], begin[ROWS][2], aside[ROWS][2];
    if (p->run_count > 0) {
        sum_run(p, 0, p->end[0], &rows, sum);
        start(bias, sums, ROWS, begin);
        add_sums(sum, begin, acc);
    } else {
        start(bias, sums, ROWS, acc);
    }
    for (int32_t i = 1; i < p->run_count; i++) {
        put_aside(acc, aside);
        __asm__("" : "+m"(aside));
        sum_run(p, p->end[i - 1], p->end[i], &rows, sum);
        add_sums(sum, aside, acc);
    }
    for (int32_t i = 1; i <= p->wide_count; i++) {
        const ptrdiff_t group = p->groups[GROUPS_MAX - i];
        add_wide(a + 4 * group, lda, ROWS, p->weights + 64 * group, acc);
    }
}

/* One row, without knowing the groups. */
FV_INLINE void accumulate_one(const int8_t *weights, int32_t k4, const uint8_t *row,
                              __m256i acc[1][2])
{
    for (int32_t i = 0; i < k4; i++)
        add_wide(row + 4 * (ptrdiff_t)i, 0, 1, weights + 64 * (ptrdiff_t)i, acc);
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

FV_INLINE void strip_u8(const struct panel *p, const struct strip *s, const struct output *o,
                        int32_t k4, const int mode)
{
    __m256i acc[ROWS][2];
    if (s->rows < ROWS) {
        for (int32_t i = 0; i < s->rows; i++) {
            start(s->bias, s->sums == NULL ? NULL : s->sums + i, 1, acc);
            accumulate_one(p->weights, k4, s->a + i * s->lda, acc);
            store_tile(o, s->scale, acc, 1, s->out + i * s->ldo, s->ldo, s->width, mode);
        }
        return;
    }
    for (int32_t i = 0; i < s->rows; i += ROWS) {
        const int32_t at = tile_row(i, s->rows);
        accumulate(p, s->bias, s->sums == NULL ? NULL : s->sums + at, s->a + at * s->lda, s->lda,
                   acc);
        store_tile(o, s->scale, acc, ROWS, s->out + at * s->ldo, s->ldo, s->width, mode);
    }
}

static void strip_in_mode(const struct panel *p, const struct strip *s, const struct output *o,
                          int32_t k4, int mode)
{
    switch (mode) {
    case REAL | ABOVE_ZERO:
        strip_u8(p, s, o, k4, REAL | ABOVE_ZERO);
        break;
    case REAL:
        strip_u8(p, s, o, k4, REAL);
        break;
    case LESSENED | ABOVE_ZERO:
        strip_u8(p, s, o, k4, LESSENED | ABOVE_ZERO);
        break;
    case LESSENED:
        strip_u8(p, s, o, k4, LESSENED);
        break;
    case LESSENED | TABLED:
        strip_u8(p, s, o, k4, LESSENED | TABLED);
        break;
    default:
        strip_u8(p, s, o, k4, TABLED);
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

void fv_k_nn_gemm_u8__avx2(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda,
                           uint8_t *out, ptrdiff_t ldo, int32_t m)
{
    if (g->k4 > GROUPS_MAX) {
        fv_k_nn_gemm_u8__c(g, a, lda, out, ldo, m);
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
        if (rows >= ROWS) init_maxima(&most, g->k, a + i * lda, lda, rows);
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
            if (rows >= ROWS) init_panel(&p, p.weights, g->k4, &most);
            strip_in_mode(&p, &s, &o, g->k4, mode);
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
