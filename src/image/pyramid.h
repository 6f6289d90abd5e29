/* Pyramid: the frame as grey levels, each 5/6 of the size of the one before (scale 1.2).
 *
 * Level 0 is the frame, converted to grey. Pixel (x, y) of level n+1 is the bilinear sample of
 * level n at (1.2 x + 0.1, 1.2 y + 0.1): pixel centres map by exactly 1.2, so the position in the
 * raw image is 1.2^level (x + 0.5) - 0.5 with no rounding of sizes in it. Since 1.2 = 6/5, six
 * pixels make five with only the weights .9/.1 .7/.3 .5/.5 .3/.7 .1/.9, kept in 1/128: 115/13 90/38
 * 64/64 38/90 13/115. Rows are blended first, then columns, each rounded half up to 8 bits. A level
 * is 5 floor(w/6) + max(0, w mod 6 - 1) wide, w that of the level before, so that no sample lies
 * outside. Integer only: the same bits with every kernel set. */
#ifndef FOVEA_IMAGE_PYRAMID_H
#define FOVEA_IMAGE_PYRAMID_H

#include <stdint.h>

#include "base/arena.h"
#include "fovea/features.h"
#include "fovea/image.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Rows start 64-byte aligned; FV_LEVEL_SLACK_BYTES after the last pixel of a row may be read and
 * hold undefined values. */
enum { FV_LEVEL_SLACK_BYTES = 64 };

struct fv_pyramid {
    uint32_t levels;
    struct fv_plane level[FOVEA_PYRAMID_LEVELS_MAX];
    uint8_t *row; /* one blended row */
};

static inline const struct fv_plane *fv_pyramid_level(const struct fv_pyramid *pyramid,
                                                      uint32_t level)
{
    return &pyramid->level[level];
}

/* 1.2^level: level-0 pixels per pixel of a level. */
float fv_pyramid_scale(uint32_t level);

/* The same in 16 bits of fraction, for integer code; level below FOVEA_PYRAMID_LEVELS_MAX. */
int32_t fv_pyramid_scale_q16(uint32_t level);

/* Width (or height) of the level after one of `pixels`. */
int32_t fv_pyramid_next(int32_t pixels);

/* Place of a pixel of a level in the raw image. */
static inline float fv_pyramid_to_raw(uint32_t level, float level_px)
{
    return fv_pyramid_scale(level) * (level_px + 0.5f) - 0.5f;
}

/* The pixel of the raw image, along x or y, in which a pixel of a level has its centre. */
static inline int32_t fv_pyramid_pixel_in_raw(uint32_t level, int32_t level_px)
{
    return (int32_t)(((int64_t)(2 * level_px + 1) * fv_pyramid_scale_q16(level)) >> 17);
}

/* Take `levels` [1, 8] images for frames of width x height (within FOVEA_IMAGE_*) from the arena.
 * Fills sizes and addresses only. Init-only. */
void fv_pyramid_carve(struct fv_pyramid *pyramid, int32_t width, int32_t height, uint32_t levels,
                      struct fv_arena *frame);

/* Build all levels from a frame of the carved size in any uncompressed format, already checked with
 * fovea_image_check. Real-time safe; cost proportional to the pixels. */
void fv_pyramid_build(struct fv_pyramid *pyramid, const struct fv_kernels *kernels,
                      const struct fovea_image *frame);

/* Build the levels above level 0 from it. Real-time safe. */
void fv_pyramid_shrink(struct fv_pyramid *pyramid, const struct fv_kernels *kernels);

#ifdef __cplusplus
}
#endif
#endif
