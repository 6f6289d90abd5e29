#include "kernels/kernels.h"

static uint32_t hamming_bytes(const uint8_t *a, const uint8_t *b)
{
    uint32_t distance = 0;
    for (int i = 0; i < FV_DESCRIPTOR_BYTES; i++)
        distance += (uint32_t)__builtin_popcount((unsigned)(a[i] ^ b[i]));
    return distance;
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
