#include "support/decode.h"

/* Header of an uncompressed BMP (Microsoft, BITMAPINFOHEADER and its successors). */
struct header {
    int64_t width, height, stride;
    bool from_top;
    int bits;               /* of a pixel: 8, 24 or 32 */
    const uint8_t *pixels;  /* first row of the file */
    const uint8_t *palette; /* 8 bits: blue, green, red, unused */
    uint32_t colours;       /* in the palette */
};

static uint32_t little32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* Whether channels lie as in a BMP without masks: no compression, or masks that say the same. */
static bool is_plain(const uint8_t *data, size_t bytes, uint32_t compression, int bits)
{
    enum { RGB = 0, BITFIELDS = 3, MASKS_AT = 54 };
    if (compression == RGB) return true;
    return compression == BITFIELDS && bits == 32 && bytes >= MASKS_AT + 12 &&
           little32(data + MASKS_AT) == 0xff0000 && little32(data + MASKS_AT + 4) == 0xff00 &&
           little32(data + MASKS_AT + 8) == 0xff;
}

static enum fovea_status read_palette(const uint8_t *data, size_t bytes, uint32_t info_bytes,
                                      struct header *header, struct fovea_error *reason)
{
    const uint32_t stated = little32(data + 46);
    header->colours = stated == 0 ? 256 : stated;
    if (header->colours > 256 || info_bytes > bytes ||
        14 + (size_t)info_bytes + 4 * (size_t)header->colours > bytes)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "byte 46: found a palette of %u colours, expected 1 to 256 within "
                               "the file",
                               header->colours);
    header->palette = data + 14 + info_bytes;
    return FOVEA_OK;
}

static enum fovea_status read_header(const uint8_t *data, size_t bytes, struct header *header,
                                     struct fovea_error *reason)
{
    enum { HEADERS_BYTES = 54 };
    if (bytes < HEADERS_BYTES || little32(data + 14) < 40)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "byte 14: found no header of a BMP, expected one of 40 bytes");
    const int bits = data[28] | data[29] << 8;
    const uint32_t compression = little32(data + 30);
    if ((bits != 8 && bits != 24 && bits != 32) || !is_plain(data, bytes, compression, bits))
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "byte 28: found a BMP of %d bits and compression %u, expected 8, 24 "
                               "or 32 bits, uncompressed",
                               bits, compression);
    const int64_t height = (int32_t)little32(data + 22);
    *header = (struct header){.width = (int32_t)little32(data + 18),
                              .height = height < 0 ? -height : height,
                              .from_top = height < 0,
                              .bits = bits};
    header->stride = (header->width * bits / 8 + 3) / 4 * 4;
    return bits == 8 ? read_palette(data, bytes, little32(data + 14), header, reason) : FOVEA_OK;
}

/* Sizes are below 2^31, so their product with a stride fits. */
static enum fovea_status find_pixels(const uint8_t *data, size_t bytes, struct header *header,
                                     struct fovea_error *reason)
{
    const int64_t start = little32(data + 10), end = start + header->stride * header->height;
    if (end > (int64_t)bytes) {
        fovea_error_set(reason, FOVEA_ERROR_INPUT,
                        "damaged BMP: found %zu bytes, expected %lld for %lld x %lld pixels", bytes,
                        (long long)end, (long long)header->width, (long long)header->height);
        return FOVEA_ERROR_INPUT;
    }
    header->pixels = data + start;
    return FOVEA_OK;
}

enum fovea_status fv_decode_bmp_size(const uint8_t *data, size_t bytes, int64_t *width,
                                     int64_t *height, struct fovea_error *reason)
{
    struct header header;
    const enum fovea_status status = read_header(data, bytes, &header, reason);
    if (status != FOVEA_OK) return status;
    *width = header.width;
    *height = header.height;
    return FOVEA_OK;
}

bool fv_decode_bmp_has_colour(const uint8_t *data, size_t bytes)
{
    struct header header;
    if (read_header(data, bytes, &header, NULL) != FOVEA_OK) return false;
    bool grey = header.palette != NULL;
    for (uint32_t i = 0; grey && i < header.colours; i++) {
        const uint8_t *bgr = header.palette + (size_t)i * 4;
        grey = bgr[0] == bgr[1] && bgr[1] == bgr[2];
    }
    return !grey;
}

/* A row as RGB. An index beyond the palette is black. */
static void row_rgb(const struct header *header, const uint8_t *from, int64_t width, uint8_t *to)
{
    static const uint8_t black[4] = {0};
    const int step = header->bits / 8;
    for (int64_t x = 0; x < width; x++, from += step, to += 3) {
        const uint8_t *bgr = from;
        if (header->palette != NULL)
            bgr = from[0] < header->colours ? header->palette + (size_t)from[0] * 4 : black;
        to[0] = bgr[2];
        to[1] = bgr[1];
        to[2] = bgr[0];
    }
}

enum fovea_status fv_decode_bmp(const uint8_t *data, size_t bytes,
                                const struct fv_decode_image *image, struct fovea_error *reason)
{
    enum { PART = 256 }; /* pixels that are turned into grey at a time */
    struct header header;
    enum fovea_status status = read_header(data, bytes, &header, reason);
    if (status == FOVEA_OK && (header.width != image->width || header.height != image->height))
        status = fovea_error_set(
            reason, FOVEA_ERROR_INPUT, "found %lld x %lld pixels, expected %d x %d",
            (long long)header.width, (long long)header.height, image->width, image->height);
    if (status == FOVEA_OK) status = find_pixels(data, bytes, &header, reason);
    if (status != FOVEA_OK) return status;
    const int64_t width = header.width;
    for (int64_t y = 0; y < header.height; y++) {
        const uint8_t *from =
            header.pixels + (header.from_top ? y : header.height - 1 - y) * header.stride;
        uint8_t *to = image->pixels + y * image->stride_bytes, rgb[3 * PART];
        if (image->colour) {
            row_rgb(&header, from, width, to);
            continue;
        }
        for (int64_t x = 0; x < width; x += PART) {
            const int64_t part = width - x < PART ? width - x : PART;
            row_rgb(&header, from + x * (header.bits / 8), part, rgb);
            fv_decode_rgb_row(rgb, to + x, (int32_t)part);
        }
    }
    return FOVEA_OK;
}
