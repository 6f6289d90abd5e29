#include "app/watch/frame_image.h"

#include <stdlib.h>
#include <string.h>

#include "support/decode.h"

/* How the grey level of pixel x stands in a row of the first plane. */
struct grey {
    int32_t step, first, shift; /* bytes from pixel to pixel; of the first; of words, else 0 */
};

static struct grey grey_of(enum fovea_pixel_format format)
{
    switch (format) {
    case FOVEA_PIXEL_Y10:
        return (struct grey){2, 0, 2};
    case FOVEA_PIXEL_Y12:
        return (struct grey){2, 0, 4};
    case FOVEA_PIXEL_Y14:
        return (struct grey){2, 0, 6};
    case FOVEA_PIXEL_Y16:
        return (struct grey){2, 1, 0};
    case FOVEA_PIXEL_YUYV:
        return (struct grey){2, 0, 0};
    case FOVEA_PIXEL_UYVY:
        return (struct grey){2, 1, 0};
    default: /* grey8, planar formats, mosaics */
        return (struct grey){1, 0, 0};
    }
}

static void grey_copy(const uint8_t *row, struct grey grey, int32_t width, uint8_t *to)
{
    for (int32_t x = 0; x < width; x++) {
        const uint8_t *at = row + (size_t)grey.step * (size_t)x + grey.first;
        to[x] = grey.shift > 0 ? (uint8_t)((at[0] | at[1] << 8) >> grey.shift) : at[0];
    }
}

static void colour_copy(const uint8_t *row, bool reversed, int32_t width, uint8_t *to)
{
    memcpy(to, row, 3 * (size_t)width);
    for (int32_t x = 0; reversed && x < width; x++) {
        to[3 * x] = row[3 * x + 2];
        to[3 * x + 2] = row[3 * x];
    }
}

static bool make(struct fovea_image *image, int32_t width, int32_t height, bool colour)
{
    const size_t row = (size_t)width * (colour ? 3 : 1);
    uint8_t *pixels = malloc(row * (size_t)height);
    *image = (struct fovea_image){.data = pixels,
                                  .width = width,
                                  .height = height,
                                  .stride_bytes = (int32_t)row,
                                  .format = colour ? FOVEA_PIXEL_RGB24 : FOVEA_PIXEL_GREY8,
                                  .size_bytes = row * (size_t)height};
    return pixels != NULL;
}

static enum fovea_status jpeg_decode(const uint8_t *data, size_t bytes, struct fovea_image *image,
                                     struct fovea_error *error)
{
    struct fv_decode_image to = {0};
    enum fovea_status status = fv_decode_probe(data, bytes, &to.width, &to.height, error);
    if (status != FOVEA_OK) return status;
    if (!make(image, to.width, to.height, false))
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for a picture");
    to.stride_bytes = to.width;
    to.pixels = (uint8_t *)(uintptr_t)image->data;
    status = fv_decode(data, bytes, &to, error);
    if (status == FOVEA_OK) return status;
    free(to.pixels);
    image->data = NULL;
    return status;
}

enum fovea_status fv_frame_image(const struct fv_feed_frame *frame, const uint8_t *images,
                                 uint32_t camera, struct fovea_image *image,
                                 struct fovea_error *error)
{
    const struct fv_feed_image *from = &frame->images[camera < FOVEA_CAMERAS_MAX ? camera : 0];
    const struct fovea_image raw = {.data = images + from->offset,
                                    .width = from->width,
                                    .height = from->height,
                                    .stride_bytes = from->stride_bytes,
                                    .format = (enum fovea_pixel_format)from->format,
                                    .size_bytes = from->bytes};
    if (frame->image_count <= camera || from->bytes == 0 || fovea_image_check(&raw) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "found no image of cam%u in the feed, expected one",
                               (unsigned)camera);
    if (raw.format == FOVEA_PIXEL_MJPEG) return jpeg_decode(raw.data, raw.size_bytes, image, error);
    const bool reversed = raw.format == FOVEA_PIXEL_BGR24,
               colour = reversed || raw.format == FOVEA_PIXEL_RGB24;
    if (!make(image, raw.width, raw.height, colour))
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for a picture");
    uint8_t *to = (uint8_t *)(uintptr_t)image->data;
    for (int32_t y = 0; y < raw.height; y++) {
        const uint8_t *row = raw.data + (size_t)y * (size_t)raw.stride_bytes;
        uint8_t *to_row = to + (size_t)y * (size_t)image->stride_bytes;
        if (colour)
            colour_copy(row, reversed, raw.width, to_row);
        else
            grey_copy(row, grey_of(raw.format), raw.width, to_row);
    }
    return FOVEA_OK;
}
