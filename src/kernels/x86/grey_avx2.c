#include "kernels/contracts/grey_ends.h"
#include "kernels/kernels.h"

#include <immintrin.h>

/* The pack works within 128-bit lanes: put the four quarters back in order. */
static inline __m256i pack(__m256i a, __m256i b)
{
    return _mm256_permute4x64_epi64(_mm256_packus_epi16(a, b), _MM_SHUFFLE(3, 1, 2, 0));
}

void fv_k_grey_shift_u16__avx2(uint8_t *grey, const uint8_t *source, int32_t count, int32_t shift)
{
    const __m128i by = _mm_cvtsi32_si128(shift);
    const __m256i white = _mm256_set1_epi16(255);
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        __m256i a = _mm256_loadu_si256((const __m256i *)(source + 2 * i));
        __m256i b = _mm256_loadu_si256((const __m256i *)(source + 2 * i + 32));
        a = _mm256_min_epu16(_mm256_srl_epi16(a, by), white);
        b = _mm256_min_epu16(_mm256_srl_epi16(b, by), white);
        _mm256_storeu_si256((__m256i *)(grey + i), pack(a, b));
    }
    fv_k_grey_shift_u16__c(grey + i, source + 2 * i, count - i, shift);
}

void fv_k_grey_pick_u8__avx2(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    const __m128i by = _mm_cvtsi32_si128(8 * offset);
    const __m256i low = _mm256_set1_epi16(255);
    int32_t i = 0;
    for (; i + 32 <= count; i += 32) {
        __m256i a = _mm256_loadu_si256((const __m256i *)(source + 2 * i));
        __m256i b = _mm256_loadu_si256((const __m256i *)(source + 2 * i + 32));
        a = _mm256_and_si256(_mm256_srl_epi16(a, by), low);
        b = _mm256_and_si256(_mm256_srl_epi16(b, by), low);
        _mm256_storeu_si256((__m256i *)(grey + i), pack(a, b));
    }
    fv_k_grey_pick_u8__c(grey + i, source + 2 * i, count - i, offset);
}

/* Eight pixels from twice twelve bytes: (first, green) and (third, 0) as words, weighed in 32 bits.
 */
static inline __m256i mix8(const uint8_t *source, __m256i outer, __m256i inner, __m256i round)
{
    const __m256i pair = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(0, -1, 1, -1, 3, -1, 4, -1, 6, -1, 7, -1, 9, -1, 10, -1));
    const __m256i last = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(2, -1, -1, -1, 5, -1, -1, -1, 8, -1, -1, -1, 11, -1, -1, -1));
    const __m256i bytes =
        _mm256_loadu2_m128i((const __m128i *)(source + 12), (const __m128i *)source);
    const __m256i a = _mm256_madd_epi16(_mm256_shuffle_epi8(bytes, pair), outer);
    const __m256i b = _mm256_madd_epi16(_mm256_shuffle_epi8(bytes, last), inner);
    return _mm256_srli_epi32(_mm256_add_epi32(_mm256_add_epi32(a, b), round), 15);
}

void fv_k_grey_mix_u8__avx2(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first,
                            int32_t third)
{
    const __m256i outer = _mm256_set1_epi32(19235 << 16 | first), inner = _mm256_set1_epi32(third);
    const __m256i round = _mm256_set1_epi32(16384),
                  order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    int32_t i = 0;
    for (; i + 34 <= count; i += 32) { /* the last load reaches 4 bytes further than 32 pixels */
        const uint8_t *s = source + 3 * i;
        const __m256i a =
            _mm256_packs_epi32(mix8(s, outer, inner, round), mix8(s + 24, outer, inner, round));
        const __m256i b = _mm256_packs_epi32(mix8(s + 48, outer, inner, round),
                                             mix8(s + 72, outer, inner, round));
        _mm256_storeu_si256((__m256i *)(grey + i),
                            _mm256_permutevar8x32_epi32(_mm256_packus_epi16(a, b), order));
    }
    fv_k_grey_mix_u8__c(grey + i, source + 3 * i, count - i, first, third);
}

static inline __m256i column(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    const __m256i a = _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)above));
    const __m256i r = _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)row));
    const __m256i b = _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)below));
    return _mm256_add_epi16(_mm256_add_epi16(a, b), _mm256_slli_epi16(r, 1));
}

void fv_k_grey_bayer_u8__avx2(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                              const uint8_t *below, int32_t count)
{
    int32_t x = 1;
    for (; x + 17 <= count; x += 16) {
        const __m256i left = column(above + x - 1, row + x - 1, below + x - 1);
        const __m256i middle = column(above + x, row + x, below + x);
        const __m256i right = column(above + x + 1, row + x + 1, below + x + 1);
        __m256i sum = _mm256_add_epi16(_mm256_add_epi16(left, right), _mm256_slli_epi16(middle, 1));
        sum = _mm256_srli_epi16(_mm256_add_epi16(sum, _mm256_set1_epi16(8)), 4);
        _mm_storeu_si128((__m128i *)(grey + x), _mm256_castsi256_si128(pack(sum, sum)));
    }
    fv_k_grey_bayer_ends(grey, above, row, below, count, x);
}
