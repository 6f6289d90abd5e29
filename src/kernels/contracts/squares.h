/* Contracts of the kernels that compare descriptors of bytes by Euclidean distance.
 *
 * Train descriptors are packed in groups of FV_SQUARES_GROUP, zeros behind the last one and behind
 * the last byte of each: word w (bytes 4 w to 4 w + 3) of descriptor i of group g begins at byte 4
 * (FV_SQUARES_GROUP (g words + w) + i). Queries are q - 128, 4 words bytes each, 0 behind the last
 * byte. Every variant gives the same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_SQUARES_H
#define FOVEA_KERNELS_CONTRACTS_SQUARES_H

#include <stdint.h>

enum {
    FV_SQUARES_GROUP = 16,
    FV_SQUARES_WORDS_MAX = 32,
    FV_SQUARES_NONE = 0x3fffffff /* bias of what is behind the last train descriptor */
};

/* With v(t) = bias[t] - 2 sum of t's bytes times the query's: nearest[q] is the least v(t),
 * index[q] the lowest t that has it, second[q] the least v of the others. With bias[t] = |t|^2 -
 * 256 sum of t, v(t) is the squared distance less |q|^2. trains and bias 64-byte aligned, queries
 * 4-byte aligned; groups >= 1; words in [1, FV_SQUARES_WORDS_MAX]; query_count >= 0. */
typedef void fv_k_squares_two_u8_fn(int32_t *nearest, int32_t *second, uint32_t *index,
                                    const int8_t *queries, int32_t query_count,
                                    const uint8_t *trains, const int32_t *bias, int32_t groups,
                                    int32_t words);

/* The next three bound distances from below by a few values of each descriptor, find those that are
 * near enough, and compare these in full (features/bounded.h).
 *
 * Values are small: of queries [-63, 63], FV_BOUND_QUERIES of them one after the other, 2 pairs
 * bytes each; of trains too, kept as value + FV_BOUND_ZERO in groups of FV_BOUND_GROUP: values 2 p
 * and 2 p + 1 of train i of group g are bytes 2 (FV_BOUND_GROUP (g pairs + p) + i) and the next. */
enum { FV_BOUND_QUERIES = 4, FV_BOUND_GROUP = 32, FV_BOUND_LANES = 16, FV_BOUND_ZERO = 64 };

/* rows[q stride + t] = half[t] - sum of query q's values times those of t, modulo 2^16;
 * least[FV_BOUND_LANES q + i]: the least of those with t % FV_BOUND_LANES = i. trains, half and
 * rows 64-byte aligned; stride a multiple of FV_BOUND_GROUP, at least FV_BOUND_GROUP groups; groups
 * >= 1; pairs even, 2 to 64. */
typedef void fv_k_squares_bound_s16_fn(int16_t *rows, int32_t stride, int16_t *least,
                                       const int8_t *queries, const uint8_t *trains,
                                       const int16_t *half, int32_t groups, int32_t pairs);

/* indices[0..]: where row[i] <= limit, ascending; returns how many. row 64-byte aligned, count a
 * multiple of FV_BOUND_GROUP and at most 65536, room for count indices. */
typedef int32_t fv_k_squares_below_s16_fn(uint16_t *indices, const int16_t *row, int32_t count,
                                          int16_t limit);

/* distances[k] = squared distance of `query` and descriptor indices[k], of `bytes` [1, 128] each,
 * one after the other. No alignment; count >= 0. */
typedef void fv_k_squares_some_u8_fn(int32_t *distances, const uint8_t *query,
                                     const uint8_t *descriptors, int32_t bytes,
                                     const uint16_t *indices, int32_t count);

#endif
