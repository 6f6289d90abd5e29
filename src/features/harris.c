#include "features/harris.h"

#include <string.h>

#include "base/float_bits.h"

enum { MORE_FOR_DISTANCE = 4 }; /* times count_max corners are looked at */

void fv_harris_carve(struct fv_harris *harris, const struct fovea_extract_config *config,
                     int32_t width, int32_t height, int32_t border, struct fv_arena *arena)
{
    const size_t across = (size_t)width;
    harris->width = width;
    harris->height = height;
    harris->border = border;
    harris->k = config->method == FOVEA_FEATURES_HARRIS ? config->harris_k : -1;
    harris->quality = config->quality;
    harris->distance_px = config->distance_px;
    harris->count_max = config->count_max;
    uint32_t room = config->count_max;
    if (config->distance_px > 0) {
        const int32_t side = (int32_t)config->distance_px + 1;
        room *= MORE_FOR_DISTANCE;
        harris->columns = width / side + 1;
        harris->rows = height / side + 1;
        harris->cell = fv_arena_take(arena, (size_t)harris->columns * (size_t)harris->rows,
                                     sizeof *harris->cell);
        harris->next = fv_arena_take(arena, harris->count_max, sizeof *harris->next);
    }
    fv_strongest_carve(&harris->strongest, room, arena);
    harris->response = fv_arena_take(arena, across * (size_t)height, sizeof *harris->response);
    for (int i = 0; i < 3; i++) {
        harris->dx[i] = fv_arena_take(arena, across, sizeof *harris->dx[i]);
        harris->dy[i] = fv_arena_take(arena, across, sizeof *harris->dy[i]);
    }
    harris->row = fv_arena_take(arena, 3 * across, sizeof *harris->row);
    harris->corners = fv_arena_take(arena, harris->count_max, sizeof *harris->corners);
}

static int32_t *response_row(const struct fv_harris *harris, int32_t y)
{
    return harris->response + (int64_t)y * harris->width;
}

static void derive(const struct fv_harris *harris, const struct fv_kernels *kernels,
                   const struct fv_plane *image, int32_t y)
{
    const uint8_t *rows[3] = {fv_plane_row(image, y - 1), fv_plane_row(image, y),
                              fv_plane_row(image, y + 1)};
    kernels->derivative_x_row_s16(harris->dx[y % 3], rows, image->width, 1, 2, 0);
    kernels->derivative_y_row_s16(harris->dy[y % 3], rows, image->width, 1, 2, 0);
}

/* Responses of all rows that may hold corners, and one more on either side; returns the largest. */
static int32_t respond(struct fv_harris *harris, const struct fv_kernels *kernels,
                       const struct fv_plane *image)
{
    const int32_t first = harris->border - 1, end = harris->height - harris->border + 1;
    int32_t most = 0;
    for (int32_t y = first - 1; y < first + 1; y++)
        derive(harris, kernels, image, y);
    for (int32_t y = first; y < end; y++) {
        derive(harris, kernels, image, y + 1);
        const int32_t a = (y + 2) % 3, b = y % 3, c = (y + 1) % 3;
        const int16_t *dx[3] = {harris->dx[a], harris->dx[b], harris->dx[c]};
        const int16_t *dy[3] = {harris->dy[a], harris->dy[b], harris->dy[c]};
        most = kernels->response_row_f32(response_row(harris, y), dx, dy, harris->width, harris->k,
                                         harris->row, most);
    }
    return most;
}

static void search_row(struct fv_harris *harris, const struct fv_kernels *kernels, int32_t y,
                       int32_t threshold, const struct fv_plane *mask)
{
    const int32_t *rows[3] = {response_row(harris, y - 1), response_row(harris, y),
                              response_row(harris, y + 1)};
    const int32_t end = harris->width - harris->border;
    int32_t *marks = harris->row;
    kernels->response_peaks_row_s32(marks, rows, harris->width, threshold, marks + harris->width);
    for (int32_t x = harris->border; x < end; x++) {
        uint64_t two;
        memcpy(&two, marks + x, sizeof two); /* one more may be read: the border follows */
        if (two == 0) {
            x++;
            continue;
        }
        if (marks[x] != 0 && (mask->pixels == NULL || fv_plane_row(mask, y)[x] != 0))
            fv_strongest_offer(&harris->strongest, (uint32_t)rows[1][x], x, y);
    }
}

