#include "support/picture.h"

#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/decode.h"
#include "support/output.h"

static enum fovea_status decode(const struct fv_file_buffer *file, struct fovea_image *image,
                                struct fovea_error *reason)
{
    struct fv_decode_image into = {0};
    enum fovea_status status =
        fv_decode_probe(file->data, file->bytes, &into.width, &into.height, reason);
    if (status != FOVEA_OK) return status;
    into.stride_bytes = into.width;
    const size_t bytes = (size_t)into.width * (size_t)into.height;
    into.pixels = malloc(bytes);
    if (into.pixels == NULL) return fovea_error_set(reason, FOVEA_ERROR_SYSTEM, "out of memory");
    status = fv_decode(file->data, file->bytes, &into, reason);
    if (status != FOVEA_OK) {
        free(into.pixels);
        return status;
    }
    image->data = into.pixels;
    image->width = into.width;
    image->height = into.height;
    image->stride_bytes = into.stride_bytes;
    image->format = FOVEA_PIXEL_GREY8;
    image->size_bytes = bytes;
    return FOVEA_OK;
}

enum fovea_status fv_picture_read(const char *path, struct fovea_image *image,
                                  struct fovea_error *error)
{
    struct fv_file_buffer file = {0};
    struct fovea_error reason;
    enum fovea_status status = fv_file_read(&file, path, &reason);
    if (status == FOVEA_GONE)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found no such file, expected a PNG or JPEG picture", path);
    if (status == FOVEA_OK) status = decode(&file, image, &reason);
    fv_file_free(&file);
    return status == FOVEA_OK ? FOVEA_OK
                              : fovea_error_set(error, status, "%.300s: %.200s", path, reason.text);
}

static png_image png_of(const struct fovea_image *image)
{
    const bool colour = image->format == FOVEA_PIXEL_RGB24;
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .format = colour ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY};
    png.width = (png_uint_32)image->width;
    png.height = (png_uint_32)image->height;
    return png;
}

void fv_picture_encode(const struct fovea_image *image, unsigned char **png, size_t *bytes)
{
    png_image header = png_of(image);
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(header);
    *png = malloc(size);
    *bytes = 0;
    if (*png == NULL) return;
    if (png_image_write_to_memory(&header, *png, &size, 0, image->data, image->stride_bytes,
                                  NULL) != 0) {
        *bytes = size;
        return;
    }
    free(*png);
    *png = NULL;
}

enum fovea_status fv_picture_write(const char *path, const struct fovea_image *image,
                                   struct fovea_error *error)
{
    png_image png = png_of(image);
    struct fv_output output;
    if (fv_output_open(&output, path, FV_OUTPUT_WHOLE, error) != FOVEA_OK)
        return FOVEA_ERROR_SYSTEM;
    FILE *stream = fv_output_stream(&output);
    errno = stream != NULL ? 0 : ENOMEM;
    if (stream != NULL &&
        png_image_write_to_stdio(&png, stream, 0, image->data, image->stride_bytes, NULL) != 0)
        return fv_output_close(&output, error);
    const int reason = errno;
    fv_output_discard(&output);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: cannot be written: %s", path,
                           reason != 0 ? strerror(reason) : png.message);
}
