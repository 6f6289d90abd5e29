/* What may move, where floor was free: it counts at once, and so does what hides its foot below the
 * image. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/grid_mask.h"
#include "common/made_grid.h"

enum { W = 160, H = 120, SIDE = 128, CELLS = SIDE * SIDE };
static const double height = 0.8, tilt = 0.3, least = -2, hit = 0.85; /* log-odds */

static uint8_t mask[W * H];
static int8_t cells[CELLS];
static struct fovea_grid_place place;
static struct fovea_grid_view view;

static void make(double robot_radius_m)
{
    fovea_grid_config_default(&config);
    config.side_cells = SIDE;
    config.robot_radius_m = robot_radius_m;
    config.half_life_s = config.movable_half_life_s = 10000;
    make_grid();
}

static int setup(void **state)
{
    (void)state;
    make(0.2);
    grid_mask_make(mask, W, H, 2, 200);
    view = grid_mask_view(height, tilt);
    return 0;
}

/* How far ahead a row of the mask shows the floor. */
static double ahead_of(double row)
{
    const double down = (2 * row + 0.5 - camera.cy) / camera.fy;
    return height * (cos(tilt) - down * sin(tilt)) / (sin(tilt) + down * cos(tilt));
}

/* So many views of floor up to that row of the mask from below, and of this class above it. */
static void look(int views, int row, uint8_t beyond)
{
    memset(mask, beyond, (size_t)row * W);
    memset(mask + (size_t)row * W, FLOOR, (size_t)(H - row) * W);
    for (int i = 0; i < views; i++) {
        view.stamp_ns += 1000000;
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    }
    fovea_grid_cells(grid, cells, &place);
}

static int cell_at(double x)
{
    return grid_mask_cell(cells, &place, x, 0.05);
}

static int percent_of(double odds)
{
    return (int)(100 / (1 + exp(-odds)) + 0.5);
}

static double odds_of(int percent)
{
    return log(percent / (100.0 - percent));
}

/* One view is enough, as where nothing was known. What does not move takes four. */
static void what_comes_to_free_floor_is_there_at_once(void **state)
{
    const int row = 70;
    const double at = ahead_of(row - 0.5);
    (void)state;
    look(20, 40, WALL);
    assert_int_equal(cell_at(at), percent_of(least));
    look(1, row, CART);
    assert_int_equal(cell_at(at), percent_of(hit));
    look(1, row, CART);
    assert_int_equal(cell_at(at), percent_of(2 * hit));
    fovea_grid_forget(grid);
    look(20, 40, WALL);
    look(3, row, WALL);
    assert_false(is_occupied(cell_at(at)));
    look(1, row, WALL);
    assert_true(is_occupied(cell_at(at)));
}

/* Where it is not sure in which cell it stands, as much of what was known goes as the cell gets. */
static void what_is_uncertain_counts_in_part(void **state)
{
    const int row = 70;
    const double at = ahead_of(row - 0.5);
    double part = 1;
    (void)state;
    for (int k = 1; k <= 2; k++) {
        const double sigma = 0.02 * k;
        view.floor_covariance[5] = sigma * sigma;
        fovea_grid_forget(grid);
        look(1, row, CART);
        const double before = part;
        part = round(8 * odds_of(cell_at(at)) / hit) / 8;
        assert_true(part < before && part > 0);
        fovea_grid_forget(grid);
        view.floor_covariance[5] = 0;
        look(20, 40, WALL);
        view.floor_covariance[5] = sigma * sigma;
        look(1, row, CART);
        assert_int_equal(cell_at(at), percent_of(least * (1 - part) + hit * part));
    }
}

/* It reaches below the image: up to .3 m nearer there is as likely as not what it stands on, but
 * not where the robot is. What does not move would have been seen from farther away. */
static void a_hidden_foot_is_nearer_than_the_image(void **state)
{
    const double begin = ahead_of(H - 0.5);
    (void)state;
    look(1, H, CART);
    assert_int_equal(cell_at(begin + 0.05), percent_of(hit));
    for (int k = 3; k <= 5; k++)
        assert_in_range(cell_at(begin - 0.05 * k), percent_of(0.5 * hit),
                        percent_of(0.5 * hit) + 1);
    assert_int_equal(cell_at(begin - 0.36), FOVEA_GRID_UNKNOWN);
    fovea_grid_forget(grid);
    look(1, H, WALL);
    assert_int_equal(cell_at(begin - 0.2), FOVEA_GRID_UNKNOWN);
    fovea_grid_forget(grid);
    look(1, H - 6, CART); /* its foot is in the image */
    assert_int_equal(cell_at(begin - 0.2), FOVEA_GRID_UNKNOWN);
    make(begin - 0.15);
    look(3, H, CART);
    assert_true(is_free(cell_at(begin - 0.28)) && cell_at(begin - 0.08) > 50);
}

static int teardown(void **state)
{
    memset(&view, 0, sizeof view);
    return free_grid(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_comes_to_free_floor_is_there_at_once, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_uncertain_counts_in_part, setup, teardown),
        cmocka_unit_test_setup_teardown(a_hidden_foot_is_nearer_than_the_image, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
