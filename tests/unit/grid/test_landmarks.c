/* What points of surfaces add to the grid: two that stand in a cell, or in cells beside each other,
 * make it occupied though the mask shows floor; one does not, nor do those on the floor, far ones,
 * high ones, uncertain ones, and those of what may move. No point makes a cell free. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/grid_mask.h"
#include "common/made_grid.h"

enum { W = 80, H = 60, POINTS = 4, SIDE = 128, CELLS = SIDE * SIDE };
static const double height = 0.8, tilt = 0.3;
static const int64_t SECOND = 1000000000;

static uint8_t mask[W * H];
static int8_t cells[CELLS];
static struct fovea_grid_place place;

static int setup(void **state)
{
    (void)state;
    grid_mask_make(mask, W, H, 4, 200);
    fovea_grid_config_default(&config);
    config.side_cells = SIDE;
    config.heights = true;
    make_grid();
    return 0;
}

/* A camera over the origin that looks along x and down. */
static struct fovea_grid_view ahead(int class_id, int64_t stamp_ns,
                                    const struct fovea_grid_point *points, uint32_t count)
{
    memset(mask, class_id, sizeof mask);
    return (struct fovea_grid_view){
        .stamp_ns = stamp_ns,
        .seen = &seen,
        .labels = labels,
        .camera = &camera,
        .T_odom_cam = {0, -sin(tilt), cos(tilt), 0, -1, 0, 0, 0, 0, -cos(tilt), -sin(tilt), height},
        .points = points,
        .point_count = count};
}

/* Five views of the points, where the mask shows nothing but this class. */
static void look(int class_id, const struct fovea_grid_point *points, uint32_t count)
{
    fovea_grid_forget(grid);
    for (int i = 0; i < 5; i++) {
        const struct fovea_grid_view view = ahead(class_id, i * SECOND / 10, points, count);
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    }
    fovea_grid_cells(grid, cells, &place);
}

static int cell_at(double x, double y)
{
    return grid_mask_cell(cells, &place, x, y);
}

static int occupied(void)
{
    return grid_mask_occupied(cells, &place);
}

static struct fovea_grid_point at(double x, double y, double z)
{
    return (struct fovea_grid_point){{(float)x, (float)y, (float)z}, 0.01f, 0.005f};
}

static void two_points_of_a_wall_mark_its_cell(void **state)
{
    (void)state;
    const struct fovea_grid_point wall[2] = {at(2.02, 0.03, 0.4), at(2.02, 0.06, 0.6)};
    look(FLOOR, wall, 2);
    assert_true(is_occupied(cell_at(2.05, 0.05)));
    assert_int_equal(occupied(), 1);
    assert_true(is_free(cell_at(1.95, 0.05)) && is_free(cell_at(2.05, 0.15)));
    assert_true(is_free(cell_at(2.55, 0.05))); /* a mask shows floor behind it: it may be low */
    const struct fovea_grid_point beside[2] = {at(2.02, 0.03, 0.4), at(2.02, 0.13, 0.6)};
    look(FLOOR, beside, 2);
    assert_true(is_occupied(cell_at(2.05, 0.05)) && is_occupied(cell_at(2.05, 0.15)));
    assert_int_equal(occupied(), 2);
    look(FLOOR, NULL, 0);
    assert_int_equal(occupied(), 0);
}

static void one_point_marks_nothing(void **state)
{
    (void)state;
    const struct fovea_grid_point apart[3] = {at(2.02, 0.05, 0.5), at(2.02, 0.35, 0.5),
                                              at(2.42, 0.05, 0.5)};
    look(FLOOR, apart, 1);
    assert_true(is_free(cell_at(2.05, 0.05)));
    look(FLOOR, apart, 3);
    assert_int_equal(occupied(), 0);
}

