/* Pictures in colour for commands: PNG, JPEG and uncompressed 24-bit BMP as rgb24, of any size up
 * to 16384. The heap is used. */
#ifndef FOVEA_SUPPORT_COLOUR_H
#define FOVEA_SUPPORT_COLOUR_H

#include "fovea/image.h"
#include "fovea/status.h"

/* image->data is from malloc, to be given to free(). Errors name the file. */
enum fovea_status fv_colour_read(const char *path, struct fovea_image *image,
                                 struct fovea_error *error);

#endif
