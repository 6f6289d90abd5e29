#include "image/filters.h"

#include <stdbool.h>
#include <string.h>

#include "base/elementary.h"

void fv_filters_carve(struct fv_filters *filters, int32_t width, struct fv_arena *arena)
{
    filters->row_bytes =
        (width + FV_CACHE_LINE_BYTES - 1) / FV_CACHE_LINE_BYTES * FV_CACHE_LINE_BYTES;
    filters->kept = fv_arena_take_raw(arena, FV_FILTER_RADIUS_MAX + 1, (size_t)filters->row_bytes);
    filters->row = fv_arena_take_raw(arena, (size_t)filters->row_bytes, 1);
    filters->scratch = fv_arena_take_raw(arena, (size_t)width + FV_GAUSS_PAD, sizeof(uint16_t));
}

void fv_gauss_make(struct fv_gauss *gauss, uint32_t size, double sigma_px)
{
    static const double small[3][4] = {
        {.5, .25, 0, 0}, {.375, .25, .0625, 0}, {.28125, .21875, .109375, .03125}};
    const int32_t radius = (int32_t)size / 2;
    double exact[FV_FILTER_RADIUS_MAX + 1], sum = 0;
    for (int32_t i = radius; i >= 0; i--) {
        exact[i] = sigma_px > 0 ? fv_exp(-i * i / (2 * sigma_px * sigma_px)) : small[radius - 1][i];
        sum += i > 0 ? 2 * exact[i] : exact[i];
    }
    double error = 0;
    uint16_t left = 256;
    *gauss = (struct fv_gauss){.radius = radius};
    for (int32_t i = radius; i > 0; i--) {
        const double wanted = 256 * exact[i] / sum + error;
        gauss->weights[i] = (uint16_t)fv_floor(wanted + .5);
        error = wanted - gauss->weights[i];
        left = (uint16_t)(left - 2 * gauss->weights[i]);
    }
    gauss->weights[0] = left;
}

/* Rows around the one that is written. In place, rows already written are kept elsewhere. */
struct window {
    const struct fv_filters *filters;
    const struct fv_plane *in;
    int32_t radius;
    bool repeat;   /* the edge, instead of reflecting without it */
    bool in_place; /* rows up to the present one are in `kept` */
};

static uint8_t *kept_row(const struct window *window, int32_t y)
{
    return window->filters->kept +
           (int64_t)(y % (FV_FILTER_RADIUS_MAX + 1)) * window->filters->row_bytes;
}

static void window_at(const struct window *window, int32_t y, const uint8_t **rows)
{
    const int32_t last = window->in->height - 1;
    if (window->in_place)
        memcpy(kept_row(window, y), fv_plane_row(window->in, y), (size_t)window->in->width);
    for (int32_t i = -window->radius; i <= window->radius; i++) {
        int32_t from = y + i;
        if (from < 0) from = window->repeat ? 0 : -from;
        if (from > last) from = window->repeat ? last : 2 * last - from;
        rows[i + window->radius] =
            window->in_place && from <= y ? kept_row(window, from) : fv_plane_row(window->in, from);
    }
}

static struct window window_over(const struct fv_filters *filters, const struct fv_plane *in,
                                 const struct fv_plane *out, int32_t radius, bool repeat)
{
    return (struct window){filters, in, radius, repeat, in->pixels == out->pixels};
}

void fv_gauss_run(const struct fv_filters *filters, const struct fv_gauss *gauss,
                  const struct fv_kernels *kernels, const struct fv_plane *in,
                  const struct fv_plane *out)
{
    const struct window window = window_over(filters, in, out, gauss->radius, false);
    const uint8_t *rows[2 * FV_FILTER_RADIUS_MAX + 1];
    for (int32_t y = 0; y < in->height; y++) {
        window_at(&window, y, rows);
        kernels->gauss_row_u8(fv_plane_row(out, y), rows, in->width, gauss->weights, gauss->radius,
                              filters->scratch);
    }
}

void fv_sharpen_run(const struct fv_filters *filters, const struct fv_gauss *gauss,
                    int32_t amount_q8, const struct fv_kernels *kernels, const struct fv_plane *in,
                    const struct fv_plane *out)
{
    const struct window window = window_over(filters, in, out, gauss->radius, false);
    const uint8_t *rows[2 * FV_FILTER_RADIUS_MAX + 1];
    for (int32_t y = 0; y < in->height; y++) {
        window_at(&window, y, rows);
        kernels->gauss_row_u8(filters->row, rows, in->width, gauss->weights, gauss->radius,
                              filters->scratch);
        kernels->mix_u8(fv_plane_row(out, y), rows[gauss->radius], filters->row, in->width,
                        amount_q8);
    }
}

void fv_median_run(const struct fv_filters *filters, const struct fv_kernels *kernels,
                   const struct fv_plane *in, const struct fv_plane *out)
{
    const struct window window = window_over(filters, in, out, 1, true);
    const uint8_t *rows[3];
    for (int32_t y = 0; y < in->height; y++) {
        window_at(&window, y, rows);
        kernels->median3_row_u8(fv_plane_row(out, y), rows, in->width);
    }
}

void fv_bilateral_make(uint16_t weights[3][256], double sigma_px, double sigma_grey)
{
    static const double squared_px[3] = {1, 2, 4};
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 256; i++) {
            const double w = fv_exp(-squared_px[k] / (2 * sigma_px * sigma_px)) *
                             fv_exp(-i * i / (2 * sigma_grey * sigma_grey));
            weights[k][i] = (uint16_t)fv_floor(FV_BILATERAL_WEIGHT_MAX * w + .5);
        }
}

void fv_bilateral_run(const struct fv_filters *filters, const uint16_t weights[3][256],
                      const struct fv_kernels *kernels, const struct fv_plane *in,
                      const struct fv_plane *out)
{
    const struct window window = window_over(filters, in, out, 2, false);
    const uint8_t *rows[5];
    for (int32_t y = 0; y < in->height; y++) {
        window_at(&window, y, rows);
        kernels->bilateral_row_u8(fv_plane_row(out, y), rows, in->width, weights);
    }
}
