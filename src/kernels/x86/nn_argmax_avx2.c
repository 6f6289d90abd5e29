#include <immintrin.h>

#include "kernels/kernels.h"

static inline int32_t largest(__m256i v)
{
    const __m128i both = _mm_max_epu8(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    const __m128i flipped = _mm_xor_si128(
        both, _mm_set1_epi8(-1)); /* the smallest of 255 - v, which has an instruction */
    return 255 -
           (_mm_cvtsi128_si32(_mm_minpos_epu16(_mm_min_epu8(flipped, _mm_srli_epi16(flipped, 8)))) &
            0xFF);
}

void fv_k_nn_argmax_u8__avx2(const uint8_t *in, int32_t axis, int32_t *out, int32_t count)
{
    for (int32_t i = 0; i < count; ++i, in += axis) {
        int32_t best = -1;
        for (int32_t k = 0; k < axis; k += 32) {
            const uint32_t valid = axis - k >= 32 ? ~0u : ~0u >> (32 - (axis - k));
            const __m256i lane_bits =
                _mm256_setr_epi64x((int64_t)0x8040201008040201, (int64_t)0x8040201008040201,
                                   (int64_t)0x8040201008040201, (int64_t)0x8040201008040201);
            const __m256i spread = _mm256_shuffle_epi8(
                _mm256_set1_epi32((int32_t)valid),
                _mm256_setr_epi64x(0, 0x0101010101010101, 0x0202020202020202, 0x0303030303030303));
            const __m256i keep = _mm256_cmpeq_epi8(_mm256_and_si256(spread, lane_bits), lane_bits);
            const __m256i v =
                _mm256_and_si256(_mm256_loadu_si256((const __m256i *)(const void *)(in + k)), keep);
            const int32_t value = largest(v);
            if (value <= best) continue;
            best = value;
            const uint32_t equal = (uint32_t)_mm256_movemask_epi8(
                                       _mm256_cmpeq_epi8(v, _mm256_set1_epi8((char)value))) &
                                   valid;
            out[i] = k + (int32_t)_tzcnt_u32(equal);
        }
    }
}
