/* Bounds and distances of descriptors of bytes, around two functions that each file defines for its
 * instruction set: `products` and `add_squares`. */
#ifndef FOVEA_KERNELS_NEON_SQUARES_BOUND_NEON_H
#define FOVEA_KERNELS_NEON_SQUARES_BOUND_NEON_H

#include <arm_neon.h>
#include <string.h>

#include "kernels/kernels.h"

/* Sixteen trains at a time: half a group, as many as FV_BOUND_LANES. */
enum { N = FV_BOUND_QUERIES, PART = FV_BOUND_GROUP / 2 };
_Static_assert((int)PART == (int)FV_BOUND_LANES, "the least of a part are those of the lanes");

/* sums[q]: products of query q with the PART trains that begin at `from`, modulo 2^16, where the
 * values of trains are taken as they are kept, FV_BOUND_ZERO too large. */
static inline void products(int16x8x2_t sums[N], const int8_t *queries, const uint8_t *from,
                            int32_t pairs);

/* Add the squares of 16 bytes, in four parts. */
static inline uint32x4_t add_squares(uint32x4_t sums, uint8x16_t apart);

static inline int8x16_t trains_of(const uint8_t *from)
{
    return vreinterpretq_s8_u8(vld1q_u8(from)); /* at most 127 */
}

static inline void fv_squares_bound(int16_t *rows, int32_t stride, int16_t *least,
                                    const int8_t *queries, const uint8_t *trains,
                                    const int16_t *half, int32_t groups, int32_t pairs)
{
    int16x8_t zero[N];
    int16x8x2_t lanes[N];
    for (int q = 0; q < N; q++) {
        int32_t sum = 0;
        for (int32_t i = 0; i < 2 * pairs; i++)
            sum += queries[(int64_t)q * 2 * pairs + i];
        zero[q] = vdupq_n_s16((int16_t)(FV_BOUND_ZERO * sum));
        lanes[q].val[0] = lanes[q].val[1] = vdupq_n_s16(INT16_MAX);
    }
    for (int32_t part = 0; part < 2 * groups; part++) {
        int16x8x2_t sums[N];
        products(sums, queries,
                 trains + (int64_t)(part / 2) * 2 * FV_BOUND_GROUP * pairs + (part & 1) * 2 * PART,
                 pairs);
        const int16_t *of = half + (int64_t)part * PART;
        for (int q = 0; q < N; q++)
            for (int k = 0; k < 2; k++) {
                const int16x8_t row =
                    vsubq_s16(vaddq_s16(vld1q_s16(of + 8 * k), zero[q]), sums[q].val[k]);
                vst1q_s16(rows + (int64_t)q * stride + (int64_t)part * PART + 8 * k, row);
                lanes[q].val[k] = vminq_s16(lanes[q].val[k], row);
            }
    }
    for (int q = 0; q < N; q++)
        for (int k = 0; k < 2; k++)
            vst1q_s16(least + (int64_t)q * FV_BOUND_LANES + 8 * k, lanes[q].val[k]);
}

static inline __attribute__((always_inline)) void
fv_squares_compare(int32_t *distances, const uint8_t *query, const uint8_t *descriptors,
                   int32_t bytes, const uint16_t *indices, int32_t count)
{
    const int32_t full = bytes / 16 * 16;
    for (int32_t k = 0; k < count; k++) {
        const uint8_t *other = descriptors + (int64_t)bytes * indices[k];
        uint32x4_t sums = vdupq_n_u32(0);
        int32_t sum = 0;
        for (int32_t i = 0; i < full; i += 16)
            sums = add_squares(sums, vabdq_u8(vld1q_u8(query + i), vld1q_u8(other + i)));
        for (int32_t i = full; i < bytes; i++)
            sum += (query[i] - other[i]) * (query[i] - other[i]);
        distances[k] = sum + (int32_t)vaddvq_u32(sums);
    }
}

static inline void fv_squares_some(int32_t *distances, const uint8_t *query,
                                   const uint8_t *descriptors, int32_t bytes,
                                   const uint16_t *indices, int32_t count)
{
    if (bytes == 128)
        fv_squares_compare(distances, query, descriptors, 128, indices, count);
    else
        fv_squares_compare(distances, query, descriptors, bytes, indices, count);
}

#endif
