#include "kernels/kernels.h"

#include <immintrin.h>

/* Input index of each byte pair and its weights for 30 outputs of which the first has phase 0:
 * vpermb gathers the pairs of a whole vector at once, so one table serves. Two further outputs are
 * right too, but stepping by 30 keeps the phase. */
static const uint8_t pairs_30[64] = {
    0,  1,  1,  2,  2,  3,  3,  4,  4,  5,  6,  7,  7,  8,  8,  9,  9,  10, 10, 11, 12, 13,
    13, 14, 14, 15, 15, 16, 16, 17, 18, 19, 19, 20, 20, 21, 21, 22, 22, 23, 24, 25, 25, 26,
    26, 27, 27, 28, 28, 29, 30, 31, 31, 32, 32, 33, 33, 34, 34, 35, 36, 37, 37, 38};
#define FIVE 115, 13, 90, 38, 64, 64, 38, 90, 13, 115
static const int8_t weights_30[64] = {FIVE, FIVE, FIVE, FIVE, FIVE, FIVE, 115, 13, 90, 38};

void fv_k_shrink_row_u8__avx512icl(uint8_t *out, const uint8_t *in, int32_t count)
{
    const __m512i pairs = _mm512_loadu_si512(pairs_30), weights = _mm512_loadu_si512(weights_30);
    const __m512i half = _mm512_set1_epi16(256);
    for (int32_t i = 0; i < count; i += 30) {
        const __m512i gathered = _mm512_permutexvar_epi8(pairs, _mm512_loadu_si512(in + i / 5 * 6));
        const __m512i sum = _mm512_maddubs_epi16(gathered, weights);
        _mm256_storeu_si256((__m256i *)(out + i),
                            _mm512_cvtepi16_epi8(_mm512_mulhrs_epi16(sum, half)));
    }
}
