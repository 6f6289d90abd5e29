/* FAST-9/16 corners with non-maximum suppression (Rosten and Drummond, ECCV 2006), row by row.
 *
 *     struct fv_fast fast;
 *     fv_fast_begin(&fast, kernels, &image, border_px, threshold, scratch);
 *     while (fv_fast_next(&fast))
 *         for (int32_t i = 0; i < fast.count; i++)
 *             corner at (fast.columns[i], fast.y) with fast.scores[fast.columns[i]];
 *
 * Corners and scores equal those of OpenCV's FAST(threshold, nonmaxSuppression = true): a corner
 * stays when its score is greater than those of its eight neighbours. Raster order. Suppression at
 * a low threshold and then keeping the scores of at least t gives the corners of threshold t, so
 * one scan serves all higher thresholds. */
#ifndef FOVEA_FEATURES_FAST_H
#define FOVEA_FEATURES_FAST_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_FAST_BORDER_MIN_PX = 3 };

struct fv_fast_scratch {
    uint8_t *scores;     /* three rows */
    uint8_t *thresholds; /* of the pixels of the row that is scored next, by column */
    uint16_t *columns;   /* corners of one row */
    int32_t row_bytes;
};

struct fv_fast {
    const struct fv_kernels *kernels;
    struct fv_plane image;
    int32_t border_px;
    struct fv_fast_scratch scratch;
    int32_t scored; /* rows up to this one have scores */

    /* Of the row reached last: */
    int32_t y, count;
    const uint16_t *columns;
    const uint8_t *scores; /* indexed by column */
};

/* Take scratch for images up to `width` pixels wide from the arena. */
void fv_fast_carve(struct fv_fast_scratch *scratch, int32_t width, struct fv_arena *frame);

/* Start on an image of which FV_LEVEL_SLACK_BYTES after each row may be read. Corners keep
 * border_px (at least 3) from its edges; threshold in [1, 254]. The caller may change the
 * thresholds in `scratch` between rows: when row y is reached, y + 1 has its scores. Real-time
 * safe. */
void fv_fast_begin(struct fv_fast *fast, const struct fv_kernels *kernels,
                   const struct fv_plane *image, int32_t border_px, int32_t threshold,
                   const struct fv_fast_scratch *scratch);

/* Go to the next row; false after the last. Real-time safe. */
bool fv_fast_next(struct fv_fast *fast);

#ifdef __cplusplus
}
#endif
#endif
