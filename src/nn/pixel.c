#include "nn/pixel.h"

#include <string.h>

bool fv_pixel_known(enum fovea_pixel_format format)
{
    return (unsigned)format < FOVEA_PIXEL_FORMAT_COUNT && format != FOVEA_PIXEL_MJPEG;
}

static uint8_t clamp8(int32_t value)
{
    return value < 0 ? 0 : value > 255 ? 255 : (uint8_t)value;
}

/* BT.601 in 20-bit fixed point: 1.164 (Y - 16) and the usual weights of the colour differences. */
static void from_yuv(int32_t y, int32_t u, int32_t v, uint8_t rgb[3])
{
    enum {
        HALF = 1 << 19,
        LUMA = 1220542,
        V_RED = 1673527,
        V_GREEN = -852492,
        U_GREEN = -409993,
        U_BLUE = 2116026
    };
    const int32_t luma = (y > 16 ? y - 16 : 0) * LUMA + HALF;
    u -= 128;
    v -= 128;
    rgb[0] = clamp8((luma + V_RED * v) >> 20);
    rgb[1] = clamp8((luma + V_GREEN * v + U_GREEN * u) >> 20);
    rgb[2] = clamp8((luma + U_BLUE * u) >> 20);
}

static void from_packed(const uint8_t *pair, int32_t x, int32_t luma_at, bool luma, uint8_t rgb[3])
{
    const uint8_t y = pair[luma_at + 2 * (x & 1)];
    if (luma)
        memset(rgb, y, 3);
    else
        from_yuv(y, pair[1 - luma_at], pair[3 - luma_at], rgb);
}

static void from_planes(const struct fovea_image *image, int32_t x, int32_t y, bool luma,
                        uint8_t rgb[3])
{
    const size_t stride = (size_t)image->stride_bytes, rows = (size_t)image->height;
    const uint8_t value = image->data[(size_t)y * stride + (size_t)x],
                  *chroma = image->data + stride * rows;
    const size_t cx = (size_t)x / 2, cy = (size_t)y / 2;
    if (luma) {
        memset(rgb, value, 3);
    } else if (image->format == FOVEA_PIXEL_NV12) {
        from_yuv(value, chroma[cy * stride + 2 * cx], chroma[cy * stride + 2 * cx + 1], rgb);
    } else {
        const size_t half = stride / 2;
        from_yuv(value, chroma[cy * half + cx], chroma[(rows / 2 + cy) * half + cx], rgb);
    }
}

static void from_bayer(const struct fovea_image *image, int32_t x, int32_t y, uint8_t rgb[3])
{
    /* Column and row of red within the cell. */
    const bool right =
        image->format == FOVEA_PIXEL_BAYER_BGGR8 || image->format == FOVEA_PIXEL_BAYER_GRBG8;
    const bool low =
        image->format == FOVEA_PIXEL_BAYER_BGGR8 || image->format == FOVEA_PIXEL_BAYER_GBRG8;
    const uint8_t *upper = image->data + (ptrdiff_t)(y & ~1) * image->stride_bytes + (x & ~1),
                  *lower = upper + image->stride_bytes;
    const uint8_t *red_row = low ? lower : upper, *blue_row = low ? upper : lower;
    rgb[0] = red_row[right];
    rgb[1] = (uint8_t)((red_row[!right] + blue_row[right] + 1) / 2);
    rgb[2] = blue_row[!right];
}

static void from_words(const uint8_t *at, int shift, uint8_t rgb[3])
{
    const int32_t value = (at[0] | at[1] << 8) >> shift;
    memset(rgb, value > 255 ? 255 : value, 3);
}

void fv_pixel_fetch(const struct fovea_image *image, int32_t x, int32_t y, bool luma,
                    uint8_t rgb[3])
{
    const uint8_t *row = image->data + (ptrdiff_t)y * image->stride_bytes;
    switch (image->format) {
    case FOVEA_PIXEL_GREY8:
        memset(rgb, row[x], 3);
        return;
    case FOVEA_PIXEL_Y10:
        from_words(row + 2 * x, 2, rgb);
        return;
    case FOVEA_PIXEL_Y12:
        from_words(row + 2 * x, 4, rgb);
        return;
    case FOVEA_PIXEL_Y14:
        from_words(row + 2 * x, 6, rgb);
        return;
    case FOVEA_PIXEL_Y16:
        from_words(row + 2 * x, 8, rgb);
        return;
    case FOVEA_PIXEL_YUYV:
        from_packed(row + 4 * (x / 2), x, 0, luma, rgb);
        return;
    case FOVEA_PIXEL_UYVY:
        from_packed(row + 4 * (x / 2), x, 1, luma, rgb);
        return;
    case FOVEA_PIXEL_NV12:
    case FOVEA_PIXEL_YU12:
        from_planes(image, x, y, luma, rgb);
        return;
    case FOVEA_PIXEL_RGB24:
        memcpy(rgb, row + 3 * x, 3);
        return;
    case FOVEA_PIXEL_BGR24:
        rgb[0] = row[3 * x + 2];
        rgb[1] = row[3 * x + 1];
        rgb[2] = row[3 * x];
        return;
    case FOVEA_PIXEL_BAYER_RGGB8:
    case FOVEA_PIXEL_BAYER_BGGR8:
    case FOVEA_PIXEL_BAYER_GRBG8:
    case FOVEA_PIXEL_BAYER_GBRG8:
        from_bayer(image, x, y, rgb);
        return;
    case FOVEA_PIXEL_MJPEG:
    case FOVEA_PIXEL_FORMAT_COUNT:
        break;
    }
    memset(rgb, 0, 3);
}

