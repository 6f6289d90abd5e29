/* Pictures whose pixels are class numbers: PNG of grey levels or of a palette, up to 8 bits; of a
 * palette the places in it count, not the colours. For commands; the heap is used. */
#ifndef FOVEA_APP_LAB_LABEL_PICTURE_H
#define FOVEA_APP_LAB_LABEL_PICTURE_H

#include "fovea/status.h"

#include <stdint.h>

/* Read one of width x height pixels. `*labels` is from malloc, to be given to free(). Errors name
 * the file. */
enum fovea_status fv_label_picture_read(const char *path, int32_t width, int32_t height,
                                        uint8_t **labels, struct fovea_error *error);

#endif
