#include "kernels/kernels.h"

#include <arm_neon.h>

struct fv_descriptor {
    uint8x16_t low, high;
};

static inline struct fv_descriptor descriptor_load(const uint8_t *at)
{
    const struct fv_descriptor descriptor = {vld1q_u8(at), vld1q_u8(at + 16)};
    return descriptor;
}

/* Differing bits per byte pair, each at most 16. */
static inline uint8x16_t difference(const struct fv_descriptor *a, const struct fv_descriptor *b)
{
    return vaddq_u8(vcntq_u8(veorq_u8(a->low, b->low)), vcntq_u8(veorq_u8(a->high, b->high)));
}

/* Four queries at a time; pairwise additions bring the four distances into the lanes of one
 * register. */
void fv_k_hamming_two_u8__neon(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                               int32_t query_count, const uint8_t *trains, int32_t train_count)
{
    int32_t q = 0;
    for (; q + 4 <= query_count; q += 4) {
        struct fv_descriptor query[4];
        for (int i = 0; i < 4; i++)
            query[i] = descriptor_load(queries + FV_DESCRIPTOR_BYTES * (size_t)(q + i));
        uint32x4_t best = vdupq_n_u32(FV_MATCH_NONE), next = best;
        for (int32_t t = 0; t < train_count; t++) {
            const struct fv_descriptor train =
                descriptor_load(trains + FV_DESCRIPTOR_BYTES * (size_t)t);
            const uint8x16_t pairs =
                vpaddq_u8(difference(&query[0], &train), difference(&query[1], &train));
            const uint8x16_t more =
                vpaddq_u8(difference(&query[2], &train), difference(&query[3], &train));
            const uint32x4_t distance = vpaddlq_u16(vpaddlq_u8(vpaddq_u8(pairs, more)));
            const uint32x4_t match =
                vorrq_u32(vshlq_n_u32(distance, FV_MATCH_INDEX_BITS), vdupq_n_u32((uint32_t)t));
            next = vminq_u32(next, vmaxq_u32(best, match));
            best = vminq_u32(best, match);
        }
        vst1q_u32(nearest + q, best);
        vst1q_u32(second + q, next);
    }
    fv_k_hamming_two_u8__c(nearest + q, second + q, queries + FV_DESCRIPTOR_BYTES * (size_t)q,
                           query_count - q, trains, train_count);
}

void fv_k_hamming_some_u8__neon(uint16_t *distances, const uint8_t *query,
                                const uint8_t *descriptors, const uint16_t *indices, int32_t count)
{
    const struct fv_descriptor one = descriptor_load(query);
    for (int32_t k = 0; k < count; k++) {
        const struct fv_descriptor other =
            descriptor_load(descriptors + FV_DESCRIPTOR_BYTES * (size_t)indices[k]);
        distances[k] = vaddlvq_u8(difference(&one, &other));
    }
}
