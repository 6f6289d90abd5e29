/* Corners by the matrix of derivatives around them: Harris and Stephens, "A combined corner and
 * edge detector" (Alvey Vision Conference 1988), and Shi and Tomasi, "Good features to track" (CVPR
 * 1994).
 *
 * Sobel derivatives, their products summed over 3 x 3 pixels; the response is det - k trace^2
 * (Harris) or the least eigenvalue (Shi and Tomasi), per pixel and in grey levels per pixel. A
 * corner is a local maximum of 3 x 3 pixels above `quality` times the largest response. The
 * strongest are kept, and where a distance is asked for, of two that are nearer the stronger.
 * Positions are refined by a parabola along each axis. */
#ifndef FOVEA_FEATURES_HARRIS_H
#define FOVEA_FEATURES_HARRIS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "features/strongest.h"
#include "fovea/extract.h"
#include "image/plane.h"
#include "kernels/kernels.h"

struct fv_harris_corner {
    uint16_t x, y;    /* whole pixels */
    float x_px, y_px; /* refined */
    float response;
};

struct fv_harris {
    int32_t width, height, border; /* no corners nearer to the border of the image */
    float k;                       /* of Harris; below 0: the least eigenvalue */
    float quality, distance_px;
    uint32_t count_max;
    struct fv_strongest strongest;
    int32_t *response; /* of the image, as bits of floats */
    int16_t *dx[3], *dy[3];
    int32_t *row; /* scratch */
    struct fv_harris_corner *corners;
    int32_t columns, rows; /* of a grid whose cells have sides of the distance */
    uint32_t *cell;        /* 1 + the last corner of a cell, 0 for none */
    uint32_t *next;        /* of the same cell */
};

/* Take memory; `border` is at least 3. Fills sizes and addresses only. Init-only. */
void fv_harris_carve(struct fv_harris *harris, const struct fovea_extract_config *config,
                     int32_t width, int32_t height, int32_t border, struct fv_arena *arena);

/* Find corners, the strongest first, of equals the earlier in raster order; none where `mask` (its
 * pixels may be NULL) is 0. Fills harris->corners; returns how many. Real-time safe: time is at
 * most proportional to the pixels times the logarithm of count_max. */
uint32_t fv_harris_find(struct fv_harris *harris, const struct fv_kernels *kernels,
                        const struct fv_plane *image, const struct fv_plane *mask);

#endif
