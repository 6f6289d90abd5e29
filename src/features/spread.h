/* Spread: pick corners so that they cover the image rather than crowd on its strongest texture.
 *
 * A level is cut into square cells, about as many as the features asked of it. Each cell keeps its FV_SPREAD_KEPT
 * strongest corners (ties: the earlier in raster order) and, when any of them reaches `threshold`, forgets those below.
 * Picking goes in rounds: first the best of every cell, then the second best, and so on; in the round that does not fit
 * any more the strongest are taken, ties in raster order of cells. Bounded, integer, deterministic. */
#ifndef FOVEA_FEATURES_SPREAD_H
#define FOVEA_FEATURES_SPREAD_H

#include <stdint.h>

#include "base/arena.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_SPREAD_KEPT = 6 };

/* A corner in pixels of its level. */
struct fv_corner {
    uint16_t x, y;
    uint8_t level;
    uint8_t score; /* FAST score: largest threshold at which it still is a corner */
};

struct fv_spread_cell {
    uint8_t count;
    struct {
        uint16_t x, y;
        uint8_t score;
    } best[FV_SPREAD_KEPT]; /* strongest first */
};

struct fv_spread {
    uint32_t cells_max;
    struct fv_spread_cell *cells;
    int32_t width, height; /* of the level in work */
    int32_t cell_px, columns, rows;
};

/* Take memory for grids of at most `count_max` cells. Fills sizes and addresses only. Init-only. */
void fv_spread_carve(struct fv_spread *spread, uint32_t count_max, struct fv_arena *frame);

/* Start a level of which about `share` corners will be picked. Clears the cells. */
void fv_spread_begin(struct fv_spread *spread, int32_t width, int32_t height, uint32_t share);

/* Offer a corner; calls come in raster order. Constant time. */
void fv_spread_offer(struct fv_spread *spread, int32_t x, int32_t y, uint8_t score);

/* Pick at most `count` corners into `corners`, cell by cell in raster order; returns how many. */
uint32_t fv_spread_pick(struct fv_spread *spread, uint32_t count, uint8_t threshold, uint8_t level,
                        struct fv_corner *corners);

#ifdef __cplusplus
}
#endif
#endif
