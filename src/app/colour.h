/* Pictures in colour for commands: PNG, JPEG and uncompressed 24-bit BMP as rgb24, of any size up to 16384; and model files.
 * The heap is used. */
#ifndef FOVEA_APP_COLOUR_H
#define FOVEA_APP_COLOUR_H

#include "fovea/image.h"
#include "fovea/status.h"
#include "nn/model.h"

/* image->data is from malloc, to be given to free(). Errors name the file. */
enum fovea_status fv_colour_read(const char *path, struct fovea_image *image, struct fovea_error *error);

/* A model file in memory of its own. */
struct fv_model_file {
    uint8_t *data; /* 64-byte aligned, from aligned_alloc */
    size_t bytes;
    struct fv_model model;
};

/* Read and check. FOVEA_ERROR_INPUT or FOVEA_ERROR_SYSTEM: `error` names the file and what is wrong. */
enum fovea_status fv_model_file_read(const char *path, struct fv_model_file *file, struct fovea_error *error);
void fv_model_file_free(struct fv_model_file *file);

#endif
