/* A grey picture, as stages pass it to one another: no ownership, no allocation. */
#ifndef FOVEA_IMAGE_PLANE_H
#define FOVEA_IMAGE_PLANE_H

#include <stdint.h>

struct fv_plane {
    uint8_t *pixels; /* row by row, 8 bits each; NULL while memory is counted */
    int32_t width, height;
    int32_t stride; /* bytes from row to row, at least width */
};

/* A picture that is only read, as functions take it by `const struct fv_plane *`. */
static inline struct fv_plane fv_plane_of(const uint8_t *pixels, int32_t width, int32_t height,
                                          int32_t stride)
{
    const struct fv_plane plane = {(uint8_t *)pixels, width, height, stride};
    return plane;
}

static inline uint8_t *fv_plane_row(const struct fv_plane *plane, int32_t y)
{
    return plane->pixels + (int64_t)y * plane->stride;
}

#endif
