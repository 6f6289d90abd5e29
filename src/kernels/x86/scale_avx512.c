#include <immintrin.h>

#define FV_NAME(kernel) fv_k_##kernel##__avx512
#define VECTOR __m512i
#define LANES 32
#define LOAD(p) _mm512_loadu_si512((const __m512i *)(const void *)(p))
#define STORE(p, v) _mm512_storeu_si512((__m512i *)(void *)(p), v)
#define EACH(n) _mm512_set1_epi16(n)
#define ADD(a, b) _mm512_add_epi16(a, b)
#define SUB(a, b) _mm512_sub_epi16(a, b)
#define OR(a, b) _mm512_or_si512(a, b)
#define AND(a, b) _mm512_and_si512(a, b)
#define HIGH(a, b) _mm512_mulhi_epu16(a, b)
#define MIN_U(a, b) _mm512_min_epu16(a, b)
#define MIN_S(a, b) _mm512_min_epi16(a, b)
#define MAX_S(a, b) _mm512_max_epi16(a, b)
#define ABOVE(a, b) _mm512_movm_epi16(_mm512_cmpgt_epi16_mask(a, b))
#define UNLESS(a, b) _mm512_andnot_si512(a, b)
#include "kernels/scale_vectors.h"
