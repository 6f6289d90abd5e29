/* A lens out of focus: a Gaussian, in rows and then in columns, with integer weights. Beyond the
 * border the picture goes on with its last pixels. */
#include "fault.h"

#include "base/elementary.h"

enum { RADIUS_MAX = 60, SHIFT = 15, ONE = 1 << SHIFT };

/* Half of the symmetric weights, the middle first; together ONE. Returns the radius. */
static int32_t weights_make(double sigma_px, int32_t weights[RADIUS_MAX + 1])
{
    double sum = 0, values[RADIUS_MAX + 1];
    int32_t radius = (int32_t)(3 * sigma_px + 0.5), rest = ONE;
    if (radius < 1) radius = 1;
    if (radius > RADIUS_MAX) radius = RADIUS_MAX;
    for (int32_t k = 0; k <= radius; k++) {
        values[k] = fv_exp(-0.5 * (double)(k * k) / (sigma_px * sigma_px));
        sum += k == 0 ? values[k] : 2 * values[k];
    }
    for (int32_t k = 1; k <= radius; k++) {
        weights[k] = (int32_t)(values[k] / sum * ONE + 0.5);
        rest -= 2 * weights[k];
    }
    weights[0] = rest;
    return radius;
}

static int32_t inside(int32_t at, int32_t count)
{
    return at < 0 ? 0 : at >= count ? count - 1 : at;
}

static void rows_blur(const struct fv_fault_picture *picture, const int32_t *weights,
                      int32_t radius, const uint8_t *from, uint8_t *to)
{
    const int32_t width = picture->width, channels = picture->channels;
    for (int32_t y = 0; y < picture->height; y++) {
        const uint8_t *row = from + (size_t)y * (size_t)(width * channels);
        for (int32_t x = 0; x < width; x++)
            for (int32_t c = 0; c < channels; c++) {
                int32_t sum = weights[0] * row[x * channels + c] + ONE / 2;
                for (int32_t k = 1; k <= radius; k++)
                    sum += weights[k] * (row[inside(x - k, width) * channels + c] +
                                         row[inside(x + k, width) * channels + c]);
                *to++ = (uint8_t)(sum >> SHIFT);
            }
    }
}

static void columns_blur(const struct fv_fault_picture *picture, const int32_t *weights,
                         int32_t radius, const uint8_t *from, uint8_t *to)
{
    const int32_t bytes = picture->width * picture->channels;
    for (int32_t y = 0; y < picture->height; y++)
        for (int32_t x = 0; x < bytes; x++) {
            int32_t sum = weights[0] * from[(size_t)y * (size_t)bytes + (size_t)x] + ONE / 2;
            for (int32_t k = 1; k <= radius; k++) {
                const size_t above = (size_t)inside(y - k, picture->height),
                             below = (size_t)inside(y + k, picture->height);
                sum += weights[k] * (from[above * (size_t)bytes + (size_t)x] +
                                     from[below * (size_t)bytes + (size_t)x]);
            }
            *to++ = (uint8_t)(sum >> SHIFT);
        }
}

void fv_fault_blur(struct fv_fault_picture *picture)
{
    int32_t weights[RADIUS_MAX + 1];
    const int32_t radius = weights_make(picture->options->sigma_px, weights);
    rows_blur(picture, weights, radius, picture->pixels, picture->scratch);
    columns_blur(picture, weights, radius, picture->scratch, picture->pixels);
}
