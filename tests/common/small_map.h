/* A small made-up map, and whether a map is whole. For tests and fuzzers. */
#ifndef FOVEA_TESTS_COMMON_SMALL_MAP_H
#define FOVEA_TESTS_COMMON_SMALL_MAP_H

#include "base/elementary.h"
#include "map/archive.h"

struct small_map {
    struct fovea_camera camera;
    struct fv_bearing_table bearings;
    struct fv_map map;
    void *memory;
    bool measured; /* its features may have distances; none has one yet */
};

enum { SMALL_MAP_KEYFRAMES = 10, SMALL_MAP_LANDMARKS = 400, SMALL_MAP_FEATURES = 120 };

/* Empty pools for a camera of 320 x 240 pixels. */
void small_map_make(struct small_map *small);
void small_map_make_measured(struct small_map *small);
void small_map_free(struct small_map *small);
/* One more keyframe with features, some of which see landmarks of earlier ones and some new ones.
 */
void small_map_grow(struct small_map *small, struct fv_random *random);
/* The map as sealed bytes from malloc. */
uint8_t *small_map_save(const struct small_map *small, size_t *bytes);
/* The same with a grid; its cells are written `piece` at a time. */
uint8_t *small_map_save_with(const struct small_map *small, const struct fv_archive_grid *grid,
                             const int8_t *cells, uint32_t piece, size_t *bytes);
/* A made-up grid of the current map and its side x side cells. */
struct fv_archive_grid small_map_grid(const struct small_map *small, uint32_t side,
                                      struct fv_random *random, int8_t *cells);
/* NULL when links, counts and lists agree; else what does not. */
const char *small_map_trouble(const struct fv_map *map);

#endif
