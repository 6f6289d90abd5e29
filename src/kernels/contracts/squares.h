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

#endif
