/* Spread: pick corners so that they cover the image rather than crowd on its strongest texture.
 *
 * Each level has a quota of the features, which falls by 5/6 from level to level, as side
 * lengths do, and gives its strongest corners. (Where only strength counts, per_cell being
 * FV_SPREAD_KEPT, it falls by 29/30: coarse corners are less exact but survive blur and change of
 * scale; measured on the Oxford affine sets.) It is cut into square cells, about as many as its
 * quota: a cell gives at most `per_cell` (more where too few would be found), and when any of
 * its corners reaches `threshold` those below do not count. What a coarse level lacks goes to the
 * finer ones, what is then left to the coarser. Beside that, the frame is cut into FV_SPREAD_COVER
 * x FV_SPREAD_COVER fields: where the strong corners leave fields empty, the strongest corner of
 * such a field over all levels takes the place of the weakest elsewhere, until FV_SPREAD_WANTED
 * fields hold one. (Where only strength counts, a corner of a field counts by its score times the
 * scale of its level, of the two coarsest by half of the next one's: in weak texture the fine
 * corners are the first that blur takes away. On the Oxford sets it raises the matching score of
 * blurred images by a twentieth and costs the others a hundredth; photographs warped and blurred by
 * hand agree.) Strong corners match best, covered fields tie the geometry down. Ties go to the
 * earlier in raster order; corners of the fields to the coarser level. Integer, bounded,
 * deterministic. */
#ifndef FOVEA_FEATURES_SPREAD_H
#define FOVEA_FEATURES_SPREAD_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/features.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_SPREAD_KEPT = 8,
    FV_SPREAD_OVER_EVEN = 6, /* quotas fall by 5/6 */
    FV_SPREAD_COVER = 16,
    FV_SPREAD_FIELDS = FV_SPREAD_COVER * FV_SPREAD_COVER,
    FV_SPREAD_WANTED = FV_SPREAD_FIELDS * 9 / 10
};

/* A corner in pixels of its level. */
struct fv_corner {
    uint16_t x, y;
    uint8_t level;
    uint8_t score; /* see struct fovea_feature */
};

struct fv_spread_cell {
    /* Strongest first, 0 where there is none. A kept corner is one number that orders them: score,
     * then 2^16
     * - 1 - y and 2^16 - 1 - x (the earlier in raster order is the larger), then its field; 8, 16,
     * 16 and 8 bits. */
    uint64_t best[FV_SPREAD_KEPT];
    uint8_t count;    /* kept */
    uint8_t eligible; /* number of them, the first, that may be picked for their strength */
    uint8_t taken;    /* a bit for each that is picked */
    uint8_t needed;   /* corners of a lower score change nothing any more */
};

struct fv_spread_level {
    struct fv_spread_cell *cells;
    int32_t width, height;          /* of the level */
    int32_t cell_px, columns, rows; /* of the grid */
    uint32_t per_cell;              /* 2^32 / cell_px, rounded up: division by multiplying */
    uint32_t field_x, field_y;      /* fields per half pixel of this level, 32 bits of fraction */
    uint32_t cells_max;
};

struct fv_spread {
    uint32_t levels;
    uint32_t count; /* asked of this frame */
    uint8_t threshold, per_cell;
    uint16_t worth_q8[FOVEA_PYRAMID_LEVELS_MAX]; /* what a score counts for in a field, by level */
    struct fv_spread_level level[FOVEA_PYRAMID_LEVELS_MAX];
    struct fv_corner *cover; /* FV_SPREAD_COVER^2 fields, score 0: empty */
};

/* Features that a level of `levels` is due of `count`, which fall by (over - 1) / over from level
 * to level; over [2, 30]. */
uint32_t fv_spread_quota(uint32_t level, uint32_t levels, uint32_t count, uint32_t over);

/* Take memory for `count_max` corners from levels of these sizes. Fills sizes and addresses only.
 * Init-only.
 */
void fv_spread_carve(struct fv_spread *spread, uint32_t levels, const int32_t width[],
                     const int32_t height[], uint32_t count_max, struct fv_arena *frame);

/* Start a frame of which at most `count` (at most count_max) corners will be picked; where a cell
 * has corners of `threshold`, weaker ones do not count; a cell gives `per_cell` [1,
 * FV_SPREAD_KEPT]. */
void fv_spread_begin(struct fv_spread *spread, uint32_t count, uint8_t threshold, uint8_t per_cell);

/* Offer a corner with a score of at least 1; calls come by level from coarse to fine, in raster
 * order. Constant time. */
void fv_spread_offer(struct fv_spread *spread, uint32_t level, int32_t x, int32_t y, uint8_t score);

/* From what score on corners of row y [1, height - 2] of a level are worth finding, by column: the
 * threshold where neither a weaker corner nor one whose weaker neighbour is not seen would change
 * what is kept; `least` elsewhere. In the order of the offers, after those of row y - 2; rows
 * between which nothing is worth a new look leave the thresholds as they are. Up to 15 columns more
 * are written. */
void fv_spread_thresholds(struct fv_spread *spread, uint32_t level, int32_t y, uint8_t least,
                          uint8_t *thresholds);

/* Give the corners that are kept, at most FV_SPREAD_KEPT of each cell and one of each field, scores
 * of another measure, at least 1; weak ones of cells that have strong ones are left out before.
 * Once, between the last offer and the picking. Time: at most as many calls as corners are kept. */
typedef uint8_t fv_spread_measure_fn(const void *context, uint32_t level, int32_t x, int32_t y);
void fv_spread_score(struct fv_spread *spread, fv_spread_measure_fn *measure, const void *context);

/* Pick the corners, by level from coarse to fine and cell by cell; returns how many. */
uint32_t fv_spread_pick(struct fv_spread *spread, struct fv_corner *corners);

#ifdef __cplusplus
}
#endif
#endif
