#include "app/mask.h"

#include <errno.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

enum fovea_status fv_mask_read(const char *path, int32_t width, int32_t height, uint8_t **mask,
                               struct fovea_error *error)
{
    png_image png = {.version = PNG_IMAGE_VERSION};
    errno = 0;
    if (!png_image_begin_read_from_file(&png, path))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: mask: found %s, expected a PNG picture", path,
                               errno == ENOENT ? "no such file" : png.message);
    if (png.width != (png_uint_32)width || png.height != (png_uint_32)height) {
        fovea_error_set(error, FOVEA_ERROR_INPUT,
                        "%.200s: mask: found %u x %u pixels, expected %d x %d as the frames", path,
                        (unsigned)png.width, (unsigned)png.height, width, height);
        png_image_free(&png);
        return FOVEA_ERROR_INPUT;
    }
    png.format = PNG_FORMAT_GRAY;
    size_t bytes = PNG_IMAGE_SIZE(png);
    uint8_t *pixels = malloc(bytes);
    if (pixels == NULL) {
        png_image_free(&png);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.200s: mask: out of memory", path);
    }
    /* Without a background libpng would lay what is transparent over whatever the memory held. */
    const png_color white = {255, 255, 255};
    if (!png_image_finish_read(&png, &white, pixels, 0, NULL)) {
        free(pixels);
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.200s: mask: found damage (%s), expected a whole PNG", path,
                               png.message);
    }
    for (size_t i = 0; i < bytes; i++)
        pixels[i] = pixels[i] < 128 ? 0 : 255;
    *mask = pixels;
    return FOVEA_OK;
}
