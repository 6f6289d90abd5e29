#include <immintrin.h>

#define FV_NAME(kernel) fv_k_##kernel##__avx2
#define VECTOR __m256i
#define LANES 16
#define LOAD(p) _mm256_loadu_si256((const __m256i *)(const void *)(p))
#define STORE(p, v) _mm256_storeu_si256((__m256i *)(void *)(p), v)
#define EACH(n) _mm256_set1_epi16(n)
#define ADD(a, b) _mm256_add_epi16(a, b)
#define SUB(a, b) _mm256_sub_epi16(a, b)
#define OR(a, b) _mm256_or_si256(a, b)
#define AND(a, b) _mm256_and_si256(a, b)
#define HIGH(a, b) _mm256_mulhi_epu16(a, b)
#define MIN_U(a, b) _mm256_min_epu16(a, b)
#define MIN_S(a, b) _mm256_min_epi16(a, b)
#define MAX_S(a, b) _mm256_max_epi16(a, b)
#define ABOVE(a, b) _mm256_cmpgt_epi16(a, b)
#define UNLESS(a, b) _mm256_andnot_si256(a, b)
#include "kernels/scale_vectors.h"
