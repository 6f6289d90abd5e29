/* Something close hangs before the lens: a dark ellipse, out of focus and so without texture, that
 * hides `share` of the picture; each fault draws its place, shape and level. Parts of it may lie
 * outside, in the place of which the others grow: it is drawn as large as hides that share. */
#include "fault.h"

#include "base/elementary.h"

enum { STEPS = 24 };

struct ellipse {
    double x, y, wide, high; /* middle, and half axes at a size of 1 */
};

/* Columns [first, last) of row y that an ellipse of a size hides. */
static void row_of(const struct ellipse *e, double size, int32_t y, int32_t width, int32_t *first,
                   int32_t *last)
{
    const double dy = (y - e->y) / (e->high * size), rest = 1 - dy * dy;
    *first = *last = 0;
    if (rest <= 0) return;
    const double half = e->wide * size * __builtin_sqrt(rest);
    const double low = fv_floor(e->x - half + 0.5), high = fv_floor(e->x + half + 0.5);
    *first = low < 0 ? 0 : low > width ? width : (int32_t)low;
    *last = high < 0 ? 0 : high > width ? width : (int32_t)high;
}

static double hidden(const struct ellipse *e, double size, int32_t width, int32_t height)
{
    double sum = 0;
    for (int32_t y = 0; y < height; y++) {
        int32_t first, last;
        row_of(e, size, y, width, &first, &last);
        sum += last - first;
    }
    return sum / ((double)width * height);
}

void fv_fault_occlusion(struct fv_fault_picture *picture)
{
    const int32_t width = picture->width, height = picture->height, channels = picture->channels;
    struct fv_random random;
    fv_random_seed(&random, picture->window_seed);
    struct ellipse e;
    e.x = width * fv_random_unit(&random);
    e.y = height * fv_random_unit(&random);
    e.wide = width * (0.5 + fv_random_unit(&random));
    e.high = width * (0.5 + fv_random_unit(&random));
    const uint8_t level = (uint8_t)(10 + fv_random_below(&random, 60));
    double low = 0, high = 8; /* at 8 it hides all: twice the picture's longest way and more */
    for (int i = 0; i < STEPS; i++) {
        const double size = 0.5 * (low + high);
        if (hidden(&e, size, width, height) < picture->options->share)
            low = size;
        else
            high = size;
    }
    for (int32_t y = 0; y < height; y++) {
        int32_t first, last;
        row_of(&e, high, y, width, &first, &last);
        uint8_t *row = picture->pixels + (size_t)y * (size_t)width * (size_t)channels;
        for (int32_t i = first * channels; i < last * channels; i++)
            row[i] = level;
    }
}
