/* The static mask: a PNG of the size of the frames, black where features are ignored. */
#ifndef FOVEA_APP_CONFIG_MASK_H
#define FOVEA_APP_CONFIG_MASK_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

/* Decode a picture's bytes, or those of a file, into memory from malloc: width x height bytes, 0 or
 * 255 (levels below 128 count as black, what is transparent as white). FOVEA_ERROR_INPUT: not a
 * PNG, or not of that size. Init-only. */
enum fovea_status fv_mask_decode(const char *name, const uint8_t *data, size_t bytes, int32_t width,
                                 int32_t height, uint8_t **mask, struct fovea_error *error);
enum fovea_status fv_mask_read(const char *path, int32_t width, int32_t height, uint8_t **mask,
                               struct fovea_error *error);

#endif
