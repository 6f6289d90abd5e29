/* Tiles of the matrix product with AVX2: sums of four rows and 16 channels, or of eight rows and 8
 * channels. Included by nn_gemm_avx2.c. */
#ifndef FOVEA_KERNELS_X86_NN_GEMM_TILES_AVX2_H
#define FOVEA_KERNELS_X86_NN_GEMM_TILES_AVX2_H

#include "kernels/x86/nn_avx2.h"

#define VECTOR __m256i
#define OP(name) _mm256_##name
#define WHOLE(name) _mm256_##name##_si256
#include "kernels/x86/nn_gemm_runs.h"

enum { EIGHT = 2 * ROWS };

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

#define LOAD_GROUP_8                                                                               \
    "movzwl (%[group]), %k[at]\n\t"                                                                \
    "add $2, %[group]\n\t"                                                                         \
    "lea (%[a],%[at],4), %[x]\n\t"                                                                 \
    "lea (%[x],%[lda],4), %[y]\n\t"                                                                \
    "shl $6, %[at]\n\t"                                                                            \
    "vmovdqa (%[w],%[at]), %[w0]\n\t"
#define FIRST_AT(row, s)                                                                           \
    "vpbroadcastd " row ", %[" s "]\n\t"                                                           \
    "vpmaddubsw %[w0], %[" s "], %[" s "]\n\t"
#define NEXT_AT(row, s)                                                                            \
    "vpbroadcastd " row ", %[t]\n\t"                                                               \
    "vpmaddubsw %[w0], %[t], %[t]\n\t"                                                             \
    "vpaddw %[t], %[" s "], %[" s "]\n\t"
#define EIGHT_ROWS(what)                                                                           \
    what("(%[x])", "s0") what("(%[x],%[lda])", "s1") what("(%[x],%[lda],2)", "s2")                 \
        what("(%[x],%[lda3])", "s3") what("(%[y])", "s4") what("(%[y],%[lda])", "s5")              \
            what("(%[y],%[lda],2)", "s6") what("(%[y],%[lda3])", "s7")

/* Products of eight rows and 8 channels with a run, likewise. */
FV_INLINE void sum_run_8(const struct panel *p, int32_t from, int32_t end, const uint8_t *a,
                         ptrdiff_t lda, __m256i sum[EIGHT])
{
    const uint16_t *group = p->groups + from, *last = p->groups + end;
    __m256i w0, t, s0, s1, s2, s3, s4, s5, s6, s7;
    const uint8_t *x, *y;
    uint64_t at;
    __asm__(LOAD_GROUP_8 EIGHT_ROWS(FIRST_AT) "cmp %[group], %[last]\n\t"
                                              "je 2f\n"
                                              "1:\n\t" LOAD_GROUP_8 EIGHT_ROWS(
                                                  NEXT_AT) "cmp %[group], %[last]\n\t"
                                                           "jne 1b\n"
                                                           "2:"
            : [group] "+r"(group), [at] "=&r"(at), [x] "=&r"(x), [y] "=&r"(y), [w0] "=&x"(w0),
              [t] "=&x"(t), [s0] "=&x"(s0), [s1] "=&x"(s1), [s2] "=&x"(s2), [s3] "=&x"(s3),
              [s4] "=&x"(s4), [s5] "=&x"(s5), [s6] "=&x"(s6), [s7] "=&x"(s7)
            : [last] "r"(last), [w] "r"(p->weights), [a] "r"(a), [lda] "r"(lda), [lda3] "r"(3 * lda)
            : "cc", "memory");
    sum[0] = s0;
    sum[1] = s1;
    sum[2] = s2;
    sum[3] = s3;
    sum[4] = s4;
    sum[5] = s5;
    sum[6] = s6;
    sum[7] = s7;
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

/* A group of four k of eight rows and 8 channels for any weights. */
FV_INLINE void add_wide_8(const uint8_t *a, ptrdiff_t lda, const int8_t *weights,
                          __m256i acc[EIGHT])
{
    const __m256i w = load32(weights), odd = _mm256_srai_epi16(w, 8),
                  even = _mm256_srai_epi16(_mm256_slli_epi16(w, 8), 8);
#pragma GCC unroll 8
    for (int r = 0; r < EIGHT; r++) {
        const __m256i x = four_inputs(a + r * lda);
        const __m256i low = _mm256_and_si256(x, _mm256_set1_epi16(255));
        acc[r] = _mm256_add_epi32(acc[r], _mm256_madd_epi16(low, even));
        acc[r] = _mm256_add_epi32(acc[r], _mm256_madd_epi16(_mm256_srli_epi16(x, 8), odd));
    }
}

FV_INLINE void start_8(const int32_t *bias, const int32_t *sums, __m256i acc[EIGHT])
{
#pragma GCC unroll 8
    for (int r = 0; r < EIGHT; r++) {
        acc[r] = load32(bias);
        if (sums != NULL) acc[r] = _mm256_add_epi32(acc[r], _mm256_set1_epi32(sums[r]));
    }
}

FV_INLINE void add_sums_8(const __m256i sum[EIGHT], const __m256i so_far[EIGHT], __m256i acc[EIGHT])
{
#pragma GCC unroll 8
    for (int r = 0; r < EIGHT; r++) {
        acc[r] = _mm256_add_epi32(so_far[r], _mm256_madd_epi16(sum[r], _mm256_set1_epi16(1)));
    }
}

FV_INLINE void accumulate_8(const struct panel *p, const int32_t *bias, const int32_t *sums,
                            const uint8_t *a, ptrdiff_t lda, __m256i acc[EIGHT])
{
    __m256i sum[EIGHT], begin[EIGHT], aside[EIGHT];
    if (p->run_count > 0) {
        sum_run_8(p, 0, p->end[0], a, lda, sum);
        start_8(bias, sums, begin);
        add_sums_8(sum, begin, acc);
    } else {
        start_8(bias, sums, acc);
    }
    for (int32_t i = 1; i < p->run_count; i++) {
#pragma GCC unroll 8
        for (int r = 0; r < EIGHT; r++)
            _mm256_store_si256(&aside[r], acc[r]);
        __asm__("" : "+m"(aside));
        sum_run_8(p, p->end[i - 1], p->end[i], a, lda, sum);
        add_sums_8(sum, aside, acc);
    }
    for (int32_t i = 1; i <= p->wide_count; i++) {
        const ptrdiff_t group = p->groups[GROUPS_MAX - i];
        add_wide_8(a + 4 * group, lda, p->weights + 64 * group, acc);
    }
}

#endif