/* Place of the maximum of a parabola through three values, from the middle one. */
static float parabola(float before, float at, float after)
{
    const float bend = before - 2 * at + after;
    return bend < 0 ? .5f * (before - after) / bend : 0;
}

static struct fv_harris_corner corner_of(const struct fv_harris *harris, uint32_t i)
{
    const int32_t x = fv_strongest_x(&harris->strongest, i);
    const int32_t y = fv_strongest_y(&harris->strongest, i);
    const int32_t *row = response_row(harris, y);
    const float at = fv_float_of_bits(row[x]);
    /* Sobel derivatives are 8 per grey level and pixel, their products are summed over 9 pixels. */
    const float scale = harris->k < 0 ? 1.f / (2 * 64 * 9) : 1.f / (64.f * 9 * 64 * 9);
    return (struct fv_harris_corner){
        .x = (uint16_t)x,
        .y = (uint16_t)y,
        .x_px = (float)x + parabola(fv_float_of_bits(row[x - 1]), at, fv_float_of_bits(row[x + 1])),
        .y_px = (float)y + parabola(fv_float_of_bits(response_row(harris, y - 1)[x]), at,
                                    fv_float_of_bits(response_row(harris, y + 1)[x])),
        .response = at * scale,
    };
}

/* Whether a corner taken before is nearer than the distance. */
static bool crowded(const struct fv_harris *harris, const struct fv_harris_corner *corner,
                    int32_t column, int32_t row)
{
    const float limit = harris->distance_px * harris->distance_px;
    for (int32_t r = row > 0 ? row - 1 : 0; r <= row + 1 && r < harris->rows; r++)
        for (int32_t c = column > 0 ? column - 1 : 0; c <= column + 1 && c < harris->columns; c++)
            for (uint32_t i = harris->cell[r * harris->columns + c]; i > 0;
                 i = harris->next[i - 1]) {
                const int32_t dx = harris->corners[i - 1].x - corner->x;
                const int32_t dy = harris->corners[i - 1].y - corner->y;
                if ((float)(dx * dx + dy * dy) < limit) return true;
            }
    return false;
}

static uint32_t take(struct fv_harris *harris)
{
    const bool apart = harris->distance_px > 0;
    const int32_t side = (int32_t)harris->distance_px + 1;
    uint32_t count = 0;
    if (apart)
        memset(harris->cell, 0,
               (size_t)harris->columns * (size_t)harris->rows * sizeof *harris->cell);
    for (uint32_t i = 0; i < harris->strongest.count && count < harris->count_max; i++) {
        const struct fv_harris_corner corner = corner_of(harris, i);
        if (apart) {
            const int32_t column = corner.x / side, row = corner.y / side;
            uint32_t *cell = &harris->cell[row * harris->columns + column];
            if (crowded(harris, &corner, column, row)) continue;
            harris->next[count] = *cell;
            *cell = count + 1;
        }
        harris->corners[count++] = corner;
    }
    return count;
}

uint32_t fv_harris_find(struct fv_harris *harris, const struct fv_kernels *kernels,
                        const struct fv_plane *image, const struct fv_plane *mask)
{
    const int32_t most = respond(harris, kernels, image);
    const int32_t threshold = fv_float_bits(harris->quality * fv_float_of_bits(most));
    fv_strongest_begin(&harris->strongest);
    for (int32_t y = harris->border; y < harris->height - harris->border; y++)
        search_row(harris, kernels, y, threshold, mask);
    fv_strongest_sort(&harris->strongest);
    return take(harris);
}
