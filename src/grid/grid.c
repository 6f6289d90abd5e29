/* The public calls of the grid (fovea/grid.h): each does its work in one piece. */
#include "fovea/grid.h"

#include "grid/grid.h"

struct fovea_grid {
    struct fv_grid grid;
};

void fovea_grid_config_default(struct fovea_grid_config *config)
{
    *config = (struct fovea_grid_config){.resolution_m = 0.1,
                                         .side_cells = 192,
                                         .range_m = 5,
                                         .rays = 360,
                                         .robot_radius_m = 0.2,
                                         .half_life_s = 60,
                                         .movable_half_life_s = 2,
                                         .floor_confidence = 0.9,
                                         .heights_max_m = 1.5};
}

static struct fovea_grid *carve(const struct fovea_grid_config *config, struct fv_arena *arena)
{
    struct fovea_grid counted, *made = fv_arena_take(arena, 1, sizeof *made);
    fv_grid_carve(made == NULL ? &counted.grid : &made->grid, config, arena);
    return made;
}

enum fovea_status fovea_grid_size(const struct fovea_grid_config *config, size_t *bytes,
                                  struct fovea_error *error)
{
    struct fv_arena arena;
    const enum fovea_status status = fv_grid_check(config, error);
    if (status != FOVEA_OK) return status;
    fv_arena_count(&arena);
    carve(config, &arena);
    *bytes = arena.used;
    return FOVEA_OK;
}

enum fovea_status fovea_grid_init(struct fovea_grid **grid, const struct fovea_grid_config *config,
                                  void *memory, size_t bytes, struct fovea_error *error)
{
    struct fv_arena arena;
    size_t needed;
    const enum fovea_status status = fovea_grid_size(config, &needed, error);
    if (status != FOVEA_OK) return status;
    if (bytes < needed || (uintptr_t)memory % FV_CACHE_LINE_BYTES != 0)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                               "grid: found %zu bytes, expected %zu at a multiple of %d", bytes,
                               needed, FV_CACHE_LINE_BYTES);
    fv_arena_init(&arena, memory, bytes);
    *grid = carve(config, &arena);
    return FOVEA_OK;
}

void fovea_grid_forget(struct fovea_grid *g)
{
    fv_grid_forget(&g->grid);
}

enum fovea_status fovea_grid_update(struct fovea_grid *g, const struct fovea_grid_view *view)
{
    if (!fv_grid_begin(&g->grid, view)) return FOVEA_ERROR_ARGUMENT;
    while (!fv_grid_advance(&g->grid, view))
        ;
    return FOVEA_OK;
}

void fovea_grid_cells(const struct fovea_grid *g, int8_t *cells, struct fovea_grid_place *place)
{
    *place = fv_grid_place(&g->grid);
    fv_grid_rows(&g->grid, 0, place->height, cells);
}

bool fovea_grid_heights(const struct fovea_grid *g, int16_t *heights_mm, uint8_t *counts,
                        struct fovea_grid_place *place)
{
    if (g->grid.heights == NULL) return false;
    *place = fv_grid_place(&g->grid);
    fv_grid_height_rows(&g->grid, 0, place->height, heights_mm, counts);
    return true;
}

void fovea_grid_scan(struct fovea_grid *g, float *ranges_m)
{
    fv_grid_scan_begin(&g->grid);
    while (!fv_grid_scan_advance(&g->grid, ranges_m))
        ;
}
