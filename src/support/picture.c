#include "support/picture.h"

#include <errno.h>
#include <png.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "support/decode.h"
#include "support/output.h"

#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
enum { SIDE_MAX = 512 }; /* a picture of 800 MB takes a fuzzer a second */
#else
enum { SIDE_MAX = FV_DECODE_SIDE_MAX };
#endif

/* What a caller takes. */
struct wish {
    bool colour;   /* rgb24; else grey8 */
    bool any_size; /* of 1 to SIDE_MAX pixels a side; else what the runtime takes */
    bool coloured; /* not a grey picture */
};

static enum fovea_status check_size(const struct wish *wish, int64_t width, int64_t height,
                                    struct fovea_error *reason)
{
    if (!wish->any_size) return fv_decode_check_size(width, height, reason);
    if (width >= 1 && width <= SIDE_MAX && height >= 1 && height <= SIDE_MAX) return FOVEA_OK;
    return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                           "found %lld x %lld pixels, expected 1 to %d a side", (long long)width,
                           (long long)height, SIDE_MAX);
}

static enum fovea_status decode(const struct fv_file_buffer *file, const struct wish *wish,
                                struct fovea_image *image, struct fovea_error *reason)
{
    int64_t width = 0, height = 0;
    enum fovea_status status = fv_decode_size(file->data, file->bytes, &width, &height, reason);
    if (status == FOVEA_OK) status = check_size(wish, width, height, reason);
    if (status != FOVEA_OK) return status;
    if (wish->coloured && !fv_decode_has_colour(file->data, file->bytes))
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "found a grey picture, expected one with colours");
    const int64_t channels = wish->colour ? 3 : 1;
    const size_t bytes = (size_t)(width * height * channels);
    struct fv_decode_image into = {.width = (int32_t)width,
                                   .height = (int32_t)height,
                                   .stride_bytes = (int32_t)(width * channels),
                                   .colour = wish->colour,
                                   .pixels = malloc(bytes)};
    if (into.pixels == NULL) return fovea_error_set(reason, FOVEA_ERROR_SYSTEM, "out of memory");
    status = fv_decode(file->data, file->bytes, &into, reason);
    if (status != FOVEA_OK) {
        free(into.pixels);
        return status;
    }
    *image = (struct fovea_image){.data = into.pixels,
                                  .width = into.width,
                                  .height = into.height,
                                  .stride_bytes = into.stride_bytes,
                                  .format = wish->colour ? FOVEA_PIXEL_RGB24 : FOVEA_PIXEL_GREY8,
                                  .size_bytes = bytes};
    return FOVEA_OK;
}

static enum fovea_status read_as(const char *path, const struct wish *wish,
                                 struct fovea_image *image, struct fovea_error *error)
{
    struct fv_file_buffer file = {0};
    struct fovea_error reason;
    *image = (struct fovea_image){0};
    enum fovea_status status = fv_file_read(&file, path, &reason);
    if (status == FOVEA_GONE)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found no such file, expected a PNG, JPEG or BMP picture",
                               path);
    if (status == FOVEA_OK) status = decode(&file, wish, image, &reason);
    fv_file_free(&file);
    return status == FOVEA_OK ? FOVEA_OK
                              : fovea_error_set(error, status, "%.300s: %.200s", path, reason.text);
}

enum fovea_status fv_picture_read(const char *path, struct fovea_image *image,
                                  struct fovea_error *error)
{
    const struct wish grey = {0};
    return read_as(path, &grey, image, error);
}

enum fovea_status fv_picture_read_colour(const char *path, struct fovea_image *image,
                                         struct fovea_error *error)
{
    const struct wish colour = {.colour = true, .any_size = true};
    return read_as(path, &colour, image, error);
}

enum fovea_status fv_picture_read_coloured(const char *path, struct fovea_image *image,
                                           struct fovea_error *error)
{
    const struct wish coloured = {.colour = true, .coloured = true};
    return read_as(path, &coloured, image, error);
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

enum fovea_status fv_picture_check_name(const char *option, const char *path,
                                        struct fovea_error *error)
{
    static const char *const others[] = {".jpg", ".jpeg", ".bmp", ".tif", ".tiff",
                                         ".gif", ".webp", ".pgm", ".ppm"};
    const char *end = path != NULL ? strrchr(path, '.') : NULL;
    for (size_t i = 0; end != NULL && i < sizeof others / sizeof others[0]; i++)
        if (strcasecmp(end, others[i]) == 0)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s: found %.300s, expected a name that ends in .png: pictures "
                                   "are written as PNG",
                                   option, path);
    return FOVEA_OK;
}

static enum fovea_status write_with(png_uint_32 flags, const char *path,
                                    const struct fovea_image *image, struct fovea_error *error)
{
    png_image png = png_of(image);
    png.flags = flags;
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

enum fovea_status fv_picture_write(const char *path, const struct fovea_image *image,
                                   struct fovea_error *error)
{
    return write_with(0, path, image, error);
}

enum fovea_status fv_picture_write_drawn(const char *path, const struct fovea_image *image,
                                         struct fovea_error *error)
{
    return write_with(PNG_IMAGE_FLAG_FAST, path, image, error);
}
