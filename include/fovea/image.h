/* Images: a description of pixels that the caller owns.
 *
 * Rows are `stride_bytes` apart, top row first. Multi-plane formats (NV12, YU12) have their planes
 * one after the other in the same buffer, chroma stride as in V4L2 (NV12: stride_bytes; YU12:
 * stride_bytes / 2). For FOVEA_PIXEL_MJPEG the image is `size_bytes` of compressed data and the
 * stride is 0. */
#ifndef FOVEA_IMAGE_H
#define FOVEA_IMAGE_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fovea_pixel_format {
    FOVEA_PIXEL_GREY8 = 0,
    FOVEA_PIXEL_Y10 = 1, /* 10 significant low bits in little-endian 16-bit words */
    FOVEA_PIXEL_Y12 = 2, /* 12 significant low bits */
    FOVEA_PIXEL_Y16 = 3, /* 16 bits, the high byte is the grey level */
    FOVEA_PIXEL_YUYV = 4,
    FOVEA_PIXEL_UYVY = 5,
    FOVEA_PIXEL_NV12 = 6,
    FOVEA_PIXEL_YU12 = 7,
    FOVEA_PIXEL_RGB24 = 8,
    FOVEA_PIXEL_BGR24 = 9,
    FOVEA_PIXEL_BAYER_RGGB8 = 10,
    FOVEA_PIXEL_BAYER_BGGR8 = 11,
    FOVEA_PIXEL_BAYER_GRBG8 = 12,
    FOVEA_PIXEL_BAYER_GBRG8 = 13,
    FOVEA_PIXEL_MJPEG = 14,
    FOVEA_PIXEL_Y14 = 15, /* 14 significant low bits */
    FOVEA_PIXEL_FORMAT_COUNT
};

enum {
    FOVEA_IMAGE_WIDTH_MIN = 64,
    FOVEA_IMAGE_WIDTH_MAX = 4096,
    FOVEA_IMAGE_HEIGHT_MIN = 64,
    FOVEA_IMAGE_HEIGHT_MAX = 4096
};

struct fovea_image {
    const uint8_t *data; /* first byte of the top row */
    int32_t width;       /* pixels */
    int32_t height;      /* rows */
    int32_t stride_bytes;
    enum fovea_pixel_format format;
    size_t size_bytes; /* bytes readable from `data` */
};

/* Name as used in configuration and messages ("grey8", "yuyv", ...); "unknown" out of range. Any
 * thread. */
const char *fovea_pixel_format_name(enum fovea_pixel_format format);

/* Smallest stride in bytes of a row of `width` pixels; 0 for compressed or unknown formats. Any
 * thread. */
int32_t fovea_image_stride_min(enum fovea_pixel_format format, int32_t width);

/* Bytes that an image with these rows occupies, all planes; 0 for compressed or unknown formats.
 * Any thread. */
size_t fovea_image_bytes(enum fovea_pixel_format format, int32_t height, int32_t stride_bytes);

/* Whether the description is consistent: known format, size within FOVEA_IMAGE_* limits, stride and
 * size_bytes large enough. Returns FOVEA_OK or FOVEA_ERROR_ARGUMENT. Real-time safe, any thread. */
enum fovea_status fovea_image_check(const struct fovea_image *image);

#ifdef __cplusplus
}
#endif
#endif
