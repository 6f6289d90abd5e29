/* Two nearest of many for sixteen queries at a time, around the distances of eight, which each file
 * defines for its instruction set: `hamming_eight`. */
#ifndef FOVEA_KERNELS_X86_HAMMING_AVX512_H
#define FOVEA_KERNELS_X86_HAMMING_AVX512_H

#include "kernels/kernels.h"

#include <immintrin.h>
#include <string.h>

static inline __m512i hamming_eight(const __m512i query[4], const __m512i train[4]);

static inline void fv_hamming_two(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                                  int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    for (int32_t q = 0; q < query_count; q += 16) {
        const int32_t left = query_count - q;
        const __mmask16 mask = left >= 16 ? 0xffffu : (__mmask16)((1u << left) - 1u);
        uint64_t lanes[2][4]
                      [8]; /* query 2 i + g is lane i of group g; missing ones repeat the last */
        for (int i = 0; i < 16; i++)
            for (int w = 0; w < 4; w++)
                memcpy(&lanes[i & 1][w][i >> 1],
                       queries + FV_DESCRIPTOR_BYTES * (size_t)(q + (i < left ? i : left - 1)) +
                           8 * w,
                       8);
        __m512i even[4], odd[4];
        for (int w = 0; w < 4; w++) {
            even[w] = _mm512_loadu_si512(lanes[0][w]);
            odd[w] = _mm512_loadu_si512(lanes[1][w]);
        }
        __m512i best = _mm512_set1_epi32(-1), next = best;
        const uint8_t *at = trains;
        for (int32_t t = 0; t < train_count; t++, at += FV_DESCRIPTOR_BYTES) {
            __m512i train[4];
            for (int w = 0; w < 4; w++) {
                int64_t word;
                memcpy(&word, at + 8 * w, 8);
                train[w] = _mm512_set1_epi64(word);
            }
            const __m512i distance = _mm512_or_si512(
                hamming_eight(even, train), _mm512_slli_epi64(hamming_eight(odd, train), 32));
            const __m512i match = _mm512_or_si512(_mm512_slli_epi32(distance, FV_MATCH_INDEX_BITS),
                                                  _mm512_set1_epi32(t));
            next = _mm512_min_epu32(next, _mm512_max_epu32(best, match));
            best = _mm512_min_epu32(best, match);
        }
        _mm512_mask_storeu_epi32(nearest + q, mask, best);
        _mm512_mask_storeu_epi32(second + q, mask, next);
    }
}

#endif
