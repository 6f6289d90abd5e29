/* A lens that was knocked: its focal length is another than the calibration says. The picture is
 * resampled about its middle, between pixels bilinearly. What lies beyond the border of the
 * picture is its last pixels. */
#include <string.h>

#include "fault.h"

enum { SHIFT = 16, ONE = 1 << SHIFT, WEIGHT_SHIFT = 8, WEIGHT_ONE = 1 << WEIGHT_SHIFT };

/* Where a row or column of `count` pixels is read: the first of two pixels, and the weight of the
 * second. */
struct place {
    int32_t first, second, weight;
};

static struct place place_of(int32_t at, int32_t count, int64_t step)
{
    const int64_t middle = (int64_t)(count - 1) * (ONE / 2);
    int64_t from = middle + (2 * (int64_t)at - (count - 1)) * step / 2;
    const int64_t last = (int64_t)(count - 1) * ONE;
    if (from < 0) from = 0;
    if (from > last) from = last;
    struct place place = {.first = (int32_t)(from >> SHIFT),
                          .weight = (int32_t)(from & (ONE - 1)) >> (SHIFT - WEIGHT_SHIFT)};
    place.second = place.first + 1 < count ? place.first + 1 : place.first;
    return place;
}

void fv_fault_zoom(struct fv_fault_picture *picture)
{
    const int32_t width = picture->width, channels = picture->channels;
    const size_t stride = (size_t)width * (size_t)channels;
    const int64_t step = (int64_t)(ONE / picture->options->factor + 0.5);
    uint8_t *to = picture->pixels;
    memcpy(picture->scratch, picture->pixels, stride * (size_t)picture->height);
    for (int32_t y = 0; y < picture->height; y++) {
        const struct place row = place_of(y, picture->height, step);
        const uint8_t *upper = picture->scratch + (size_t)row.first * stride,
                      *lower = picture->scratch + (size_t)row.second * stride;
        for (int32_t x = 0; x < width; x++) {
            const struct place column = place_of(x, width, step);
            for (int32_t c = 0; c < channels; c++) {
                const int32_t a = column.first * channels + c, b = column.second * channels + c;
                const int32_t above =
                    upper[a] * (WEIGHT_ONE - column.weight) + upper[b] * column.weight;
                const int32_t below =
                    lower[a] * (WEIGHT_ONE - column.weight) + lower[b] * column.weight;
                *to++ = (uint8_t)((above * (WEIGHT_ONE - row.weight) + below * row.weight +
                                   WEIGHT_ONE * WEIGHT_ONE / 2) >>
                                  2 * WEIGHT_SHIFT);
            }
        }
    }
}
