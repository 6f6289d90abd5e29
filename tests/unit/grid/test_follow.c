/* The grid follows the robot: cells that stay in it keep all that they hold, those that come in are
 * unknown, however far it goes and wherever they are kept; and it stands on the cells of the grid
 * that its radius reaches. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/grid_mask.h"
#include "common/made_grid.h"
#include "grid/cells.h"

enum { W = 16, H = 12, SIDE = 16 };

static uint8_t mask[W * H];

static void make(double robot_radius_m)
{
    fovea_grid_config_default(&config);
    config.side_cells = SIDE;
    config.range_m = 0.5;
    config.robot_radius_m = robot_radius_m;
    config.heights = true;
    make_grid();
    grid_mask_make(mask, W, H, 1, 20);
    memset(mask, SKY, sizeof mask);
}

/* The robot a third into cell (x, y), where a mask shows nothing; no time has passed. */
static struct fv_grid *go(int64_t x, int64_t y)
{
    const double at[2] = {((double)x + 0.3) * config.resolution_m,
                          ((double)y + 0.3) * config.resolution_m};
    const struct fovea_grid_view view = {
        .stamp_ns = 1,
        .seen = &seen,
        .labels = labels,
        .camera = &camera,
        .T_odom_cam = {0, 0, 1, at[0], -1, 0, 0, at[1], 0, -1, 0, 0.8},
        .position_m = {at[0], at[1]}};
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    return (struct fv_grid *)(void *)grid; /* its first member */
}

/* Every cell by where it is in the odometry frame. */
static int16_t odds_of(int64_t x, int64_t y)
{
    return (int16_t)(500 + (31 * x + 17 * y) % 100);
}

static void fill(struct fv_grid *g, int64_t x0, int64_t y0)
{
    for (int64_t y = y0; y < y0 + SIDE; y++)
        for (int64_t x = x0; x < x0 + SIDE; x++) {
            const int64_t at = fv_grid_place_of(g, x, y);
            assert_true(at >= 0 && at < SIDE * SIDE);
            g->odds[at] = odds_of(x, y);
            g->movable[at] = 1;
            g->heights[at].top = (uint16_t)(1000 + odds_of(x, y));
        }
}

static void cells_stay_or_are_unknown(void **state)
{
    static const int ways[][2] = {{3, 0},     {0, 5},  {-4, -7}, {15, 1},    {-1, 15},
                                  {-15, -15}, {16, 0}, {2, -16}, {17, 3},    {-40, 40},
                                  {1, 100},   {-5, 0}, {7, 11},  {-2000, 2}, {0, 0}};
    int64_t x = -9, y = 21;
    (void)state;
    make(0);
    struct fv_grid *g = go(x, y);
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        const int64_t old_x = x - SIDE / 2, old_y = y - SIDE / 2;
        int stayed = 0;
        fill(g, old_x, old_y);
        x += ways[i][0];
        y += ways[i][1];
        g = go(x, y);
        for (int64_t row = y - SIDE / 2; row < y + SIDE / 2; row++)
            for (int64_t column = x - SIDE / 2; column < x + SIDE / 2; column++) {
                const int64_t at = fv_grid_place_of(g, column, row);
                const bool stays =
                    column >= old_x && column < old_x + SIDE && row >= old_y && row < old_y + SIDE;
                const int odds = stays ? odds_of(column, row) : 0;
                assert_true(at >= 0);
                assert_int_equal(g->odds[at], odds);
                assert_int_equal(g->movable[at], stays);
                assert_int_equal(g->heights[at].top, stays ? 1000 + odds : 0);
                stayed += stays;
            }
        const int left[2] = {SIDE - abs(ways[i][0]), SIDE - abs(ways[i][1])};
        assert_int_equal(stayed, left[0] > 0 && left[1] > 0 ? left[0] * left[1] : 0);
    }
}

/* Also where that is all of them, and more. */
static void it_stands_on_cells_of_the_grid(void **state)
{
    static const double radii_m[] = {0, 0.25, 0.7, 10};
    (void)state;
    for (size_t i = 0; i < sizeof radii_m / sizeof radii_m[0]; i++) {
        make(radii_m[i]);
        const struct fv_grid *g = go(-9, 21);
        int stood = 0;
        for (int64_t y = 21 - SIDE / 2; y < 21 + SIDE / 2; y++)
            for (int64_t x = -9 - SIDE / 2; x < -9 + SIDE / 2; x++) {
                const double dx = ((double)x + 9 + 0.2) * config.resolution_m,
                             dy = ((double)y - 21 + 0.2) * config.resolution_m;
                const bool within = dx * dx + dy * dy <= radii_m[i] * radii_m[i];
                assert_int_equal(g->odds[fv_grid_place_of(g, x, y)], within ? FV_GRID_MISS : 0);
                stood += within;
            }
        assert_true(i == 0 ? stood == 0 : i == 3 ? stood == SIDE * SIDE : stood > 15);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(cells_stay_or_are_unknown, free_grid),
        cmocka_unit_test_teardown(it_stands_on_cells_of_the_grid, free_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
