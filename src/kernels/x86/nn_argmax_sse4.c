#include <smmintrin.h>

#include "kernels/kernels.h"

static inline int32_t largest(__m128i v)
{
    /* the smallest of 255 - v, which has an instruction */
    const __m128i flipped = _mm_xor_si128(v, _mm_set1_epi8(-1));
    return 255 - _mm_extract_epi16(
                     _mm_minpos_epu16(_mm_min_epu8(flipped, _mm_srli_epi16(flipped, 8))), 0) %
                     256;
}

void fv_k_nn_argmax_u8__sse4(const uint8_t *in, int32_t axis, int32_t *out, int32_t count)
{
    static const uint8_t ends[32] = {255, 255, 255, 255, 255, 255, 255, 255,
                                     255, 255, 255, 255, 255, 255, 255, 255};
    for (int32_t i = 0; i < count; i++, in += axis) {
        int32_t best = -1;
        for (int32_t k = 0; k < axis; k += 16) {
            const int32_t left = axis - k < 16 ? axis - k : 16;
            const __m128i keep = _mm_loadu_si128((const __m128i *)(const void *)(ends + 16 - left));
            const __m128i v =
                _mm_and_si128(_mm_loadu_si128((const __m128i *)(const void *)(in + k)), keep);
            const int32_t value = largest(v);
            if (value <= best) continue;
            best = value;
            const int equal = _mm_movemask_epi8(
                _mm_and_si128(_mm_cmpeq_epi8(v, _mm_set1_epi8((char)value)), keep));
            out[i] = k + __builtin_ctz((unsigned)equal);
        }
    }
}
