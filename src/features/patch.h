/* Patches as descriptors: the 9 x 9 pixels around a feature, free of brightness and contrast. */
#ifndef FOVEA_FEATURES_PATCH_H
#define FOVEA_FEATURES_PATCH_H

#include <stdint.h>

#include "image/plane.h"

enum { FV_PATCH_RADIUS_PX = 4, FV_PATCH_SIDE = 9, FV_PATCH_BYTES = 81 };

/* Shifted and scaled to mean 128 and standard deviation 32, rounded and limited to [0, 255]; a
 * patch of one grey level is 128 everywhere. (x, y) is FV_PATCH_RADIUS_PX or more from the border.
 * Real-time safe. */
void fv_patch_describe(const struct fv_plane *level, int32_t x, int32_t y,
                       uint8_t descriptor[FV_PATCH_BYTES]);

#endif
