#include "fovea/image.h"

#include <stdbool.h>

/* Bytes of a row are width x numerator / 2; a frame has rows x rows_numerator / 2 strides. */
struct layout {
    const char *name;
    int8_t half_bytes_per_pixel; /* of the first plane; 0: compressed */
    int8_t half_strides_per_row; /* of all planes together */
    bool even_width, even_height;
};

static const struct layout layouts[FOVEA_PIXEL_FORMAT_COUNT] = {
    [FOVEA_PIXEL_GREY8] = {"grey8", 2, 2, false, false},
    [FOVEA_PIXEL_Y10] = {"y10", 4, 2, false, false},
    [FOVEA_PIXEL_Y12] = {"y12", 4, 2, false, false},
    [FOVEA_PIXEL_Y16] = {"y16", 4, 2, false, false},
    [FOVEA_PIXEL_YUYV] = {"yuyv", 4, 2, true, false},
    [FOVEA_PIXEL_UYVY] = {"uyvy", 4, 2, true, false},
    [FOVEA_PIXEL_NV12] = {"nv12", 2, 3, true, true},
    [FOVEA_PIXEL_YU12] = {"yu12", 2, 3, true, true},
    [FOVEA_PIXEL_RGB24] = {"rgb24", 6, 2, false, false},
    [FOVEA_PIXEL_BGR24] = {"bgr24", 6, 2, false, false},
    [FOVEA_PIXEL_BAYER_RGGB8] = {"bayer_rggb8", 2, 2, true, true},
    [FOVEA_PIXEL_BAYER_BGGR8] = {"bayer_bggr8", 2, 2, true, true},
    [FOVEA_PIXEL_BAYER_GRBG8] = {"bayer_grbg8", 2, 2, true, true},
    [FOVEA_PIXEL_BAYER_GBRG8] = {"bayer_gbrg8", 2, 2, true, true},
    [FOVEA_PIXEL_Y14] = {"y14", 4, 2, false, false},
    [FOVEA_PIXEL_MJPEG] = {"mjpeg", 0, 0, false, false},
};

static bool known(enum fovea_pixel_format format)
{
    return (unsigned)format < FOVEA_PIXEL_FORMAT_COUNT;
}

const char *fovea_pixel_format_name(enum fovea_pixel_format format)
{
    return known(format) ? layouts[format].name : "unknown";
}

int32_t fovea_image_stride_min(enum fovea_pixel_format format, int32_t width)
{
    if (!known(format) || width <= 0 || width > INT32_MAX / 6) return 0;
    return width * layouts[format].half_bytes_per_pixel / 2;
}

size_t fovea_image_bytes(enum fovea_pixel_format format, int32_t height, int32_t stride_bytes)
{
    if (!known(format) || height <= 0 || stride_bytes <= 0) return 0;
    return (size_t)height * (size_t)stride_bytes * (size_t)layouts[format].half_strides_per_row / 2;
}

static bool within(int32_t value, int32_t low, int32_t high)
{
    return value >= low && value <= high;
}

enum fovea_status fovea_image_check(const struct fovea_image *image)
{
    if (image == NULL || image->data == NULL || !known(image->format)) return FOVEA_ERROR_ARGUMENT;
    if (!within(image->width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX))
        return FOVEA_ERROR_ARGUMENT;
    if (!within(image->height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX))
        return FOVEA_ERROR_ARGUMENT;

    const struct layout *layout = &layouts[image->format];
    if (layout->half_bytes_per_pixel == 0) /* compressed */
        return image->stride_bytes == 0 && image->size_bytes > 0 ? FOVEA_OK : FOVEA_ERROR_ARGUMENT;
    if ((layout->even_width && image->width % 2 != 0) ||
        (layout->even_height && image->height % 2 != 0))
        return FOVEA_ERROR_ARGUMENT;
    if (image->stride_bytes < fovea_image_stride_min(image->format, image->width))
        return FOVEA_ERROR_ARGUMENT;
    if (layout->half_strides_per_row == 3 && image->stride_bytes % 2 != 0)
        return FOVEA_ERROR_ARGUMENT;

    /* The last row need not be followed by its padding. */
    const size_t whole = fovea_image_bytes(image->format, image->height, image->stride_bytes);
    const int32_t last_row = layout->half_strides_per_row == 3 && image->format == FOVEA_PIXEL_YU12
                                 ? image->width / 2
                                 : fovea_image_stride_min(image->format, image->width);
    const int32_t last_stride =
        image->format == FOVEA_PIXEL_YU12 ? image->stride_bytes / 2 : image->stride_bytes;
    return image->size_bytes >= whole - (size_t)(last_stride - last_row) ? FOVEA_OK
                                                                         : FOVEA_ERROR_ARGUMENT;
}
