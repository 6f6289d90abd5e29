#include "app/config/mask.h"

#include <png.h>
#include <stdlib.h>
#include <string.h>

#include "support/decode.h"

enum fovea_status fv_mask_decode(const char *name, const uint8_t *data, size_t bytes, int32_t width,
                                 int32_t height, uint8_t **mask, struct fovea_error *error)
{
    png_image png = {.version = PNG_IMAGE_VERSION};
    if (!png_image_begin_read_from_memory(&png, data, bytes))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: mask: found %s, expected a PNG picture", name, png.message);
    if (png.width != (png_uint_32)width || png.height != (png_uint_32)height) {
        fovea_error_set(error, FOVEA_ERROR_INPUT,
                        "%.200s: mask: found %u x %u pixels, expected %d x %d as the frames", name,
                        (unsigned)png.width, (unsigned)png.height, width, height);
        png_image_free(&png);
        return FOVEA_ERROR_INPUT;
    }
    png.format = PNG_FORMAT_GRAY;
    const size_t size = PNG_IMAGE_SIZE(png);
    uint8_t *pixels = malloc(size);
    if (pixels == NULL) {
        png_image_free(&png);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: mask: out of memory", name);
    }
    /* Without a background libpng would lay what is transparent over whatever the memory held. */
    const png_color white = {255, 255, 255};
    if (!png_image_finish_read(&png, &white, pixels, 0, NULL)) {
        free(pixels);
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: mask: found damage (%s), expected a whole PNG", name,
                               png.message);
    }
    for (size_t i = 0; i < size; i++)
        pixels[i] = pixels[i] < 128 ? 0 : 255;
    *mask = pixels;
    return FOVEA_OK;
}

enum fovea_status fv_mask_read(const char *path, int32_t width, int32_t height, uint8_t **mask,
                               struct fovea_error *error)
{
    struct fv_file_buffer file = {0};
    struct fovea_error reason;
    enum fovea_status status = fv_file_read(&file, path, &reason);
    if (status == FOVEA_OK)
        status = fv_mask_decode(path, file.data, file.bytes, width, height, mask, error);
    else
        status =
            fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: mask: %.200s", path, reason.text);
    fv_file_free(&file);
    return status;
}
