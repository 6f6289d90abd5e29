#include "support/colour.h"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>
#include <jerror.h>
#include <png.h>

#include "support/input.h"
#include "support/text.h"

#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
enum { SIDE_MAX = 512 }; /* a picture of 800 MB takes a fuzzer a second */
#else
enum { SIDE_MAX = 16384 };
#endif

static enum fovea_status new_image(const char *path, int64_t width, int64_t height,
                                   struct fovea_image *image, struct fovea_error *error)
{
    if (width < 1 || width > SIDE_MAX || height < 1 || height > SIDE_MAX) {
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: %lld x %lld pixels, expected 1 to %d", path,
                               (long long)width, (long long)height, SIDE_MAX);
    }
    const size_t bytes = (size_t)(width * height * 3);
    uint8_t *data = malloc(bytes);
    if (data == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
    *image = (struct fovea_image){.data = data,
                                  .width = (int32_t)width,
                                  .height = (int32_t)height,
                                  .stride_bytes = (int32_t)width * 3,
                                  .format = FOVEA_PIXEL_RGB24,
                                  .size_bytes = bytes};
    return FOVEA_OK;
}

/* Callers give back an image after an error, too. */
static void give_back(struct fovea_image *image)
{
    free((void *)(uintptr_t)image->data);
    memset(image, 0, sizeof *image);
}

static enum fovea_status read_png(const char *path, const uint8_t *data, size_t bytes,
                                  struct fovea_image *image, struct fovea_error *error)
{
    png_image png = {.version = PNG_IMAGE_VERSION};
    if (!png_image_begin_read_from_memory(&png, data, bytes)) {
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: %.100s", path, png.message);
    }
    png.format = PNG_FORMAT_RGB;
    enum fovea_status status = new_image(path, png.width, png.height, image, error);
    const png_color black = {0, 0, 0};
    if (status == FOVEA_OK && !png_image_finish_read(&png, &black, (void *)(uintptr_t)image->data,
                                                     image->stride_bytes, NULL)) {
        give_back(image);
        status = fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: %.100s", path, png.message);
    }
    png_image_free(&png);
    return status;
}

struct jpeg_failure {
    struct jpeg_error_mgr manager;
    jmp_buf leave;
    char text[JMSG_LENGTH_MAX];
};

static void on_jpeg_error(j_common_ptr info)
{
    struct jpeg_failure *failure = (struct jpeg_failure *)info->err;
    info->err->format_message(info, failure->text);
    longjmp(failure->leave, 1);
}

/* Warnings are damage, but for those that cost no pixel, as in decode_jpeg.c. */
static void on_jpeg_message(j_common_ptr info, int level)
{
    const int code = info->err->msg_code;
    if (level >= 0 || code == JWRN_EXTRANEOUS_DATA || code == JWRN_JFIF_MAJOR ||
        code == JWRN_ADOBE_XFORM || code == JWRN_TOO_MUCH_DATA)
        return;
    on_jpeg_error(info);
}

static enum fovea_status read_jpeg(const char *path, const uint8_t *data, size_t bytes,
                                   struct fovea_image *image, struct fovea_error *error)
{
    struct jpeg_decompress_struct info;
    struct jpeg_failure failure;
    struct fovea_image *volatile made = NULL;
    info.err = jpeg_std_error(&failure.manager);
    failure.manager.error_exit = on_jpeg_error;
    failure.manager.emit_message = on_jpeg_message;
    if (setjmp(failure.leave)) {
        jpeg_destroy_decompress(&info);
        if (made != NULL) give_back(made);
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: damaged JPEG: %.150s", path,
                               failure.text);
    }
    jpeg_create_decompress(&info);
    jpeg_mem_src(&info, data, bytes);
    jpeg_read_header(&info, TRUE);
    info.out_color_space = JCS_RGB;
    jpeg_start_decompress(&info);
    const enum fovea_status status =
        new_image(path, info.output_width, info.output_height, image, error);
    if (status == FOVEA_OK) {
        made = image;
        while (info.output_scanline < info.output_height) {
            JSAMPROW row = (JSAMPROW)(uintptr_t)image->data +
                           (size_t)info.output_scanline * (size_t)image->stride_bytes;
            jpeg_read_scanlines(&info, &row, 1);
        }
        jpeg_finish_decompress(&info);
    }
    jpeg_destroy_decompress(&info);
    return status;
}

static uint32_t little32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static enum fovea_status read_bmp(const char *path, const uint8_t *data, size_t bytes,
                                  struct fovea_image *image, struct fovea_error *error)
{
    if (bytes < 54 || data[28] != 24 || data[29] != 0 || little32(data + 30) != 0) {
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: byte 28: only uncompressed BMP of 24 bits is read", path);
    }
    const int64_t width = (int32_t)little32(data + 18),
                  signed_height = (int32_t)little32(data + 22);
    const int64_t height = signed_height < 0 ? -signed_height : signed_height,
                  start = little32(data + 10);
    const int64_t stride = (width * 3 + 3) / 4 * 4;
    if (width < 1 || height < 1 || width > SIDE_MAX || height > SIDE_MAX ||
        start + stride * height > (int64_t)bytes) {
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: byte 18: %lld x %lld pixels do not fit the file", path,
                               (long long)width, (long long)height);
    }
    const enum fovea_status status = new_image(path, width, height, image, error);
    for (int64_t y = 0; y < height && status == FOVEA_OK; y++) {
        const uint8_t *from = data + start + (signed_height < 0 ? y : height - 1 - y) * stride;
        uint8_t *to = (uint8_t *)(uintptr_t)image->data + y * image->stride_bytes;
        for (int64_t x = 0; x < width; x++, from += 3, to += 3) {
            to[0] = from[2];
            to[1] = from[1];
            to[2] = from[0];
        }
    }
    return status;
}

enum fovea_status fv_colour_read(const char *path, struct fovea_image *image,
                                 struct fovea_error *error)
{
    char *text;
    size_t bytes;
    enum fovea_status status = fv_text_read(path, FV_INPUT_PICTURE_BYTES_MAX, &text, &bytes, error);
    if (status != FOVEA_OK) return status;
    const uint8_t *data = (const uint8_t *)text;
    static const uint8_t png[4] = {0x89, 'P', 'N', 'G'};
    if (bytes > 4 && memcmp(data, png, 4) == 0)
        status = read_png(path, data, bytes, image, error);
    else if (bytes > 4 && data[0] == 0xFF && data[1] == 0xD8)
        status = read_jpeg(path, data, bytes, image, error);
    else if (bytes > 4 && data[0] == 'B' && data[1] == 'M')
        status = read_bmp(path, data, bytes, image, error);
    else
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%.300s: byte 0: neither PNG, JPEG nor BMP", path);
    free(text);
    return status;
}
