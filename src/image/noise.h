/* The noise of a picture, by itself: how rough its smoothest parts are. */
#ifndef FOVEA_IMAGE_NOISE_H
#define FOVEA_IMAGE_NOISE_H

#include "image/plane.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_NOISE_ONE = 8,  /* steps of the result in one grey level */
    FV_NOISE_MAX = 511 /* the largest result; more noise gives this too */
};

/* Standard deviation of the noise of a picture of FOVEA_IMAGE_WIDTH_MIN x FOVEA_IMAGE_HEIGHT_MIN or
 * more, in 1/8 grey levels: the lower quartile over 192 blocks of 16x8 pixels, spread over it, of
 * the mean magnitude of the response to a mask that sees neither planes nor edges along rows and
 * columns (Immerkaer, Fast noise variance estimation, 1996). The result is 5 to 10 % low in white
 * noise; texture as fine as a pixel counts where it covers three quarters of the picture. Integers:
 * the same on every machine. Real-time safe; the same work for every picture. */
uint32_t fv_noise(const struct fv_plane *plane);

#ifdef __cplusplus
}
#endif
#endif
