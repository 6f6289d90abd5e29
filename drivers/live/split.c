#include "split.h"

#include <string.h>

/* Pixels that stand together: a half must hold whole groups. */
static int32_t group_of(enum fovea_pixel_format format)
{
    switch (format) {
    case FOVEA_PIXEL_YUYV:
    case FOVEA_PIXEL_UYVY:
    case FOVEA_PIXEL_BAYER_RGGB8:
    case FOVEA_PIXEL_BAYER_BGGR8:
    case FOVEA_PIXEL_BAYER_GRBG8:
    case FOVEA_PIXEL_BAYER_GBRG8:
        return 2;
    default:
        return 1;
    }
}

bool fv_split_possible(enum fovea_pixel_format format, int32_t width)
{
    const bool planes = format == FOVEA_PIXEL_NV12 || format == FOVEA_PIXEL_YU12;
    return !planes && width % (2 * group_of(format)) == 0 && width / 2 >= FOVEA_IMAGE_WIDTH_MIN;
}

/* MJPEG becomes grey. */
static enum fovea_pixel_format decoded(enum fovea_pixel_format format)
{
    return format == FOVEA_PIXEL_MJPEG ? FOVEA_PIXEL_GREY8 : format;
}

size_t fv_split_bytes(enum fovea_pixel_format format, int32_t width, int32_t height)
{
    return (size_t)fovea_image_stride_min(decoded(format), width / 2) * (size_t)height;
}

void fv_split(const struct fovea_image *whole, uint8_t *memory, struct fovea_image halves[2])
{
    const int32_t stride = fovea_image_stride_min(whole->format, whole->width / 2);
    for (int i = 0; i < 2; i++) {
        halves[i] = *whole;
        halves[i].width = whole->width / 2;
        halves[i].stride_bytes = stride;
        halves[i].size_bytes = (size_t)stride * (size_t)whole->height;
        halves[i].data = memory;
        for (int32_t y = 0; y < whole->height; y++, memory += stride)
            memcpy(memory, whole->data + (size_t)y * (size_t)whole->stride_bytes + i * stride,
                   (size_t)stride);
    }
}
