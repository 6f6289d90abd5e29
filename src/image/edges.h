/* Edges (fovea/edges.h) on memory from an arena, in steps: some rows, then some words of the
 * hysteresis. Results do not depend on how the work is divided. */
#ifndef FOVEA_IMAGE_EDGES_H
#define FOVEA_IMAGE_EDGES_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/edges.h"
#include "image/hysteresis.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_edges {
    struct fovea_edges_config config;
    int32_t width, height;
    int32_t low, high;     /* thresholds of whole magnitudes */
    int32_t *magnitude[3]; /* rows y - 1, y, y + 1, by y % 3 */
    int16_t *dx[3], *dy[3];
    struct fv_hysteresis hysteresis;
};

/* How far an image is. No addresses and no padding. */
struct fv_edges_state {
    struct fv_hysteresis_state hysteresis;
    int32_t row, reserved;
};

/* Take the memory of a checked detector for planes of width x height. Init-only. */
void fv_edges_carve(struct fv_edges *edges, const struct fovea_edges_config *config, int32_t width,
                    int32_t height, struct fv_arena *arena);

/* Change the thresholds, between images. Real-time safe. */
void fv_edges_set(struct fv_edges *edges, double low, double high);

/* Begin an image. Real-time safe, as all that follows. */
void fv_edges_begin(const struct fv_edges *edges, struct fv_edges_state *state);

/* Go on for about `pixels` pixels of `plane`, which is the same until true is returned: all edges
 * are found. */
bool fv_edges_advance(const struct fv_edges *edges, struct fv_edges_state *state,
                      const struct fv_kernels *kernels, const struct fv_plane *plane,
                      int32_t pixels);

/* A row of the bitmap found, (width + 7) / 8 bytes as in fovea_edges_run. */
void fv_edges_pack(const struct fv_edges *edges, int32_t y, uint8_t *row);

#ifdef __cplusplus
}
#endif
#endif
