#include "image/grey.h"

#include <string.h>

/* Bayer: rows mirrored about the first and last, which keeps the colours in phase. */
static void convert_bayer_row(uint8_t *grey, const struct fv_kernels *kernels,
                              const struct fovea_image *image, int32_t y)
{
    const int32_t above = y > 0 ? y - 1 : 1, below = y < image->height - 1 ? y + 1 : y - 1;
    kernels->grey_bayer_u8(grey, image->data + (ptrdiff_t)above * image->stride_bytes,
                           image->data + (ptrdiff_t)y * image->stride_bytes,
                           image->data + (ptrdiff_t)below * image->stride_bytes, image->width);
}

void fv_grey_convert(const struct fv_plane *grey, const struct fv_kernels *kernels,
                     const struct fovea_image *image)
{
    enum { RED = 9798, BLUE = 3735 };
    const int32_t width = image->width;
    for (int32_t y = 0; y < image->height; y++) {
        const uint8_t *row = image->data + (ptrdiff_t)y * image->stride_bytes;
        uint8_t *out = fv_plane_row(grey, y);
        switch (image->format) {
        case FOVEA_PIXEL_GREY8:
        case FOVEA_PIXEL_NV12:
        case FOVEA_PIXEL_YU12:
            memcpy(out, row, (size_t)width);
            break;
        case FOVEA_PIXEL_Y10:
            kernels->grey_shift_u16(out, row, width, 2);
            break;
        case FOVEA_PIXEL_Y12:
            kernels->grey_shift_u16(out, row, width, 4);
            break;
        case FOVEA_PIXEL_Y14:
            kernels->grey_shift_u16(out, row, width, 6);
            break;
        case FOVEA_PIXEL_Y16:
            kernels->grey_shift_u16(out, row, width, 8);
            break;
        case FOVEA_PIXEL_YUYV:
            kernels->grey_pick_u8(out, row, width, 0);
            break;
        case FOVEA_PIXEL_UYVY:
            kernels->grey_pick_u8(out, row, width, 1);
            break;
        case FOVEA_PIXEL_RGB24:
            kernels->grey_mix_u8(out, row, width, RED, BLUE);
            break;
        case FOVEA_PIXEL_BGR24:
            kernels->grey_mix_u8(out, row, width, BLUE, RED);
            break;
        case FOVEA_PIXEL_BAYER_RGGB8:
        case FOVEA_PIXEL_BAYER_BGGR8:
        case FOVEA_PIXEL_BAYER_GRBG8:
        case FOVEA_PIXEL_BAYER_GBRG8:
            convert_bayer_row(out, kernels, image, y);
            break;
        case FOVEA_PIXEL_MJPEG:
        case FOVEA_PIXEL_FORMAT_COUNT:
            return; /* refused by the check before */
        }
    }
}