/* A pair that differs from one that counts in one thing. */
static void what_is_not_surely_an_obstacle_marks_nothing(void **state)
{
    (void)state;
    const double z[] = {0, 0.04, 0.12, 0.95, 1.3};
    struct fovea_grid_point pair[2];
    for (size_t i = 0; i < sizeof z / sizeof *z; i++) {
        pair[0] = at(2.02, 0.03, z[i]);
        pair[1] = at(2.02, 0.06, z[i]);
        look(FLOOR, pair, 2);
        assert_int_equal(occupied(), 0);
        assert_true(is_free(cell_at(2.05, 0.05)));
    }
    pair[0] = at(2.02, 0.03, 0.4);
    pair[1] = at(2.02, 0.06, 0.4);
    look(FLOOR, pair, 2);
    assert_int_equal(occupied(), 1);
    pair[1].along_m = 0.06f; /* more than half a cell */
    look(FLOOR, pair, 2);
    assert_int_equal(occupied(), 0);
    pair[1] = at(2.02, 0.06, 0.4);
    pair[1].across_m = 0.12f; /* it may lie on the floor */
    look(FLOOR, pair, 2);
    assert_int_equal(occupied(), 0);
    pair[0] = at(5.02, 0.03, 0.4); /* out of range */
    pair[1] = at(5.02, 0.06, 0.4);
    look(FLOOR, pair, 2);
    assert_int_equal(occupied(), 0);
    pair[0] = at(NAN, 0.03, 0.4);
    pair[1] = at(2.02, 0.06, NAN);
    look(FLOOR, pair, 2);
    assert_int_equal(occupied(), 0);
}

/* The mask has what may move, and forgets it sooner; what is ignored may be the robot. */
static void points_of_what_moves_or_is_ignored_mark_nothing(void **state)
{
    (void)state;
    const struct fovea_grid_point wall[2] = {at(2.02, 0.03, 0.4), at(2.02, 0.06, 0.4)};
    look(SKY, wall, 2);
    assert_int_equal(occupied(), 0);
    look(CART, wall, 2);
    assert_false(is_occupied(cell_at(2.05, 0.05)));
}

static void points_make_no_cell_free(void **state)
{
    (void)state;
    struct fovea_grid_point floor[POINTS];
    for (int i = 0; i < POINTS; i++)
        floor[i] = at(2 + 0.02 * i, 0.05, 0);
    look(SKY, floor, POINTS);
    assert_int_equal(cell_at(2.05, 0.05), FOVEA_GRID_UNKNOWN);
}

/* 0.4 m below the floor and 3 m ahead: the sight passes the floor 2 m ahead. */
static void floor_that_ends_is_occupied(void **state)
{
    (void)state;
    const struct fovea_grid_point pit[2] = {at(3.06, 0.03, -0.4), at(3.06, 0.09, -0.4)};
    look(FLOOR, pit, 2);
    assert_int_equal(occupied(), 1);
    assert_true(is_occupied(cell_at(2.04, 0.04)));
    look(FLOOR, pit, 1);
    assert_int_equal(occupied(), 0);
    const struct fovea_grid_point slope[2] = {at(3.06, 0.03, -0.2), at(3.06, 0.09, -0.2)};
    look(FLOOR, slope, 2); /* as a ramp of 6 % */
    assert_int_equal(occupied(), 0);
}

static void what_points_said_is_forgotten_as_the_rest(void **state)
{
    (void)state;
    const struct fovea_grid_point wall[2] = {at(2.02, 0.03, 0.4), at(2.02, 0.06, 0.4)};
    look(FLOOR, wall, 2);
    struct fovea_grid_view view = ahead(SKY, 1000 * SECOND, NULL, 0);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    fovea_grid_cells(grid, cells, &place);
    assert_int_equal(occupied(), 0);
    look(FLOOR, wall, 2);
    fovea_grid_forget(grid);
    fovea_grid_cells(grid, cells, &place);
    for (int i = 0; i < CELLS; i++)
        assert_int_equal(cells[i], FOVEA_GRID_UNKNOWN);
    look(FLOOR, NULL, 0); /* no point of an earlier view counts as another one */
    look(FLOOR, wall, 1);
    assert_int_equal(occupied(), 0);
}

static void points_of_all_pieces_count_and_too_many_are_refused(void **state)
{
    (void)state;
    struct fovea_grid_point *many = calloc(FOVEA_GRID_POINTS_MAX + 1, sizeof *many);
    many[0] = at(2.02, 0.03, 0.4);
    many[FOVEA_GRID_POINTS_MAX - 1] = at(2.02, 0.06, 0.4);
    look(FLOOR, many, FOVEA_GRID_POINTS_MAX);
    assert_int_equal(occupied(), 1);
    struct fovea_grid_view view = ahead(FLOOR, SECOND, many, FOVEA_GRID_POINTS_MAX + 1);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_ERROR_ARGUMENT);
    view.points = NULL;
    view.point_count = 1;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_ERROR_ARGUMENT);
    free(many);
}

/* ---- heights --------------------------------------------------------------------------------- */

static int16_t heights[CELLS];
static uint8_t counts[CELLS];

