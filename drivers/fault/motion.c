/* Blur of a motion during a long exposure: the mean of the picture along a line of `length` pixels,
 * in a direction that a fault draws for all its pictures. Beyond the border the picture goes on
 * with its last pixels. */
#include <string.h>

#include "fault.h"

#include "base/elementary.h"

enum { LENGTH_MAX = 200 };

/* Pixel offsets along the line, the middle at 0. */
static void line_make(const struct fv_fault_picture *picture, int32_t dx[LENGTH_MAX],
                      int32_t dy[LENGTH_MAX])
{
    struct fv_random random;
    fv_random_seed(&random, picture->window_seed);
    const double angle = FV_PI * fv_random_unit(&random), c = fv_cos(angle), s = fv_sin(angle);
    for (int32_t k = 0; k < picture->options->length_px; k++) {
        const double along = k - 0.5 * (picture->options->length_px - 1);
        dx[k] = (int32_t)fv_floor(along * c + 0.5);
        dy[k] = (int32_t)fv_floor(along * s + 0.5);
    }
}

static int32_t inside(int32_t at, int32_t count)
{
    return at < 0 ? 0 : at >= count ? count - 1 : at;
}

void fv_fault_motion(struct fv_fault_picture *picture)
{
    const int32_t width = picture->width, channels = picture->channels,
                  count = picture->options->length_px;
    const size_t stride = (size_t)width * (size_t)channels;
    int32_t dx[LENGTH_MAX], dy[LENGTH_MAX];
    line_make(picture, dx, dy);
    memcpy(picture->scratch, picture->pixels, stride * (size_t)picture->height);
    uint8_t *to = picture->pixels;
    for (int32_t y = 0; y < picture->height; y++)
        for (int32_t x = 0; x < width; x++)
            for (int32_t c = 0; c < channels; c++) {
                int32_t sum = count / 2;
                for (int32_t k = 0; k < count; k++)
                    sum += picture->scratch[(size_t)inside(y + dy[k], picture->height) * stride +
                                            (size_t)(inside(x + dx[k], width) * channels + c)];
                *to++ = (uint8_t)(sum / count);
            }
}
