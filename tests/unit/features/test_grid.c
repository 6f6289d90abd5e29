/* The grid: a window query finds exactly what a search over all points finds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "features/grid.h"
#include "fovea/elementary.h"

enum { WIDTH = 333, HEIGHT = 217, COUNT = 700 };

static void carve(void *grid, struct fv_arena *arena)
{
    fv_grid_carve(grid, WIDTH, HEIGHT, COUNT, arena);
}

static void query_equals_exhaustive_search(void **state)
{
    (void)state;
    struct fovea_random random;
    fovea_random_seed(&random, 9);
    struct fv_grid grid;
    void *memory = carved(carve, &grid);

    struct fv_grid_point points[COUNT];
    memset(points, 0, sizeof points);
    for (uint16_t i = 0; i < COUNT; i++) {
        points[i].x_px = (float)(fovea_random_unit(&random) * (WIDTH + 20) - 10); /* some outside */
        points[i].y_px = (float)(fovea_random_unit(&random) * (HEIGHT + 20) - 10);
        points[i].level = (uint8_t)fovea_random_below(&random, 8);
        points[i].index = i;
    }
    fv_grid_build(&grid, points, COUNT);
    for (int trial = 0; trial < 2000; trial++) {
        const float x = (float)(fovea_random_unit(&random) * (WIDTH + 60) - 30);
        const float y = (float)(fovea_random_unit(&random) * (HEIGHT + 60) - 30);
        const float radius = (float)(fovea_random_unit(&random) * 40);
        const int low = (int)fovea_random_below(&random, 8),
                  high = low + (int)fovea_random_below(&random, 3);
        uint16_t found[COUNT];
        uint8_t is_found[COUNT] = {0};
        const uint32_t count = fv_grid_query(&grid, x, y, radius, low, high, found, COUNT);
        for (uint32_t k = 0; k < count; k++) {
            assert_int_equal(is_found[found[k]], 0);
            is_found[found[k]] = 1;
        }
        for (int i = 0; i < COUNT; i++) {
            const float dx = points[i].x_px - x, dy = points[i].y_px - y;
            const int inside = dx <= radius && dx >= -radius && dy <= radius && dy >= -radius &&
                               points[i].level >= low && points[i].level <= high;
            assert_int_equal(is_found[i], inside);
        }
        assert_true(fv_grid_query(&grid, x, y, radius, low, high, found, 3) <= 3);
    }
    free(memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(query_equals_exhaustive_search)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
