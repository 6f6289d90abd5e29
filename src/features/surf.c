#include "features/surf.h"

#include <string.h>

#include "features/quadratic.h"

/* A key of fv_strongest holds x and y; the layer stands above the bits of x. */
enum { X_BITS = 13, LAYERS_FOUND = FV_SURF_LAYERS - 2 };
_Static_assert(2 * FOVEA_IMAGE_WIDTH_MAX <= 1 << X_BITS &&
                   FV_SURF_OCTAVES * LAYERS_FOUND << X_BITS <= 1 << 16,
               "the layer fits above x");

/* Sides of filters. */
static const int32_t sides[FV_SURF_OCTAVES][FV_SURF_LAYERS] = {
    {9, 15, 21, 27}, {15, 27, 39, 51}, {27, 51, 75, 99}, {51, 99, 147, 195}};

/* Pixels from determinant to determinant. */
static const int32_t steps[FV_SURF_OCTAVES] = {2, 2, 4, 8};

/* What a determinant counts for: (side / 15)^-0.8 (surf.h). */
static const float worth[FV_SURF_OCTAVES][LAYERS_FOUND] = {
    {1, .764f}, {.625f, .466f}, {.376f, .276f}, {.221f, .161f}};

#define REACH 1. /* of refining, in steps of the grid or between layers */

void fv_surf_carve(struct fv_surf *surf, const struct fovea_extract_config *config, int32_t width,
                   int32_t height, struct fv_arena *arena)
{
    surf->doubled = config->doubled != 0;
    surf->width = surf->doubled ? 2 * width : width;
    surf->height = surf->doubled ? 2 * height : height;
    surf->count_max = config->count_max;
    surf->octaves = config->levels < FV_SURF_OCTAVES ? config->levels : FV_SURF_OCTAVES;
    surf->hessian = config->hessian;
    surf->quality = config->quality;
    surf->upright = config->upright != 0;
    fv_surf_carve_integral(surf, arena);
    surf->sums = fv_arena_take(arena, 3 * (size_t)surf->stride, sizeof *surf->sums);
    surf->rows =
        fv_arena_take(arena, 3 * FV_SURF_LAYERS * (size_t)surf->stride, sizeof *surf->rows);
    /* Some are left out when they are refined. */
    fv_strongest_carve(&surf->strongest, config->count_max + config->count_max / 4 + 16, arena);
    surf->tables = fv_arena_take(arena, 1, sizeof *surf->tables);
    if (surf->tables != NULL) fv_surf_tables_fill(surf->tables);
    surf->features = fv_arena_take(arena, surf->count_max, sizeof *surf->features);
    surf->descriptors = fv_arena_take(arena, surf->count_max, FV_SURF_BYTES);
}

/* Determinants of row y, where the filter fits; `from` (on the grid) and `end` are columns of the
 * image. */
static void respond(struct fv_surf *surf, const struct fv_kernels *kernels, int32_t side, int32_t y,
                    int32_t step, int32_t from, int32_t end, float *out)
{
    const int32_t lobe = side / 3, half = side / 2, near = lobe / 2;
    const int32_t at[FV_SURF_BOX_ROWS] = {1 - lobe, lobe,  -half, half + 1, -near,
                                          near + 1, -lobe, 0,     1,        lobe + 1};
    const uint32_t *rows[FV_SURF_BOX_ROWS];
    for (int32_t k = 0; k < FV_SURF_BOX_ROWS; k++)
        rows[k] = surf->integral + (ptrdiff_t)(y + at[k]) * surf->stride + from;
    kernels->surf_row_f32(out + from / step, rows, side, step, (end - from + step - 1) / step,
                          surf->sums);
}

/* Rows of determinants of an octave: three of each layer in turn. */
static float *row_of(const struct fv_surf *surf, int32_t layer, int32_t row)
{
    return surf->rows + (ptrdiff_t)(3 * layer + row % 3) * surf->stride;
}

/* The first column or row of the image, on the grid, where a filter fits. */
static int32_t first_of(int32_t side, int32_t step)
{
    return (side / 2 + step - 1) / step * step;
}

static void respond_layers(struct fv_surf *surf, const struct fv_kernels *kernels,
                           const int32_t *side, int32_t step, int32_t row)
{
    const int32_t y = row * step;
    for (int32_t layer = 0; layer < FV_SURF_LAYERS; layer++) {
        const int32_t from = first_of(side[layer], step), half = side[layer] / 2;
        if (y >= from && y < surf->height - half && from < surf->width - half)
            respond(surf, kernels, side[layer], y, step, from, surf->width - half,
                    row_of(surf, layer, row));
    }
}

/* Whether a determinant is greater than its 26 neighbours; of equal ones the first counts. */
static bool is_maximum(const struct fv_surf *surf, int32_t layer, int32_t row, int32_t column)
{
    const float value = row_of(surf, layer, row)[column];
    for (int32_t s = -1; s <= 1; s++)
        for (int32_t r = -1; r <= 1; r++) {
            const float *near = row_of(surf, layer + s, row + r) + column;
            for (int32_t c = -1; c <= 1; c++) {
                const int32_t order = 9 * s + 3 * r + c;
                if (order < 0 ? near[c] >= value : order > 0 && near[c] > value) return false;
            }
        }
    return true;
}

