#include "features/mask.h"

#include <stddef.h>
#include <string.h>

/* First pixel touched at `at`, within [0, size]. */
static int32_t floor_within(float at, int32_t size)
{
    return at <= 0 ? 0 : at >= (float)size ? size : (int32_t)at;
}

/* One past the last pixel touched before `at`, within [0, size]. */
static int32_t ceil_within(float at, int32_t size)
{
    const int32_t whole = floor_within(at, size);
    return whole < size && at > (float)whole ? whole + 1 : whole;
}

static void begin(const struct fv_plane *mask, const struct fv_plane *fixed)
{
    const size_t width = (size_t)mask->width;
    if (fixed != NULL && fixed->pixels == mask->pixels) return;
    for (int32_t y = 0; y < mask->height; y++) {
        if (fixed == NULL)
            memset(fv_plane_row(mask, y), 255, width);
        else
            memcpy(fv_plane_row(mask, y), fv_plane_row(fixed, y), width);
    }
}

void fv_mask_compose(const struct fv_plane *mask, const struct fv_plane *fixed,
                     const struct fv_mask_box *boxes, uint32_t count)
{
    const int32_t width = mask->width, height = mask->height;
    begin(mask, fixed);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_mask_box *box = &boxes[i];
        if (!(box->x_max > box->x_min && box->y_max > box->y_min)) continue;
        const int32_t left = floor_within(box->x_min, width),
                      right = ceil_within(box->x_max, width);
        const int32_t bottom = ceil_within(box->y_max, height);
        for (int32_t y = floor_within(box->y_min, height); y < bottom && left < right; y++)
            memset(fv_plane_row(mask, y) + left, 0, (size_t)(right - left));
    }
}
