#include "support/image_pack.h"

#include <string.h>

size_t fv_image_packed_bytes(const struct fovea_image *image)
{
    if (image->data == NULL) return 0;
    if (image->format == FOVEA_PIXEL_MJPEG) return image->size_bytes;
    return fovea_image_bytes(image->format, image->height,
                             fovea_image_stride_min(image->format, image->width));
}

static uint8_t *rows_copy(uint8_t *to, const uint8_t *from, int32_t rows, int32_t row_bytes,
                          int32_t stride_bytes)
{
    for (int32_t y = 0; y < rows; y++, to += row_bytes, from += stride_bytes)
        memcpy(to, from, (size_t)row_bytes);
    return to;
}

struct fovea_image fv_image_pack(const struct fovea_image *image, uint8_t *to)
{
    const int32_t row = fovea_image_stride_min(image->format, image->width), h = image->height,
                  stride = image->stride_bytes;
    struct fovea_image packed = *image;
    packed.data = to;
    packed.stride_bytes = row;
    packed.size_bytes = fv_image_packed_bytes(image);
    if (image->format == FOVEA_PIXEL_MJPEG) {
        memcpy(to, image->data, image->size_bytes);
        return packed;
    }
    to = rows_copy(to, image->data, h, row, stride);
    const uint8_t *chroma = image->data + (size_t)h * (size_t)stride;
    if (image->format == FOVEA_PIXEL_NV12) rows_copy(to, chroma, h / 2, row, stride);
    if (image->format == FOVEA_PIXEL_YU12) rows_copy(to, chroma, h, row / 2, stride / 2);
    return packed;
}
