/* Contracts of the kernels that compare binary descriptors of 256 bits (32 bytes each, one after
 * the other).
 *
 * A match is one number: (Hamming distance << 16) | index. So the smaller of two is the nearer, and
 * of two equally near ones that with the lower index, which is what OpenCV's brute-force matcher
 * gives. FV_MATCH_NONE: there is none.
 *
 * Common to all: descriptors 8-byte aligned; nothing is read or written outside the stated ranges;
 * every variant gives the same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_HAMMING_H
#define FOVEA_KERNELS_CONTRACTS_HAMMING_H

#include <stdint.h>

#define FV_MATCH_NONE 0xffffffffu
enum { FV_MATCH_INDEX_BITS = 16 };

/* For each query the nearest and the second nearest of the train descriptors. query_count >= 0,
 * 0 <= train_count <= 65535. */
typedef void fv_k_hamming_two_u8_fn(uint32_t *nearest, uint32_t *second, const uint8_t *queries,
                                    int32_t query_count, const uint8_t *trains,
                                    int32_t train_count);

/* distances[k] = Hamming distance of `query` and descriptor indices[k], for guided search. count >=
 * 0. */
typedef void fv_k_hamming_some_u8_fn(uint16_t *distances, const uint8_t *query,
                                     const uint8_t *descriptors, const uint16_t *indices,
                                     int32_t count);

#endif
