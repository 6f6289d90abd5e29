/* Pictures of the camera as JPEG, in classes of size and quality. */
#ifndef FOVEA_WEB_JPEG_H
#define FOVEA_WEB_JPEG_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"

enum {
    FV_WEB_CLASSES = 6,     /* 0 is the best; size and quality fall from each to the next */
    FV_WEB_JPEGS = 9,       /* with those of a camera's size, however large that is */
    FV_WEB_WIDTH_MAX = 1280 /* of a picture that is sent */
};

/* How many times smaller than the image, in width and height, a picture of this class is. */
int32_t fv_web_jpeg_shrink(int32_t width, int picture_class);

/* The class of pictures of the image's own size with quality 0 (the best), 1 or 2. */
int fv_web_jpeg_whole(int32_t width, int quality);

/* The JPEG of a grey8 or rgb24 image, in memory of malloc at `*jpeg` of `*capacity` bytes, which
 * grows. Returns its length; 0: no memory, or the image is none of these. */
size_t fv_web_jpeg_make(const struct fovea_image *image, int picture_class, uint8_t **jpeg,
                        size_t *capacity);

#endif