static int height_at(double x, double y)
{
    assert_true(fovea_grid_heights(grid, heights, counts, &place));
    const int column = (int)floor((x - place.origin_m[0]) / place.resolution_m + 1e-9),
              row = (int)floor((y - place.origin_m[1]) / place.resolution_m + 1e-9);
    const int i = row * (int)place.width + column;
    assert_true((heights[i] == FOVEA_GRID_HEIGHT_UNKNOWN) == (counts[i] == 0));
    return heights[i];
}

/* One view. */
static void see(int class_id, int64_t stamp_ns, const struct fovea_grid_point *points,
                uint32_t count)
{
    const struct fovea_grid_view view = ahead(class_id, stamp_ns, points, count);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
}

static void a_height_is_the_highest_that_two_points_agree_on(void **state)
{
    (void)state;
    const struct fovea_grid_point low = at(2.02, 0.03, 0.3), high = at(2.02, 0.06, 0.61),
                                  higher = at(2.02, 0.04, 0.63), over = at(2.02, 0.05, 1.6);
    see(WALL, 0, &low, 1);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    see(WALL, 0, &low, 1);
    assert_int_equal(height_at(2.05, 0.05), 300);
    see(WALL, 0, &high, 1); /* one point may be wrong */
    assert_int_equal(height_at(2.05, 0.05), 300);
    see(WALL, 0, &higher, 1);
    assert_int_equal(height_at(2.05, 0.05), 620);
    for (int i = 0; i < 3; i++) {
        see(WALL, 0, &low, 1);
        see(WALL, 0, &over, 1); /* above heights_max_m */
    }
    assert_int_equal(height_at(2.05, 0.05), 620);
    assert_int_equal(height_at(2.15, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    const struct fovea_grid_point floor[2] = {at(1.52, 0.03, 0.01), at(1.52, 0.05, -0.01)};
    see(FLOOR, 0, floor, 2);
    assert_int_equal(height_at(1.55, 0.05), 0);
}

static void what_is_uncertain_or_moves_has_no_height(void **state)
{
    (void)state;
    struct fovea_grid_point pair[2] = {at(2.02, 0.03, 0.4), at(2.02, 0.06, 0.4)};
    look(CART, pair, 2);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    pair[0].along_m = pair[1].along_m = 0.06f;
    look(WALL, pair, 2);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    pair[0].along_m = pair[1].along_m = 0.01f;
    pair[0].across_m = pair[1].across_m = 0.06f;
    look(WALL, pair, 2);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    pair[0].across_m = pair[1].across_m = 0.01f;
    look(WALL, pair, 2);
    assert_int_equal(height_at(2.05, 0.05), 400);
}

static void heights_are_forgotten_as_cells_are(void **state)
{
    (void)state;
    const struct fovea_grid_point pair[2] = {at(2.02, 0.03, 0.4), at(2.02, 0.06, 0.4)};
    see(WALL, 0, pair, 2);
    see(SKY, 59 * SECOND, NULL, 0); /* of two points one is left after the half-life */
    assert_int_equal(height_at(2.05, 0.05), 400);
    see(SKY, 66 * SECOND, NULL, 0);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    look(WALL, pair, 2);
    fovea_grid_forget(grid);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    look(WALL, pair, 2);
    struct fovea_grid_view away = ahead(SKY, SECOND, NULL, 0);
    away.T_odom_cam[3] = away.position_m[0] = -6; /* the cell leaves the window, and comes back */
    assert_int_equal(fovea_grid_update(grid, &away), FOVEA_OK);
    see(SKY, SECOND, NULL, 0);
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
    look(WALL, pair, 2); /* ten points */
    for (int i = 0; i < 25; i++) {
        see(FLOOR, SECOND, NULL, 0); /* what stood there is gone */
        if (i == 10) assert_int_equal(height_at(2.05, 0.05), 400);
    }
    assert_int_equal(height_at(2.05, 0.05), FOVEA_GRID_HEIGHT_UNKNOWN);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, free_grid)
    const struct CMUnitTest tests[] = {
        TEST(two_points_of_a_wall_mark_its_cell),
        TEST(one_point_marks_nothing),
        TEST(what_is_not_surely_an_obstacle_marks_nothing),
        TEST(points_of_what_moves_or_is_ignored_mark_nothing),
        TEST(points_make_no_cell_free),
        TEST(floor_that_ends_is_occupied),
        TEST(what_points_said_is_forgotten_as_the_rest),
        TEST(a_height_is_the_highest_that_two_points_agree_on),
        TEST(what_is_uncertain_or_moves_has_no_height),
        TEST(heights_are_forgotten_as_cells_are),
        TEST(points_of_all_pieces_count_and_too_many_are_refused),
    };
#undef TEST
    return cmocka_run_group_tests(tests, NULL, NULL);
}
