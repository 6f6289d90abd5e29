/* The two nearest of many descriptors of bytes, by Euclidean distance: exact, on packed sets. */
#ifndef FOVEA_FEATURES_NEAREST_H
#define FOVEA_FEATURES_NEAREST_H

#include <stdint.h>

#include "base/arena.h"
#include "kernels/kernels.h"

/* A set of descriptors, as queries and as what is searched (kernels/contracts/squares.h). */
struct fv_packed {
    uint32_t count;
    uint8_t *trains;
    int32_t *bias;
    int8_t *queries;
    int32_t *square; /* of the length of each */
};

struct fv_nearest {
    uint32_t count_max, bytes;
    int32_t words;
};

/* Take memory for sets of `count_max` descriptors of `bytes` [1, 128]. Init-only. */
void fv_nearest_carve(struct fv_nearest *nearest, uint32_t count_max, uint32_t bytes,
                      struct fv_packed *sets, uint32_t set_count, struct fv_arena *arena);

/* Pack count (at most count_max) descriptors. Real-time safe. */
void fv_nearest_pack(const struct fv_nearest *nearest, struct fv_packed *set,
                     const uint8_t *descriptors, uint32_t count);

/* Squared distances of each of a to its nearest and second nearest of b, FV_SQUARES_NONE or above
 * where there is none; b has at least one. Real-time safe. */
void fv_nearest_find(const struct fv_nearest *nearest, const struct fv_kernels *kernels,
                     const struct fv_packed *a, const struct fv_packed *b, int32_t *distance,
                     int32_t *second, uint32_t *index);

#endif
