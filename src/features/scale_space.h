/* Gaussian scale space of an image: octaves of levels whose blur grows by 2^(1/3) from level to
 * level, starting at a sigma of 1.6 pixels of the octave.
 *
 * Level l of octave o has sigma 1.6 2^(l / 3) in pixels of the octave. An octave begins with every
 * second pixel of level 3 of the octave before, so that pixel (x, y) of octave o lies at (x, y)
 * 2^o of octave 0. Octave 0 has the size of the image, or twice that, where pixel (x, y) lies at
 * (x / 2 - 1/4, y / 2 - 1/4) of the image. Values are 1/128 grey level. */
#ifndef FOVEA_FEATURES_SCALE_SPACE_H
#define FOVEA_FEATURES_SCALE_SPACE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#define FV_SCALE_SIGMA 1.6

enum { FV_SCALE_LAYERS = 3, FV_SCALE_OCTAVES_MAX = 12, FV_SCALE_SIDE_MIN = 16 };

struct fv_scale_octave {
    uint16_t *level[FV_SCALE_LEVELS];
    int32_t width, height, stride; /* elements */
};

struct fv_scale_gauss {
    int32_t radius;
    uint16_t weights[FV_SCALE_RADIUS_MAX + 1]; /* in 1/65536, from the centre outwards */
};

struct fv_scale_space {
    uint32_t octaves;
    bool doubled;
    struct fv_scale_octave octave[FV_SCALE_OCTAVES_MAX];
    struct fv_scale_gauss first, step[FV_SCALE_LEVELS]; /* step[l] makes level l of level l - 1 */
    uint16_t *row;                                      /* scratch of blurs */
};

/* Weights of a Gaussian, cut off at 4 sigma and at FV_SCALE_RADIUS_MAX. Init-only. */
void fv_scale_gauss_make(struct fv_scale_gauss *gauss, double sigma);

/* Take memory for images of this size; at most `most` octaves, whose sides are at least
 * FV_SCALE_SIDE_MIN. Fills sizes, weights and addresses only. Init-only. */
void fv_scale_space_carve(struct fv_scale_space *space, int32_t width, int32_t height, bool doubled,
                          uint32_t most, struct fv_arena *arena);

/* Fill all levels. Real-time safe: time is proportional to the pixels. */
void fv_scale_space_build(struct fv_scale_space *space, const struct fv_kernels *kernels,
                          const struct fv_plane *image);

/* Pixels of the image per pixel of an octave. */
double fv_scale_pixel(const struct fv_scale_space *space, uint32_t octave);

/* Position in the image, x or y, of a position in an octave. */
double fv_scale_in_image(const struct fv_scale_space *space, uint32_t octave, double at);

static inline const uint16_t *fv_scale_row(const struct fv_scale_octave *octave, int32_t level,
                                           int32_t y)
{
    return octave->level[level] + (int64_t)y * octave->stride;
}

#endif
