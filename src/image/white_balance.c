#include "base/grey_world.h"
#include "fovea/preprocess.h"

static void make_table(uint8_t table[256], uint64_t own, uint64_t all)
{
    for (uint32_t i = 0; i < 256; i++)
        table[i] = fv_grey_world(i, own, all);
}

enum fovea_status fovea_white_balance(const struct fovea_image *image, uint8_t *out,
                                      int32_t out_stride_bytes)
{
    uint64_t sums[3] = {0};
    uint8_t tables[3][256];
    const enum fovea_status status = fovea_image_check(image);
    if (status != FOVEA_OK) return status;
    if ((image->format != FOVEA_PIXEL_RGB24 && image->format != FOVEA_PIXEL_BGR24) ||
        out_stride_bytes < 3 * image->width ||
        (image->data == out && image->stride_bytes != out_stride_bytes))
        return FOVEA_ERROR_ARGUMENT;
    for (int32_t y = 0; y < image->height; y++) {
        const uint8_t *row = image->data + (int64_t)y * image->stride_bytes;
        for (int32_t i = 0; i < 3 * image->width; i += 3)
            for (int c = 0; c < 3; c++)
                sums[c] += row[i + c];
    }
    for (int c = 0; c < 3; c++)
        make_table(tables[c], sums[c], sums[0] + sums[1] + sums[2]);
    for (int32_t y = 0; y < image->height; y++) {
        const uint8_t *row = image->data + (int64_t)y * image->stride_bytes;
        uint8_t *to = out + (int64_t)y * out_stride_bytes;
        for (int32_t i = 0; i < 3 * image->width; i += 3)
            for (int c = 0; c < 3; c++)
                to[i + c] = tables[c][row[i + c]];
    }
    return FOVEA_OK;
}
