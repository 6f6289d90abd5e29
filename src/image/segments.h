/* Line segments (fovea/segments.h) on memory from an arena, in steps: rows of gradients, rows of
 * sorting, then regions. Results do not depend on how the work is divided. */
#ifndef FOVEA_IMAGE_SEGMENTS_H
#define FOVEA_IMAGE_SEGMENTS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/segments.h"
#include "image/filters.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Direction of the edge at a pixel of the reduced image, in half grey levels: its length is the
 * gradient's, the bright side is on the right. 0 0 where the gradient is too weak. */
struct fv_level_line {
    int16_t x, y;
};

struct fv_segment_pixel {
    int16_t x, y;
};

struct fv_segments {
    struct fovea_segments_config config;
    int32_t width, height;      /* of the image */
    int32_t columns, rows;      /* of the reduced one */
    uint32_t region_least;      /* pixels of a region that counts */
    struct fv_gauss gauss;      /* before the reduction */
    uint16_t *scratch;          /* of one smoothed row */
    uint8_t *smooth[2];         /* rows of the image, by y % 2 */
    uint8_t *reduced[2];        /* rows of the reduced one, by y % 2 */
    struct fv_level_line *line; /* of each pixel of the reduced one */
    uint8_t *used;              /* of each: part of a region */
    uint32_t *starts;           /* by bin of gradients: how many, then where the next one goes */
    uint32_t *seeds;            /* pixels in order of their gradient, the largest first */
    struct fv_segment_pixel *region;
    struct fovea_segment *found;
};

/* How far an image is. No addresses and no padding. */
struct fv_segments_state {
    int32_t phase, row;   /* enum phase in segments.c */
    int32_t smoothed;     /* rows of the image */
    uint32_t seed, seeds; /* the next one, of how many */
    uint32_t count;       /* segments found */
    int64_t visits_left;
};

/* Take the memory of a checked detector for planes of width x height, and compute what depends on
 * its size. `scratch` gives what holds nothing between two calls: its bytes differ by kernel set.
 * Init-only. */
void fv_segments_carve(struct fv_segments *segments, const struct fovea_segments_config *config,
                       int32_t width, int32_t height, struct fv_arena *arena,
                       struct fv_arena *scratch);

/* Begin an image. Real-time safe, as all that follows. */
void fv_segments_begin(const struct fv_segments *segments, struct fv_segments_state *state);

/* Go on for about `pixels` pixels' time of `plane`, which is the same until true is returned: all
 * segments are found, state->count of segments->found. A region is not interrupted: it has at most
 * FV_REGION_MAX pixels. */
bool fv_segments_advance(const struct fv_segments *segments, struct fv_segments_state *state,
                         const struct fv_kernels *kernels, const struct fv_plane *plane,
                         int32_t pixels);

#ifdef __cplusplus
}
#endif
#endif
