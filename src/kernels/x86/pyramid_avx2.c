#include "kernels/kernels.h"
#include "kernels/x86/shrink_table.h"

#include <immintrin.h>

/* pmulhrsw by 2^15 / 128 is the rounded shift by 7. */
static inline __m256i round7(__m256i sum)
{
    return _mm256_mulhrs_epi16(sum, _mm256_set1_epi16(256));
}

void fv_k_blend_rows_u8__avx2(uint8_t *out, const uint8_t *a, const uint8_t *b, int32_t count,
                              int32_t weight_b)
{
    const __m256i weights = _mm256_set1_epi16((int16_t)(weight_b << 8 | (128 - weight_b)));
    for (int32_t i = 0; i < count; i += 32) {
        const __m256i pa = _mm256_loadu_si256((const __m256i *)(a + i));
        const __m256i pb = _mm256_loadu_si256((const __m256i *)(b + i));
        const __m256i low = round7(_mm256_maddubs_epi16(_mm256_unpacklo_epi8(pa, pb), weights));
        const __m256i high = round7(_mm256_maddubs_epi16(_mm256_unpackhi_epi8(pa, pb), weights));
        _mm256_storeu_si256((__m256i *)(out + i), _mm256_packus_epi16(low, high));
    }
}

static inline __m256i sixteen(const uint8_t *in, int32_t i, int row)
{
    const int32_t j = i + 8;
    const __m256i pixels =
        _mm256_loadu2_m128i((const __m128i *)(in + j + j / 5), (const __m128i *)(in + i + i / 5));
    const __m256i pairs =
        _mm256_shuffle_epi8(pixels, _mm256_loadu_si256((const __m256i *)shrink_pairs[row]));
    return round7(
        _mm256_maddubs_epi16(pairs, _mm256_loadu_si256((const __m256i *)shrink_weights[row])));
}

void fv_k_shrink_row_u8__avx2(uint8_t *out, const uint8_t *in, int32_t count)
{
    int row = 0;
    for (int32_t i = 0; i < count; i += 32) {
        const __m256i first = sixteen(in, i, row),
                      second = sixteen(in, i + 16, row + 2 >= 5 ? row - 3 : row + 2);
        const __m256i mixed = _mm256_packus_epi16(first, second);
        _mm256_storeu_si256((__m256i *)(out + i),
                            _mm256_permute4x64_epi64(mixed, _MM_SHUFFLE(3, 1, 2, 0)));
        row = row == 0 ? 4 : row - 1; /* 4 rows further, mod 5 */
    }
}
