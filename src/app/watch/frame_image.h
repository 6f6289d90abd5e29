/* A raw frame of a feed as a picture that can be written. For commands; the heap is used. */
#ifndef FOVEA_APP_WATCH_FRAME_IMAGE_H
#define FOVEA_APP_WATCH_FRAME_IMAGE_H

#include "app/network/feed_layout.h"
#include "fovea/image.h"
#include "fovea/status.h"

/* The image of one camera of the frame, in grey levels, or in colours where the camera gives rgb24
 * or bgr24; pictures of a colour mosaic (bayer_*) are its grey levels. `images` as
 * fv_feed_reader_frame gives it. image->data is from malloc, to be given to free().
 * FOVEA_ERROR_UNSUPPORTED: the camera gave none, or it cannot be read. */
enum fovea_status fv_frame_image(const struct fv_feed_frame *frame, const uint8_t *images,
                                 uint32_t camera, struct fovea_image *image,
                                 struct fovea_error *error);

#endif
