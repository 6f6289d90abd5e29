#include "app/lab/label_picture.h"

#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#include "support/decode.h"

struct reader {
    const uint8_t *data;
    size_t bytes, at;
    const char *path;
    struct fovea_error *error;
    uint8_t *labels;
    png_bytep *rows;
};

static void on_error(png_structp png, png_const_charp message)
{
    const struct reader *reader = png_get_error_ptr(png);
    fovea_error_set(reader->error, FOVEA_ERROR_INPUT,
                    "%.200s: byte %zu: found damage (%.80s), expected a PNG of class numbers",
                    reader->path, reader->at, message);
    longjmp(png_jmpbuf(png), 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static void on_read(png_structp png, png_bytep bytes, png_size_t count)
{
    struct reader *reader = png_get_io_ptr(png);
    if (count > reader->bytes - reader->at) png_error(png, "the file ends");
    memcpy(bytes, reader->data + reader->at, count);
    reader->at += count;
}

static enum fovea_status check(const struct reader *reader, png_structp png, png_infop info,
                               int32_t width, int32_t height)
{
    const int type = png_get_color_type(png, info), bits = png_get_bit_depth(png, info);
    const unsigned w = png_get_image_width(png, info), h = png_get_image_height(png, info);
    if ((type != PNG_COLOR_TYPE_GRAY && type != PNG_COLOR_TYPE_PALETTE) || bits > 8)
        return fovea_error_set(
            reader->error, FOVEA_ERROR_INPUT,
            "%.200s: found %d bits of %s, expected class numbers in grey levels or a palette of up to 8 bits",
            reader->path, bits, type == PNG_COLOR_TYPE_GRAY ? "grey" : "colours");
    if (w != (unsigned)width || h != (unsigned)height)
        return fovea_error_set(reader->error, FOVEA_ERROR_INPUT,
                               "%.200s: found %u x %u pixels, expected %d x %d as the picture",
                               reader->path, w, h, width, height);
    return FOVEA_OK;
}

/* After an error of libpng this returns a second time. */
static enum fovea_status read_all(struct reader *reader, png_structp png, png_infop info,
                                  int32_t width, int32_t height)
{
    if (setjmp(png_jmpbuf(png)) != 0) return FOVEA_ERROR_INPUT;
    png_set_read_fn(png, reader, on_read);
    png_read_info(png, info);
    if (check(reader, png, info, width, height) != FOVEA_OK) return FOVEA_ERROR_INPUT;
    png_set_packing(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    png_read_image(png, reader->rows);
    png_read_end(png, NULL);
    return FOVEA_OK;
}

static enum fovea_status decode(struct reader *reader, int32_t width, int32_t height)
{
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, reader, on_error, on_warning);
    png_infop info = png == NULL ? NULL : png_create_info_struct(png);
    reader->labels = calloc((size_t)width * (size_t)height, 1);
    reader->rows = calloc((size_t)height, sizeof *reader->rows);
    enum fovea_status status = FOVEA_ERROR_SYSTEM;
    if (info == NULL || reader->labels == NULL || reader->rows == NULL) {
        fovea_error_set(reader->error, status, "%.200s: out of memory", reader->path);
    } else {
        for (int32_t y = 0; y < height; y++)
            reader->rows[y] = reader->labels + (size_t)y * (size_t)width;
        status = read_all(reader, png, info, width, height);
    }
    png_destroy_read_struct(&png, &info, NULL);
    free(reader->rows);
    return status;
}

enum fovea_status fv_label_picture_read(const char *path, int32_t width, int32_t height,
                                        uint8_t **labels, struct fovea_error *error)
{
    struct fv_file_buffer file = {0};
    struct fovea_error reason;
    const enum fovea_status found = fv_file_read(&file, path, &reason);
    if (found != FOVEA_OK) {
        fv_file_free(&file);
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: found %.100s, expected a PNG",
                               path, found == FOVEA_GONE ? "no such file" : reason.text);
    }
    struct reader reader = {.data = file.data, .bytes = file.bytes, .path = path, .error = error};
    const enum fovea_status status = decode(&reader, width, height);
    fv_file_free(&file);
    if (status != FOVEA_OK) {
        free(reader.labels);
        return status;
    }
    *labels = reader.labels;
    return FOVEA_OK;
}
