#include "app/run/grid_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/picture.h"

enum { GREY_FREE = 254, GREY_OCCUPIED = 0, GREY_UNKNOWN = 205 };
enum { GREY_NO_HEIGHT = 0, GREY_FLOOR = 64, GREY_HIGH = 255, GREY_LOW = 1 };

static enum fovea_status write_square(const char *path, const uint8_t *pixels, size_t side,
                                      struct fovea_error *error)
{
    const struct fovea_image image = {.data = pixels,
                                      .width = (int32_t)side,
                                      .height = (int32_t)side,
                                      .stride_bytes = (int32_t)side,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = side * side};
    return fv_picture_write(path, &image, error);
}

static uint8_t grey_of(int8_t percent, struct fv_grid_counts *counts)
{
    if (percent != FOVEA_GRID_UNKNOWN && percent < 100 * FOVEA_GRID_FREE_BELOW) {
        counts->free++;
        return GREY_FREE;
    }
    if (percent > 100 * FOVEA_GRID_OCCUPIED_ABOVE) {
        counts->occupied++;
        return GREY_OCCUPIED;
    }
    return GREY_UNKNOWN;
}

enum fovea_status fv_grid_file_write(const char *path, const struct fovea *rt, uint32_t side_cells,
                                     struct fv_grid_counts *counts, struct fovea_error *error)
{
    const size_t side = side_cells;
    struct fovea_grid_place place;
    int8_t *cells = malloc(side * side);
    uint8_t *pixels = malloc(side * side);
    enum fovea_status status = FOVEA_OK;
    memset(counts, 0, sizeof *counts);
    if (cells == NULL || pixels == NULL) {
        status = fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for the grid",
                                 path != NULL ? path : "grid");
    } else {
        if (!fovea_free_space_get(rt, cells, &place))
            memset(cells, FOVEA_GRID_UNKNOWN, side * side);
        for (size_t y = 0; y < side; y++)
            for (size_t x = 0; x < side; x++)
                pixels[(side - 1 - y) * side + x] = grey_of(cells[y * side + x], counts);
        if (path != NULL) status = write_square(path, pixels, side, error);
    }
    free(cells);
    free(pixels);
    return status;
}

/* ---- heights --------------------------------------------------------------------------------- */

static uint8_t grey_of_height(int32_t height_mm, int32_t most_mm)
{
    if (height_mm == FOVEA_GRID_HEIGHT_UNKNOWN) return GREY_NO_HEIGHT;
    const int32_t range = height_mm < 0 ? GREY_FLOOR - GREY_LOW : GREY_HIGH - GREY_FLOOR;
    return (uint8_t)(GREY_FLOOR + range * height_mm / most_mm);
}

bool fv_grid_file_heights(const char *path, char heights[FV_GRID_FILE_PATH_BYTES])
{
    const char *dot = strrchr(path, '.'), *slash = strrchr(path, '/');
    const int stem =
        (int)(dot != NULL && (slash == NULL || dot > slash) ? (size_t)(dot - path) : strlen(path));
    const int length =
        snprintf(heights, FV_GRID_FILE_PATH_BYTES, "%.*s-heights%s", stem, path, path + stem);
    return length > 0 && length < FV_GRID_FILE_PATH_BYTES;
}

enum fovea_status fv_grid_file_write_heights(const char *path, const struct fovea *rt,
                                             const struct fovea_grid_config *config,
                                             struct fovea_error *error)
{
    const size_t side = config->side_cells;
    const int32_t most_mm = (int32_t)(config->heights_max_m * 1000 + 0.5);
    char name[FV_GRID_FILE_PATH_BYTES];
    struct fovea_grid_place place;
    if (!config->heights) return FOVEA_OK;
    if (!fv_grid_file_heights(path, name))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: too long a path", path);
    int16_t *heights = malloc(side * side * sizeof *heights);
    uint8_t *pixels = malloc(side * side);
    enum fovea_status status;
    if (heights == NULL || pixels == NULL) {
        status = fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for heights", name);
    } else {
        const bool known = fovea_free_space_heights(rt, heights, NULL, &place);
        for (size_t y = 0; y < side; y++)
            for (size_t x = 0; x < side; x++)
                pixels[(side - 1 - y) * side + x] = grey_of_height(
                    known ? heights[y * side + x] : FOVEA_GRID_HEIGHT_UNKNOWN, most_mm);
        status = write_square(name, pixels, side, error);
    }
    free(heights);
    free(pixels);
    return status;
}
