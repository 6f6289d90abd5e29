/* Grid: which key points lie in a window of the image.
 *
 * Key points are sorted into square cells of FV_GRID_CELL_PX once per frame (counting sort, stable:
 * within a cell they keep their order); a query visits the cells that its window touches. */
#ifndef FOVEA_FEATURES_GRID_H
#define FOVEA_FEATURES_GRID_H

#include <stdint.h>

#include "base/arena.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_GRID_CELL_PX = 24 };

/* What a window search needs of a key point. */
struct fv_grid_point {
    float x_px, y_px; /* raw image */
    uint16_t index;   /* among the key points */
    uint8_t level, reserved;
};

struct fv_grid {
    int32_t columns, rows;
    uint32_t count_max;
    uint16_t *start;              /* columns * rows + 1: first point of each cell */
    struct fv_grid_point *points; /* sorted by cell */
};

/* Take memory for `count_max` (at most 65535) points in an image of width x height. Sets sizes and
 * addresses only. */
void fv_grid_carve(struct fv_grid *grid, int32_t width, int32_t height, uint32_t count_max,
                   struct fv_arena *arena);

/* Sort `count` points, in any order, given by their places and levels as an array of points whose
 * index is set. Places outside the image go to the nearest cell. Real-time safe. */
void fv_grid_build(struct fv_grid *grid, const struct fv_grid_point *points, uint32_t count);

/* Indices of points with |x - x_px| <= radius, |y - y_px| <= radius and level_min <= level <=
 * level_max, at most `indices_max`, in cell order. Returns how many. Real-time safe; cost: the
 * points of the cells touched. */
uint32_t fv_grid_query(const struct fv_grid *grid, float x_px, float y_px, float radius_px,
                       int level_min, int level_max, uint16_t *indices, uint32_t indices_max);

#ifdef __cplusplus
}
#endif
#endif
