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

void fv_mask_compose(uint8_t *mask, const uint8_t *fixed, int32_t width, int32_t height,
                     const struct fv_mask_box *boxes, uint32_t count)
{
    const size_t bytes = (size_t)width * (size_t)height;
    if (fixed == NULL)
        memset(mask, 255, bytes);
    else if (fixed != mask)
        memcpy(mask, fixed, bytes);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_mask_box *box = &boxes[i];
        if (!(box->x_max > box->x_min && box->y_max > box->y_min)) continue;
        const int32_t left = floor_within(box->x_min, width),
                      right = ceil_within(box->x_max, width);
        const int32_t bottom = ceil_within(box->y_max, height);
        for (int32_t y = floor_within(box->y_min, height); y < bottom && left < right; y++)
            memset(mask + (size_t)y * (size_t)width + (size_t)left, 0, (size_t)(right - left));
    }
}
