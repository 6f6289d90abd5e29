#include "features/grid.h"

#include <string.h>

void fv_grid_carve(struct fv_grid *grid, int32_t width, int32_t height, uint32_t count_max,
                   struct fv_arena *arena)
{
    grid->columns = (width + FV_GRID_CELL_PX - 1) / FV_GRID_CELL_PX;
    grid->rows = (height + FV_GRID_CELL_PX - 1) / FV_GRID_CELL_PX;
    grid->count_max = count_max;
    grid->start =
        fv_arena_take(arena, (size_t)grid->columns * (size_t)grid->rows + 2, sizeof *grid->start);
    grid->points = fv_arena_take(arena, count_max, sizeof *grid->points);
}

static int32_t cell_along(float place_px, int32_t cells)
{
    if (!(place_px > 0)) return 0;
    const float limit = (float)(cells * FV_GRID_CELL_PX - 1);
    return (int32_t)(place_px < limit ? place_px : limit) / FV_GRID_CELL_PX;
}

static int32_t cell_of(const struct fv_grid *grid, float x_px, float y_px)
{
    return cell_along(y_px, grid->rows) * grid->columns + cell_along(x_px, grid->columns);
}

void fv_grid_build(struct fv_grid *grid, const struct fv_grid_point *points, uint32_t count)
{
    const int32_t cells = grid->columns * grid->rows;
    if (count > grid->count_max) count = grid->count_max;
    /* start[c + 1] counts, then holds where cell c goes on; after placing it is where cell c + 1
     * starts. */
    memset(grid->start, 0, ((size_t)cells + 2) * sizeof *grid->start);
    for (uint32_t i = 0; i < count; i++)
        grid->start[cell_of(grid, points[i].x_px, points[i].y_px) + 2]++;
    for (int32_t c = 2; c <= cells + 1; c++)
        grid->start[c] = (uint16_t)(grid->start[c] + grid->start[c - 1]);
    for (uint32_t i = 0; i < count; i++) {
        grid->points[grid->start[cell_of(grid, points[i].x_px, points[i].y_px) + 1]++] = points[i];
    }
}

uint32_t fv_grid_query(const struct fv_grid *grid, float x_px, float y_px, float radius_px,
                       int level_min, int level_max, uint16_t *indices, uint32_t indices_max)
{
    const int32_t column_first = cell_along(x_px - radius_px, grid->columns);
    const int32_t column_last = cell_along(x_px + radius_px, grid->columns);
    const int32_t row_first = cell_along(y_px - radius_px, grid->rows);
    const int32_t row_last = cell_along(y_px + radius_px, grid->rows);
    uint32_t found = 0;
    for (int32_t row = row_first; row <= row_last; row++) {
        /* Cells of a row follow each other, so their points do. */
        const uint32_t first = grid->start[row * grid->columns + column_first];
        const uint32_t last = grid->start[row * grid->columns + column_last + 1];
        for (uint32_t i = first; i < last; i++) {
            const struct fv_grid_point *point = &grid->points[i];
            const float dx = point->x_px - x_px, dy = point->y_px - y_px;
            if (dx > radius_px || dx < -radius_px || dy > radius_px || dy < -radius_px) continue;
            if (point->level < level_min || point->level > level_max) continue;
            if (found == indices_max) return found;
            indices[found++] = point->index;
        }
    }
    return found;
}
