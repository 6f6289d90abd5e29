#include <immintrin.h>

#define FV_NAME(kernel) fv_k_##kernel##__sse4
#define VECTOR __m128i
#define LANES 8
#define LOAD(p) _mm_loadu_si128((const __m128i *)(const void *)(p))
#define STORE(p, v) _mm_storeu_si128((__m128i *)(void *)(p), v)
#define EACH(n) _mm_set1_epi16(n)
#define ADD(a, b) _mm_add_epi16(a, b)
#define SUB(a, b) _mm_sub_epi16(a, b)
#define OR(a, b) _mm_or_si128(a, b)
#define AND(a, b) _mm_and_si128(a, b)
#define HIGH(a, b) _mm_mulhi_epu16(a, b)
#define MIN_U(a, b) _mm_min_epu16(a, b)
#define MIN_S(a, b) _mm_min_epi16(a, b)
#define MAX_S(a, b) _mm_max_epi16(a, b)
#define ABOVE(a, b) _mm_cmpgt_epi16(a, b)
#define UNLESS(a, b) _mm_andnot_si128(a, b)
#include "kernels/scale_vectors.h"
