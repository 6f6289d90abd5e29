/* Images without the gaps between their rows. No heap, no system call. */
#ifndef FOVEA_SUPPORT_IMAGE_PACK_H
#define FOVEA_SUPPORT_IMAGE_PACK_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"

/* Bytes of all planes without gaps; of compressed data, its bytes; 0 for an absent image. */
size_t fv_image_packed_bytes(const struct fovea_image *image);

/* Copy an image that fovea_image_check lets through to `to`, which holds fv_image_packed_bytes, row
 * by row. The description of the copy. */
struct fovea_image fv_image_pack(const struct fovea_image *image, uint8_t *to);

#endif
