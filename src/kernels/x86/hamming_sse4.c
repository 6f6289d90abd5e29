#include "kernels/kernels.h"

#include <immintrin.h>
#include <string.h>

struct fv_words {
    uint64_t w[4];
};

static inline struct fv_words words_load(const uint8_t *descriptor)
{
    struct fv_words words;
    memcpy(&words, descriptor, sizeof words);
    return words;
}

static inline uint32_t hamming(const struct fv_words *a, const uint8_t *descriptor)
{
    const struct fv_words b = words_load(descriptor);
    return (uint32_t)(_mm_popcnt_u64(a->w[0] ^ b.w[0]) + _mm_popcnt_u64(a->w[1] ^ b.w[1]) +
                      _mm_popcnt_u64(a->w[2] ^ b.w[2]) + _mm_popcnt_u64(a->w[3] ^ b.w[3]));
}

void fv_k_hamming_two_u8__sse4(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                               int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    for (int32_t q = 0; q < query_count; q++) {
        const struct fv_words query = words_load(queries + FV_DESCRIPTOR_BYTES * (size_t)q);
        uint32_t best = FV_MATCH_NONE, next = FV_MATCH_NONE;
        const uint8_t *train = trains;
        for (int32_t t = 0; t < train_count; t++, train += FV_DESCRIPTOR_BYTES) {
            const uint32_t match = hamming(&query, train) << FV_MATCH_INDEX_BITS | (uint32_t)t;
            if (__builtin_expect(match > next, 1)) continue; /* after a few, nearly always */
            next = match < best ? best : match;
            best = match < best ? match : best;
        }
        nearest[q] = best;
        second[q] = next;
    }
}

void fv_k_hamming_some_u8__sse4(uint16_t *distances, const uint8_t *query,
                                const uint8_t *descriptors, const uint16_t *indices, int32_t count)
{
    const struct fv_words words = words_load(query);
    for (int32_t k = 0; k < count; k++)
        distances[k] =
            (uint16_t)hamming(&words, descriptors + FV_DESCRIPTOR_BYTES * (size_t)indices[k]);
}
