#include "support/decode.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fovea/image.h"
#include "support/input.h"

static const uint8_t png_signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};

static bool is_png(const uint8_t *data, size_t bytes)
{
    return bytes >= sizeof png_signature && memcmp(data, png_signature, sizeof png_signature) == 0;
}

static bool is_jpeg(const uint8_t *data, size_t bytes)
{
    return bytes >= 3 && data[0] == 0xFF && data[1] == 0xD8 && data[2] == 0xFF;
}

static bool is_bmp(const uint8_t *data, size_t bytes)
{
    return bytes >= 2 && data[0] == 'B' && data[1] == 'M';
}

static enum fovea_status unknown_kind(const uint8_t *data, size_t bytes, struct fovea_error *reason)
{
    if (bytes == 0)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "found an empty file, expected PNG, JPEG or BMP");
    return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                           "byte 0: found 0x%02X%s, expected PNG, JPEG or BMP", data[0],
                           bytes < 8 ? " and too few bytes" : "");
}

static uint32_t big_endian(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

enum fovea_status fv_decode_check_size(int64_t width, int64_t height, struct fovea_error *reason)
{
    if (width >= FOVEA_IMAGE_WIDTH_MIN && width <= FOVEA_IMAGE_WIDTH_MAX &&
        height >= FOVEA_IMAGE_HEIGHT_MIN && height <= FOVEA_IMAGE_HEIGHT_MAX)
        return FOVEA_OK;
    return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                           "found %lld x %lld pixels, expected %d x %d to %d x %d",
                           (long long)width, (long long)height, FOVEA_IMAGE_WIDTH_MIN,
                           FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_WIDTH_MAX, FOVEA_IMAGE_HEIGHT_MAX);
}

enum fovea_status fv_decode_size(const uint8_t *data, size_t bytes, int64_t *width, int64_t *height,
                                 struct fovea_error *reason)
{
    if (is_jpeg(data, bytes)) return fv_decode_jpeg_size(data, bytes, width, height, reason);
    if (is_bmp(data, bytes)) return fv_decode_bmp_size(data, bytes, width, height, reason);
    if (!is_png(data, bytes)) return unknown_kind(data, bytes, reason);
    if (bytes < 33 || memcmp(data + 12, "IHDR", 4) != 0)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "byte 8: found no image header, expected IHDR");
    *width = big_endian(data + 16);
    *height = big_endian(data + 20);
    return FOVEA_OK;
}

enum fovea_status fv_decode_probe(const uint8_t *data, size_t bytes, int32_t *width,
                                  int32_t *height, struct fovea_error *reason)
{
    int64_t w = 0, h = 0;
    enum fovea_status status = fv_decode_size(data, bytes, &w, &h, reason);
    if (status == FOVEA_OK) status = fv_decode_check_size(w, h, reason);
    if (status != FOVEA_OK) return status;
    *width = (int32_t)w;
    *height = (int32_t)h;
    return FOVEA_OK;
}

/* Number of components in a JPEG's frame header, 0 without one. Segments are walked as they state
 * their lengths. */
static int jpeg_components(const uint8_t *data, size_t bytes)
{
    for (size_t at = 2; at + 10 <= bytes && data[at] == 0xFF;) {
        const int marker = data[at + 1];
        const bool is_frame =
            marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
        if (is_frame) return data[at + 9];
        at += marker == 0xFF ? 1 : 2 + ((size_t)data[at + 2] << 8 | data[at + 3]);
    }
    return 0;
}

bool fv_decode_has_colour(const uint8_t *data, size_t bytes)
{
    enum { COLOUR_TYPE_AT = 25, COLOUR_BIT = 2 };
    if (is_png(data, bytes))
        return bytes > COLOUR_TYPE_AT && (data[COLOUR_TYPE_AT] & COLOUR_BIT) != 0;
    if (is_bmp(data, bytes)) return fv_decode_bmp_has_colour(data, bytes);
    return is_jpeg(data, bytes) && jpeg_components(data, bytes) == 3;
}

enum fovea_status fv_decode(const uint8_t *data, size_t bytes, const struct fv_decode_image *image,
                            struct fovea_error *reason)
{
    if (is_png(data, bytes)) return fv_decode_png(data, bytes, image, reason);
    if (is_jpeg(data, bytes)) return fv_decode_jpeg(data, bytes, image, reason);
    if (is_bmp(data, bytes)) return fv_decode_bmp(data, bytes, image, reason);
    return unknown_kind(data, bytes, reason);
}

void fv_decode_rgb_row(const uint8_t *rgb, uint8_t *grey, int32_t width)
{
    for (int32_t x = 0; x < width; ++x, rgb += 3)
        grey[x] = (uint8_t)((9798u * rgb[0] + 19235u * rgb[1] + 3735u * rgb[2] + 16384u) >> 15);
}

/* ---- files ----------------------------------------------------------------------------------- */

static enum fovea_status read_whole(struct fv_file_buffer *buffer, int descriptor, size_t wanted,
                                    struct fovea_error *reason)
{
    if (wanted > buffer->capacity || buffer->data == NULL) {
        fv_file_free(buffer);
        buffer->data = malloc(wanted + wanted / 4 + 1);
        if (buffer->data == NULL)
            return fovea_error_set(reason, FOVEA_ERROR_SYSTEM, "out of memory");
        buffer->capacity = wanted + wanted / 4 + 1;
    }
    for (buffer->bytes = 0; buffer->bytes < wanted;) {
        const ssize_t got = read(descriptor, buffer->data + buffer->bytes, wanted - buffer->bytes);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0)
            return fovea_error_set(reason, FOVEA_ERROR_INPUT, "cannot be read: %s",
                                   strerror(errno));
        if (got == 0) break;
        buffer->bytes += (size_t)got;
    }
    return FOVEA_OK;
}

enum fovea_status fv_file_read(struct fv_file_buffer *buffer, const char *path,
                               struct fovea_error *reason)
{
    struct fovea_error why = {.status = FOVEA_OK};
    int64_t bytes = 0;
    const int descriptor = fv_input_open(path, FV_INPUT_PICTURE_BYTES_MAX, &bytes, &why);
    if (descriptor < 0) return fovea_error_set(reason, why.status, "%s", why.text);
    const enum fovea_status status = read_whole(buffer, descriptor, (size_t)bytes, reason);
    close(descriptor);
    return status;
}

void fv_file_free(struct fv_file_buffer *buffer)
{
    free(buffer->data);
    *buffer = (struct fv_file_buffer){0};
}
