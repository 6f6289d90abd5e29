/* Matching of binary descriptors: brute force over two sets.
 *
 * Distances are Hamming distances of 256 bits. Of equally near descriptors the one with the lower
 * index counts as the nearest. Integer,
 * deterministic, bounded. */
#ifndef FOVEA_FEATURES_MATCH_H
#define FOVEA_FEATURES_MATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_MATCH_COUNT_MAX = 65535, FV_MATCH_DISTANCE_ANY = 256, FV_MATCH_RATIO_ANY = 256 };

struct fv_match {
    uint16_t query, train; /* indices */
    uint16_t distance;     /* [0, 256] */
    uint16_t second;       /* of the second nearest; 257 where there is none */
};

struct fv_match_rules {
    uint16_t distance_max; /* [0, 256], FV_MATCH_DISTANCE_ANY: no limit */
    /* [1, 256]: kept when 256 distance < ratio_q8 second (Lowe's ratio test; 0.8 is 205);
     * FV_MATCH_RATIO_ANY: not tested */
    uint16_t ratio_q8;
    bool mutual; /* cross check: the query must be the nearest of its train as well */
};

struct fv_matcher {
    uint32_t count_max;
    uint32_t *nearest, *second;   /* per query */
    uint32_t *back, *back_second; /* per train */
};

/* Take memory for sets of at most `count_max` (at most FV_MATCH_COUNT_MAX) descriptors. Sets sizes
 * and addresses only. */
void fv_matcher_carve(struct fv_matcher *matcher, uint32_t count_max, struct fv_arena *arena);

/* Compare all with all. Descriptors are FV_DESCRIPTOR_BYTES each, 8-byte aligned; counts at most
 * count_max. Fills `matches` (room for query_count) in order of queries; returns how many.
 * Real-time safe: cost query_count * train_count, twice with the cross check. */
uint32_t fv_match_all(struct fv_matcher *matcher, const struct fv_kernels *kernels,
                      const uint8_t *queries, uint32_t query_count, const uint8_t *trains,
                      uint32_t train_count, const struct fv_match_rules *rules,
                      struct fv_match *matches);

#ifdef __cplusplus
}
#endif
#endif
