#include "app/run/grid_file.h"

#include <stdlib.h>
#include <string.h>

#include "support/picture.h"

enum { GREY_FREE = 254, GREY_OCCUPIED = 0, GREY_UNKNOWN = 205 };

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
        const struct fovea_image image = {.data = pixels,
                                          .width = (int32_t)side,
                                          .height = (int32_t)side,
                                          .stride_bytes = (int32_t)side,
                                          .format = FOVEA_PIXEL_GREY8,
                                          .size_bytes = side * side};
        if (path != NULL) status = fv_picture_write(path, &image, error);
    }
    free(cells);
    free(pixels);
    return status;
}
