/* The integral image of SURF: the image smoothed, at twice its size where asked (features/surf.h).
 */
#include <string.h>

#include "features/surf.h"

_Static_assert(FV_SURF_LIGHT_ROWS > 2 * FV_SCALE_RADIUS_MAX, "a row's neighbours are all held");

void fv_surf_carve_integral(struct fv_surf *surf, struct fv_arena *arena)
{
    const int32_t width = surf->doubled ? surf->width / 2 : surf->width;
    surf->stride = (surf->width + 1 + 15) / 16 * 16;
    surf->row_stride = fv_scale_stride(width);
    fv_scale_gauss_make(&surf->gauss, surf->doubled ? FV_SURF_SMOOTH / 2 : FV_SURF_SMOOTH);
    const size_t row = (size_t)surf->row_stride * sizeof(uint16_t);
    surf->light = fv_arena_take(arena, FV_SURF_LIGHT_ROWS, row);
    surf->smooth = fv_arena_take(arena, FV_SURF_SMOOTH_ROWS, row);
    surf->scratch = fv_arena_take_raw(arena, (size_t)surf->row_stride + 2 * FV_SCALE_PAD,
                                      sizeof *surf->scratch);
    surf->integral = fv_arena_take_raw(arena, (size_t)surf->height + 1,
                                       (size_t)surf->stride * sizeof *surf->integral);
}

static uint16_t *light_row(const struct fv_surf *surf, int32_t y)
{
    return surf->light + (ptrdiff_t)(y % FV_SURF_LIGHT_ROWS) * surf->row_stride;
}

static uint16_t *smooth_row(const struct fv_surf *surf, int32_t y)
{
    return surf->smooth + (ptrdiff_t)(y % FV_SURF_SMOOTH_ROWS) * surf->row_stride;
}

static void take_row(const struct fv_surf *surf, const struct fv_plane *image, int32_t y)
{
    const uint8_t *in = fv_plane_row(image, y);
    uint16_t *restrict out = light_row(surf, y);
    for (int32_t x = 0; x < image->width; x++)
        out[x] = (uint16_t)(in[x] * 128);
}

/* Row y smoothed; rows are reflected without repeating the first and the last. */
static void smooth(const struct fv_surf *surf, const struct fv_kernels *kernels,
                   const struct fv_plane *image, int32_t y)
{
    const uint16_t *rows[2 * FV_SCALE_RADIUS_MAX + 1];
    const int32_t radius = surf->gauss.radius, last = image->height - 1;
    for (int32_t i = -radius; i <= radius; i++) {
        int32_t at = y + i < 0 ? -(y + i) : y + i;
        if (at > last) at = 2 * last - at;
        rows[radius + i] = light_row(surf, at);
    }
    kernels->scale_blur_row_u16(smooth_row(surf, y), rows, image->width, surf->gauss.weights,
                                radius, surf->scratch);
}

/* Row y of the image into the sums. */
static void add_row(const struct fv_surf *surf, int32_t y)
{
    const uint16_t *in = smooth_row(surf, y);
    const uint32_t *above = surf->integral + (ptrdiff_t)y * surf->stride;
    uint32_t *restrict row = surf->integral + (ptrdiff_t)(y + 1) * surf->stride, sum = 0;
    row[0] = 0;
    for (int32_t x = 0; x < surf->width; x++) {
        sum += in[x];
        row[x + 1] = above[x + 1] + sum;
    }
}

/* Row y of the double, bilinear, three parts of `near` and one of `far`. */
static void add_doubled_row(const struct fv_surf *surf, int32_t y, const uint16_t *near,
                            const uint16_t *far)
{
    const int32_t last = surf->width / 2 - 1;
    const uint32_t *above = surf->integral + (ptrdiff_t)y * surf->stride;
    uint32_t *restrict row = surf->integral + (ptrdiff_t)(y + 1) * surf->stride, sum = 0;
    uint32_t left = 3u * near[0] + far[0], here = left;
    row[0] = 0;
    for (int32_t x = 0; x <= last; x++) {
        const int32_t next = x < last ? x + 1 : last;
        const uint32_t right = 3u * near[next] + far[next];
        sum += (3 * here + left + 8) >> 4;
        row[2 * x + 1] = above[2 * x + 1] + sum;
        sum += (3 * here + right + 8) >> 4;
        row[2 * x + 2] = above[2 * x + 2] + sum;
        left = here;
        here = right;
    }
}

void fv_surf_integrate(struct fv_surf *surf, const struct fv_kernels *kernels,
                       const struct fv_plane *image)
{
    const int32_t last = image->height - 1;
    memset(surf->integral, 0, (size_t)surf->stride * sizeof *surf->integral);
    for (int32_t y = 0, taken = 0; y <= last; y++) {
        for (; taken <= last && taken <= y + surf->gauss.radius; taken++)
            take_row(surf, image, taken);
        smooth(surf, kernels, image, y);
        if (!surf->doubled) {
            add_row(surf, y);
            continue;
        }
        const uint16_t *here = smooth_row(surf, y),
                       *before = y > 0 ? smooth_row(surf, y - 1) : here;
        if (y > 0) add_doubled_row(surf, 2 * y - 1, before, here);
        add_doubled_row(surf, 2 * y, here, before);
        if (y == last) add_doubled_row(surf, 2 * y + 1, here, here);
    }
}
