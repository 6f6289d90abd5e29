#include "features/patch.h"

void fv_patch_describe(const struct fv_plane *level, int32_t x, int32_t y,
                       uint8_t descriptor[FV_PATCH_BYTES])
{
    uint32_t sum = 0, squares = 0;
    for (int32_t i = 0; i < FV_PATCH_SIDE; i++) {
        const uint8_t *row = fv_plane_row(level, y - FV_PATCH_RADIUS_PX + i) + x;
        for (int32_t j = 0; j < FV_PATCH_SIDE; j++) {
            const uint8_t pixel = row[j - FV_PATCH_RADIUS_PX];
            descriptor[i * FV_PATCH_SIDE + j] = pixel;
            sum += pixel;
            squares += (uint32_t)pixel * pixel;
        }
    }
    /* 81^2 times the variance: at most 81^2 127.5^2, exact. */
    const uint32_t spread = FV_PATCH_BYTES * squares - sum * sum;
    const double scale = spread > 0 ? 32 / __builtin_sqrt((double)spread) : 0;
    for (int32_t i = 0; i < FV_PATCH_BYTES; i++) {
        const int32_t deviation = FV_PATCH_BYTES * descriptor[i] - (int32_t)sum;
        const double value = 128.5 + scale * deviation;
        descriptor[i] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
    }
}