static void search_row(struct fv_surf *surf, uint32_t octave, int32_t layer, int32_t row,
                       float least, const struct fv_plane *mask)
{
    const int32_t step = steps[octave], outer = sides[octave][layer + 1];
    const int32_t first = first_of(outer, step) / step + 1;
    const int32_t last = (surf->width - outer / 2 - 1) / step - 1;
    const int32_t last_row = (surf->height - outer / 2 - 1) / step - 1;
    if (row < first || row > last_row) return;
    const int32_t pixel = surf->doubled ? 2 : 1;
    const float *values = row_of(surf, layer, row);
    for (int32_t i = first; i <= last; i++) {
        const float value = values[i];
        if (!(value > least && value > values[i - 1] && value >= values[i + 1]) ||
            !is_maximum(surf, layer, row, i))
            continue;
        const int32_t x = i * step, y = row * step;
        if (mask->pixels != NULL && fv_plane_row(mask, y / pixel)[x / pixel] == 0) continue;
        const float weighted = value * worth[octave][layer - 1];
        uint32_t bits;
        memcpy(&bits, &weighted, sizeof bits); /* in the order of the values */
        const int32_t found = (int32_t)octave * LAYERS_FOUND + layer - 1;
        fv_strongest_offer(&surf->strongest, bits, found << X_BITS | x, y);
    }
}

/* The least determinant that counts (surf.h). */
static float least_of(const struct fv_surf *surf, const struct fv_plane *image)
{
    const double pixels = (double)image->width * image->height;
    uint64_t sum = 0, squares = 0;
    for (int32_t y = 0; y < image->height; y++) {
        const uint8_t *row = fv_plane_row(image, y);
        uint32_t row_sum = 0, row_squares = 0;
        for (int32_t x = 0; x < image->width; x++) {
            row_sum += row[x];
            row_squares += (uint32_t)(row[x] * row[x]);
        }
        sum += row_sum;
        squares += row_squares;
    }
    const double mean = (double)sum / pixels, variance = (double)squares / pixels - mean * mean;
    const float least = surf->quality * (float)variance;
    return least > surf->hessian ? least : surf->hessian;
}

static void find(struct fv_surf *surf, const struct fv_kernels *kernels,
                 const struct fv_plane *image, const struct fv_plane *mask)
{
    const float least = least_of(surf, image);
    fv_strongest_begin(&surf->strongest);
    for (uint32_t octave = 0; octave < surf->octaves; octave++) {
        const int32_t step = steps[octave], rows = (surf->height + step - 1) / step;
        for (int32_t row = 0; row < rows; row++) {
            respond_layers(surf, kernels, sides[octave], step, row);
            for (int32_t layer = 1; layer < FV_SURF_LAYERS - 1; layer++)
                search_row(surf, octave, layer, row - 1, least, mask);
        }
    }
    fv_strongest_sort(&surf->strongest);
}

/* The determinants around a maximum again; false where the quadratic has its peak elsewhere. */
static bool refine(struct fv_surf *surf, const struct fv_kernels *kernels, uint32_t i,
                   struct fv_surf_point *point)
{
    const int32_t key = fv_strongest_x(&surf->strongest, i);
    const int32_t x = key & ((1 << X_BITS) - 1), y = fv_strongest_y(&surf->strongest, i);
    const int32_t found = key >> X_BITS, layer = found % LAYERS_FOUND + 1;
    const uint32_t octave = (uint32_t)(found / LAYERS_FOUND);
    const int32_t step = steps[octave], *side = sides[octave];
    double values[3][3][3], at[3];
    for (int32_t s = 0; s < 3; s++)
        for (int32_t r = 0; r < 3; r++) {
            float *row = row_of(surf, 0, 0);
            respond(surf, kernels, side[layer + s - 1], y + (r - 1) * step, step, x - step,
                    x + step + 1, row);
            for (int32_t c = 0; c < 3; c++)
                values[s][r][c] = (double)row[x / step + c - 1];
        }
    struct fv_quadratic q;
    fv_quadratic_fit(values, &q);
    if (!fv_quadratic_extreme(&q, at)) return false;
    for (int k = 0; k < 3; k++)
        if (!(at[k] > -REACH && at[k] < REACH)) return false;
    *point = (struct fv_surf_point){
        .x = x + at[0] * step,
        .y = y + at[1] * step,
        .sigma = 1.2 / 9 * (side[layer] + at[2] * (side[layer] - side[layer - 1])),
        .response = (float)values[1][1][1],
        .octave = octave,
    };
    return true;
}

uint32_t fv_surf_run(struct fv_surf *surf, const struct fv_kernels *kernels,
                     const struct fv_plane *image, const struct fv_plane *mask)
{
    uint32_t count = 0;
    fv_surf_integrate(surf, kernels, image);
    find(surf, kernels, image, mask);
    for (uint32_t i = 0; i < surf->strongest.count && count < surf->count_max; i++) {
        struct fv_surf_point point;
        if (!refine(surf, kernels, i, &point)) continue;
        const float angle = surf->upright ? 0 : fv_surf_orient(surf, &point);
        surf->features[count] = (struct fovea_local_feature){
            .x_px = (float)(surf->doubled ? point.x / 2 - .25 : point.x),
            .y_px = (float)(surf->doubled ? point.y / 2 - .25 : point.y),
            .size_px = (float)(surf->doubled ? point.sigma : 2 * point.sigma),
            .angle_rad = angle,
            .response = point.response,
            .level = point.octave,
        };
        fv_surf_describe(surf, &point, angle, surf->descriptors + (size_t)count * FV_SURF_BYTES);
        count++;
    }
    return count;
}
