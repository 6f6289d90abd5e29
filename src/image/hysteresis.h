/* Hysteresis on bitmaps: the weak pixels that are connected with an edge become edges.
 *
 * 64 pixels are one word, the leftmost the highest bit. A word is visited once, and again when one
 * of its eight neighbours gained an edge, which each does at most 64 times: the work is bounded by
 * a multiple of the pixels. Words that wait are in a stack that holds each at most once. */
#ifndef FOVEA_IMAGE_HYSTERESIS_H
#define FOVEA_IMAGE_HYSTERESIS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How far it is. No addresses and no padding. */
struct fv_hysteresis_state {
    int64_t next;     /* word that was not visited yet */
    uint32_t waiting; /* words in the stack */
    uint32_t reserved;
};

struct fv_hysteresis {
    int32_t height, words;  /* words of a row */
    int32_t stride;         /* words from row to row: one empty word on either side */
    uint64_t *weak, *edges; /* height + 2 rows: an empty one above and below */
    uint32_t *stack;
    uint8_t *waiting; /* per word */
};

void fv_hysteresis_carve(struct fv_hysteresis *hysteresis, int32_t width, int32_t height,
                         struct fv_arena *arena);

/* Rows to be filled: weak pixels, and edges, which are weak pixels as well. */
static inline uint64_t *fv_hysteresis_weak(const struct fv_hysteresis *hysteresis, int32_t y)
{
    return hysteresis->weak + (int64_t)(y + 1) * hysteresis->stride + 1;
}

static inline uint64_t *fv_hysteresis_edges(const struct fv_hysteresis *hysteresis, int32_t y)
{
    return hysteresis->edges + (int64_t)(y + 1) * hysteresis->stride + 1;
}

/* Grow the edges over all weak pixels that they touch, in eight directions: begin, then visit at
 * most `words` words at a time until true is returned. Real-time safe. */
void fv_hysteresis_begin(const struct fv_hysteresis *hysteresis, struct fv_hysteresis_state *state);
bool fv_hysteresis_advance(const struct fv_hysteresis *hysteresis,
                           struct fv_hysteresis_state *state, int32_t words);

#ifdef __cplusplus
}
#endif

#endif
