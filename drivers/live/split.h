/* Two cameras side by side in one picture, as stereo cameras with one USB link give them: the left
 * half is the first camera's. */
#ifndef FOVEA_LIVE_SPLIT_H
#define FOVEA_LIVE_SPLIT_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/image.h"

/* Whether pictures of this format and width have two halves that are pictures: formats of one plane
 * (MJPEG is decoded before), and halves of at least 64 pixels, even where colours go in pairs. */
bool fv_split_possible(enum fovea_pixel_format format, int32_t width);

/* Bytes that each half takes. */
size_t fv_split_bytes(enum fovea_pixel_format format, int32_t width, int32_t height);

/* Copy the halves of `whole` into `memory`, twice fv_split_bytes, and describe them. No heap. */
void fv_split(const struct fovea_image *whole, uint8_t *memory, struct fovea_image halves[2]);

#endif
