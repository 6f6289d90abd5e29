/* Storing the first bytes of a vector, for network kernels of SSE4 and AVX2. */
#ifndef FOVEA_KERNELS_X86_NN_STORE_H
#define FOVEA_KERNELS_X86_NN_STORE_H

#include <immintrin.h>
#include <stdint.h>
#include <string.h>

#define FV_INLINE static inline __attribute__((always_inline))

/* The first `width` of 16 bytes, by stores that overlap. (Where a hot loop calls memcpy, its
 * checked form keeps GCC from holding sums in registers.) */
FV_INLINE void store_some(uint8_t *to, __m128i v, int32_t width)
{
    static const uint8_t count_up[32] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    if (width == 16) {
        _mm_storeu_si128((__m128i *)(void *)to, v);
    } else if (width >= 8) {
        const __m128i tail = _mm_loadu_si128((const __m128i *)(const void *)(count_up + width - 8));
        _mm_storel_epi64((__m128i *)(void *)to, v);
        _mm_storel_epi64((__m128i *)(void *)(to + width - 8), _mm_shuffle_epi8(v, tail));
    } else if (width >= 4) {
        const __m128i tail = _mm_loadu_si128((const __m128i *)(const void *)(count_up + width - 4));
        _mm_storeu_si32(to, v);
        _mm_storeu_si32(to + width - 4, _mm_shuffle_epi8(v, tail));
    } else {
        const int32_t all = _mm_cvtsi128_si32(v);
        for (int32_t i = 0; i < width; i++)
            to[i] = (uint8_t)(all >> 8 * i);
    }
}

#endif