/* How luma stands in a row: bytes from one pixel to the next, and of the first; 0 where it does not
 * stand alone. */
static int32_t luma_step(enum fovea_pixel_format format, int32_t *first)
{
    *first = format == FOVEA_PIXEL_UYVY;
    switch (format) {
    case FOVEA_PIXEL_GREY8:
    case FOVEA_PIXEL_NV12:
    case FOVEA_PIXEL_YU12:
        return 1;
    case FOVEA_PIXEL_YUYV:
    case FOVEA_PIXEL_UYVY:
        return 2;
    default:
        return 0;
    }
}

/* Bits by which 8-bit grey is shifted in formats of 16 bits; 0: another format. */
static int word_shift(enum fovea_pixel_format format)
{
    switch (format) {
    case FOVEA_PIXEL_Y10:
        return 2;
    case FOVEA_PIXEL_Y12:
        return 4;
    case FOVEA_PIXEL_Y14:
        return 6;
    case FOVEA_PIXEL_Y16:
        return 8;
    default:
        return 0;
    }
}

static void relight_row(enum fovea_pixel_format format, uint8_t *row, const uint8_t *before,
                        const uint8_t *after, int32_t width)
{
    int32_t first;
    const int32_t step = luma_step(format, &first), shift = word_shift(format);
    const int32_t values =
        format == FOVEA_PIXEL_RGB24 || format == FOVEA_PIXEL_BGR24 ? 3 : 1; /* of a pixel */
    for (int32_t x = 0; x < width; x++) {
        const int32_t word = after[x] << shift, rise = after[x] - before[x];
        if (step > 0) {
            row[first + step * x] = after[x];
        } else if (shift > 0) {
            row[2 * x] = (uint8_t)(word & 255);
            row[2 * x + 1] = (uint8_t)(word >> 8);
        } else {
            for (int32_t c = values * x; c < values * (x + 1); c++)
                row[c] = clamp8(row[c] + rise);
        }
    }
}

void fv_pixel_relight(const struct fovea_image *image, uint8_t *pixels,
                      const struct fovea_image *before, const struct fovea_image *after)
{
    for (int32_t y = 0; y < image->height; y++)
        relight_row(image->format, pixels + (ptrdiff_t)y * image->stride_bytes,
                    before->data + (ptrdiff_t)y * before->stride_bytes,
                    after->data + (ptrdiff_t)y * after->stride_bytes, image->width);
}

static void copy_rows(const uint8_t *from, int32_t from_stride, uint8_t *to, int32_t to_stride,
                      int32_t rows)
{
    for (int32_t y = 0; y < rows; y++)
        memcpy(to + (ptrdiff_t)y * to_stride, from + (ptrdiff_t)y * from_stride, (size_t)to_stride);
}

enum fovea_status fv_pixel_copy(const struct fovea_image *image, uint8_t *to, size_t capacity,
                                struct fovea_image *copied)
{
    const int32_t stride = fovea_image_stride_min(image->format, image->width), h = image->height;
    const size_t bytes = fovea_image_bytes(image->format, h, stride);
    if (bytes == 0 || bytes > capacity) return FOVEA_ERROR_MEMORY;
    const uint8_t *chroma = image->data + (size_t)image->stride_bytes * (size_t)h;
    uint8_t *to_chroma = to + (size_t)stride * (size_t)h;
    copy_rows(image->data, image->stride_bytes, to, stride, h);
    if (image->format == FOVEA_PIXEL_NV12)
        copy_rows(chroma, image->stride_bytes, to_chroma, stride, h / 2);
    if (image->format == FOVEA_PIXEL_YU12)
        copy_rows(chroma, image->stride_bytes / 2, to_chroma, stride / 2, h);
    *copied = *image;
    copied->data = to;
    copied->stride_bytes = stride;
    copied->size_bytes = bytes;
    return FOVEA_OK;
}
