#include "kernels/contracts/grey_ends.h"
#include "kernels/kernels.h"

#include <immintrin.h>

/* min against 255 before the saturating pack, which takes its input as signed. */
void fv_k_grey_shift_u16__sse4(uint8_t *grey, const uint8_t *source, int32_t count, int32_t shift)
{
    const __m128i by = _mm_cvtsi32_si128(shift), white = _mm_set1_epi16(255);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        __m128i a = _mm_loadu_si128((const __m128i *)(source + 2 * i));
        __m128i b = _mm_loadu_si128((const __m128i *)(source + 2 * i + 16));
        a = _mm_min_epu16(_mm_srl_epi16(a, by), white);
        b = _mm_min_epu16(_mm_srl_epi16(b, by), white);
        _mm_storeu_si128((__m128i *)(grey + i), _mm_packus_epi16(a, b));
    }
    fv_k_grey_shift_u16__c(grey + i, source + 2 * i, count - i, shift);
}

void fv_k_grey_pick_u8__sse4(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset)
{
    const __m128i by = _mm_cvtsi32_si128(8 * offset), low = _mm_set1_epi16(255);
    int32_t i = 0;
    for (; i + 16 <= count; i += 16) {
        __m128i a = _mm_loadu_si128((const __m128i *)(source + 2 * i));
        __m128i b = _mm_loadu_si128((const __m128i *)(source + 2 * i + 16));
        a = _mm_and_si128(_mm_srl_epi16(a, by), low);
        b = _mm_and_si128(_mm_srl_epi16(b, by), low);
        _mm_storeu_si128((__m128i *)(grey + i), _mm_packus_epi16(a, b));
    }
    fv_k_grey_pick_u8__c(grey + i, source + 2 * i, count - i, offset);
}

/* Four pixels from twelve of sixteen bytes: (first, green) and (third, 0) as words, weighed in 32
 * bits. */
static inline __m128i mix4(const uint8_t *source, __m128i outer, __m128i inner, __m128i round)
{
    const __m128i pair = _mm_setr_epi8(0, -1, 1, -1, 3, -1, 4, -1, 6, -1, 7, -1, 9, -1, 10, -1);
    const __m128i last = _mm_setr_epi8(2, -1, -1, -1, 5, -1, -1, -1, 8, -1, -1, -1, 11, -1, -1, -1);
    const __m128i bytes = _mm_loadu_si128((const __m128i *)source);
    const __m128i a = _mm_madd_epi16(_mm_shuffle_epi8(bytes, pair), outer);
    const __m128i b = _mm_madd_epi16(_mm_shuffle_epi8(bytes, last), inner);
    return _mm_srli_epi32(_mm_add_epi32(_mm_add_epi32(a, b), round), 15);
}

void fv_k_grey_mix_u8__sse4(uint8_t *grey, const uint8_t *source, int32_t count, int32_t first,
                            int32_t third)
{
    const __m128i outer = _mm_set1_epi32(19235 << 16 | first), inner = _mm_set1_epi32(third);
    const __m128i round = _mm_set1_epi32(16384);
    int32_t i = 0;
    for (; i + 18 <= count; i += 16) { /* the last load reaches 4 bytes further than 16 pixels */
        const uint8_t *s = source + 3 * i;
        const __m128i a =
            _mm_packs_epi32(mix4(s, outer, inner, round), mix4(s + 12, outer, inner, round));
        const __m128i b =
            _mm_packs_epi32(mix4(s + 24, outer, inner, round), mix4(s + 36, outer, inner, round));
        _mm_storeu_si128((__m128i *)(grey + i), _mm_packus_epi16(a, b));
    }
    fv_k_grey_mix_u8__c(grey + i, source + 3 * i, count - i, first, third);
}

static inline __m128i column(const uint8_t *above, const uint8_t *row, const uint8_t *below)
{
    const __m128i a = _mm_cvtepu8_epi16(_mm_loadl_epi64((const __m128i *)above));
    const __m128i r = _mm_cvtepu8_epi16(_mm_loadl_epi64((const __m128i *)row));
    const __m128i b = _mm_cvtepu8_epi16(_mm_loadl_epi64((const __m128i *)below));
    return _mm_add_epi16(_mm_add_epi16(a, b), _mm_slli_epi16(r, 1));
}

void fv_k_grey_bayer_u8__sse4(uint8_t *grey, const uint8_t *above, const uint8_t *row,
                              const uint8_t *below, int32_t count)
{
    int32_t x = 1;
    for (; x + 9 <= count; x += 8) {
        const __m128i left = column(above + x - 1, row + x - 1, below + x - 1);
        const __m128i middle = column(above + x, row + x, below + x);
        const __m128i right = column(above + x + 1, row + x + 1, below + x + 1);
        __m128i sum = _mm_add_epi16(_mm_add_epi16(left, right), _mm_slli_epi16(middle, 1));
        sum = _mm_srli_epi16(_mm_add_epi16(sum, _mm_set1_epi16(8)), 4);
        _mm_storel_epi64((__m128i *)(grey + x), _mm_packus_epi16(sum, sum));
    }
    fv_k_grey_bayer_ends(grey, above, row, below, count, x);
}
