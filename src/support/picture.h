/* Pictures as files: PNG, JPEG and BMP read as grey levels or colours (support/decode.h), written
 * as PNG. For commands; the heap is used. */
#ifndef FOVEA_SUPPORT_PICTURE_H
#define FOVEA_SUPPORT_PICTURE_H

#include "fovea/image.h"
#include "fovea/status.h"

/* Read a picture as grey8, of a size that the runtime takes. image->data is from malloc, to be
 * given to free(); after an error it is NULL. Errors name the file. */
enum fovea_status fv_picture_read(const char *path, struct fovea_image *image,
                                  struct fovea_error *error);

/* The same as rgb24, of any size up to 16384 pixels a side: for networks, which scale it. */
enum fovea_status fv_picture_read_colour(const char *path, struct fovea_image *image,
                                         struct fovea_error *error);

/* The same, of a size that the runtime takes; refuses a picture that states no colours. */
enum fovea_status fv_picture_read_coloured(const char *path, struct fovea_image *image,
                                           struct fovea_error *error);

/* Whether a picture may be written to `path`, which `option` names; NULL may. FOVEA_ERROR_INPUT:
 * the name ends as that of another kind of picture than PNG. */
enum fovea_status fv_picture_check_name(const char *option, const char *path,
                                        struct fovea_error *error);

/* Write a grey8 or rgb24 image. FOVEA_ERROR_SYSTEM: `error` names the file and the reason; no half
 * of a picture is left. */
enum fovea_status fv_picture_write(const char *path, const struct fovea_image *image,
                                   struct fovea_error *error);

/* The same of a drawing, whose areas of one colour are small in any way of packing: in the fastest
 * way. */
enum fovea_status fv_picture_write_drawn(const char *path, const struct fovea_image *image,
                                         struct fovea_error *error);

/* The bytes of a PNG of a grey8 or rgb24 image. `*png` is from malloc, to be given to free(); NULL:
 * no memory. */
void fv_picture_encode(const struct fovea_image *image, unsigned char **png, size_t *bytes);

#endif
