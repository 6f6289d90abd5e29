/* Corners of a picture by the measure of Harris and Stephens or of Shi and Tomasi, row by row, as
 * fast.h gives those of FAST: for the loop, which spreads them. harris.h finds them in pictures.
 *
 *     struct fv_response response;
 *     fv_response_begin(&response, kernels, &image, border_px, threshold, scratch);
 *     while (fv_response_next(&response))
 *         for (int32_t i = 0; i < response.count; i++)
 *             corner at (response.columns[i], response.y) with response.scores[i];
 *
 * The measure is that of contracts/response.h; a corner is at least as high as its eight
 * neighbours. Its score is in grey levels, as FAST's is: FV_RESPONSE_GAIN times the fourth root of
 * Harris' measure, or the square root of the least eigenvalue, which are the least contrast per
 * pixel; at most 255. Raster order. */
#ifndef FOVEA_FEATURES_RESPONSE_H
#define FOVEA_FEATURES_RESPONSE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "features/spread.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_RESPONSE_BORDER_MIN_PX = 3, FV_RESPONSE_GAIN = 4 };

struct fv_response_scratch {
    int32_t *responses; /* three rows, as bits of floats */
    int16_t *dx, *dy;   /* three rows each */
    int32_t *sums;      /* three rows; marks of peaks */
    uint16_t *columns;  /* corners of one row */
    uint8_t *scores;
    int32_t width;  /* of these rows */
    float harris_k; /* below 0: the least eigenvalue */
};

struct fv_response {
    const struct fv_kernels *kernels;
    struct fv_plane image;
    int32_t border_px, threshold;
    struct fv_response_scratch scratch;
    int32_t responded; /* rows up to this one have responses */

    /* Of the row reached last: */
    int32_t y, count;
    const uint16_t *columns;
    const uint8_t *scores;
};

/* Take scratch for images up to `width` pixels wide from the arena; `harris_k` below 0 means Shi
 * and Tomasi's measure. Init-only. */
void fv_response_carve(struct fv_response_scratch *scratch, int32_t width, float harris_k,
                       struct fv_arena *frame);

/* Start on an image: corners keep border_px (at least 3) from its edges and have a score of at
 * least `threshold` [1, 254]. Real-time safe. */
void fv_response_begin(struct fv_response *response, const struct fv_kernels *kernels,
                       const struct fv_plane *image, int32_t border_px, int32_t threshold,
                       const struct fv_response_scratch *scratch);

/* Go to the next row; false after the last. Real-time safe. */
bool fv_response_next(struct fv_response *response);

/* Set x_px and y_px of features[i] to the maximum of a parabola along each axis through the
 * measures around corners[i], in the raw image. Corners keep FV_RESPONSE_BORDER_MIN_PX from the
 * border of their level. Real-time safe; constant time per corner. */
void fv_response_refine(const struct fv_pyramid *pyramid, float harris_k,
                        const struct fv_corner *corners, uint32_t count,
                        struct fovea_feature *features);

/* The score of a measure of grey levels per pixel to the fourth power; at least 1. */
uint8_t fv_response_score(float measure);

#ifdef __cplusplus
}
#endif
#endif
