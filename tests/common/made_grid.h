/* For tests of the grid: one grid at a time, made as `config` says, in memory that was something
 * else. */
#ifndef FOVEA_TESTS_COMMON_MADE_GRID_H
#define FOVEA_TESTS_COMMON_MADE_GRID_H

#include <stdlib.h>
#include <string.h>

#include "fovea/grid.h"

static struct fovea_grid_config config;
static struct fovea_grid *grid;
static void *grid_memory;

/* Instead of the last one. */
static inline void make_grid(void)
{
    struct fovea_error error;
    size_t bytes;
    free(grid_memory);
    assert_int_equal(fovea_grid_size(&config, &bytes, &error), FOVEA_OK);
    grid_memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    memset(grid_memory, 0x5a, bytes);
    assert_int_equal(fovea_grid_init(&grid, &config, grid_memory, bytes, &error), FOVEA_OK);
}

/* A teardown of cmocka. */
static inline int free_grid(void **state)
{
    (void)state;
    free(grid_memory);
    grid_memory = NULL;
    return 0;
}

#endif
