#include "kernels/kernels.h"

#include <string.h>

/* Bits that differ, in each byte of two words of 8 bytes. Without a vector set __builtin_popcount
 * is a call per byte. */
static inline uint64_t differing(const uint8_t *a, const uint8_t *b)
{
    uint64_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    x ^= y;
    x -= x >> 1 & 0x5555555555555555u;
    x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
    return (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0Fu;
}

static inline uint32_t hamming_bytes(const uint8_t *a, const uint8_t *b)
{
    uint64_t bytes = 0; /* at most 32 in each */
    for (int i = 0; i < FV_DESCRIPTOR_BYTES; i += 8)
        bytes += differing(a + i, b + i);
    /* The sum may be 256: by pairs of bytes. */
    const uint64_t pairs = (bytes & 0x00FF00FF00FF00FFu) + (bytes >> 8 & 0x00FF00FF00FF00FFu);
    return (uint32_t)(pairs * 0x0001000100010001u >> 48);
}

void fv_k_hamming_two_u8__c(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                            int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    for (int32_t q = 0; q < query_count; q++) {
        uint32_t best = FV_MATCH_NONE, next = FV_MATCH_NONE;
        for (int32_t t = 0; t < train_count; t++) {
            const uint32_t distance = hamming_bytes(queries + FV_DESCRIPTOR_BYTES * (size_t)q,
                                                    trains + FV_DESCRIPTOR_BYTES * (size_t)t);
            const uint32_t match = distance << FV_MATCH_INDEX_BITS | (uint32_t)t;
            const uint32_t loser = match > best ? match : best;
            if (match < best) best = match;
            if (loser < next) next = loser;
        }
        nearest[q] = best;
        second[q] = next;
    }
}

void fv_k_hamming_some_u8__c(uint16_t *distances, const uint8_t *query, const uint8_t *descriptors,
                             const uint16_t *indices, int32_t count)
{
    for (int32_t k = 0; k < count; k++)
        distances[k] =
            (uint16_t)hamming_bytes(query, descriptors + FV_DESCRIPTOR_BYTES * (size_t)indices[k]);
}
