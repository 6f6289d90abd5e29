/* Floor that ends where the mask shows what is never floor: the cell at its end is an obstacle,
 * with the care that roughness of masks, far floor and what is ignored ask for. */
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

enum { W = 160, H = 120, SIDE = 128, CELLS = SIDE * SIDE, SURE = 254, UNSURE = 200 };
static const double height = 0.8, tilt = 0.3;

static uint8_t mask[W * H], confidence[W * H];
static int8_t cells[CELLS];
static struct fovea_grid_place place;
static struct fovea_grid_view view;

static int setup(void **state)
{
    (void)state;
    fovea_grid_config_default(&config);
    config.side_cells = SIDE;
    make_grid();
    grid_mask_make(mask, W, H, 2, 200);
    memset(confidence, SURE, sizeof confidence);
    view = grid_mask_view(height, tilt);
    return 0;
}

/* Floor up to a line across the way, and behind it this class, as far as it goes. */
static void draw(double end_m, uint8_t beyond)
{
    const double *T = view.T_odom_cam;
    for (int i = 0; i < W * H; i++) {
        const double pixel[2] = {2 * (i % W) + 0.5, 2 * (i / W) + 0.5};
        double b[3];
        assert_int_equal(fovea_camera_unproject(&camera, pixel, b, NULL), FOVEA_OK);
        const double x = T[0] * b[0] + T[1] * b[1] + T[2] * b[2],
                     z = T[8] * b[0] + T[9] * b[1] + T[10] * b[2];
        mask[i] = z < 0 && x * height / -z < end_m ? FLOOR : beyond;
    }
}

/* Row of the mask that shows the floor so far ahead. */
static int row_of(double x)
{
    const double p[3] = {0, cos(tilt) * height - sin(tilt) * x, sin(tilt) * height + cos(tilt) * x};
    double pixel[2];
    assert_int_equal(fovea_camera_project(&camera, p, pixel, NULL), FOVEA_OK);
    return (int)((pixel[1] - seen.raw_offset[1]) / seen.raw_scale[1] + 0.5);
}

static void rows(uint8_t *of, int first, int count, uint8_t value)
{
    assert_true(first >= 0 && first + count <= H);
    memset(of + (ptrdiff_t)first * W, value, (size_t)(count * W));
}

/* So many views of what is drawn. */
static void look(int views)
{
    fovea_grid_forget(grid);
    for (int i = 0; i < views; i++) {
        view.stamp_ns = i * INT64_C(100000000);
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

/* Wherever the edge lies to the cells: it is occupied, the floor before it is free, and nothing is
 * known behind. Where the class behind it is ignored nothing is occupied. */
static void floor_that_ends_is_an_obstacle(void **state)
{
    (void)state;
    for (double end = 1.3; end < 2.6; end += 0.07) {
        draw(end, AIR);
        look(5);
        for (double y = -0.35; y < 0.4; y += 0.1) {
            assert_true(is_occupied(cell_at(end, y)) || is_occupied(cell_at(end + 0.06, y)) ||
                        is_occupied(cell_at(end - 0.06, y)));
            assert_true(is_free(cell_at(end - 0.25, y)));
            assert_int_equal(cell_at(end + 0.25, y), FOVEA_GRID_UNKNOWN);
        }
        float ranges[360];
        fovea_grid_scan(grid, ranges);
        assert_true(fabs((double)ranges[0] - end) < 0.16);
        draw(end, SKY);
        look(5);
        assert_int_equal(occupied(), 0);
    }
}

/* Near enough, where a pixel of the mask is small against a cell, one view says what one of an
 * obstacle says. */
static void near_ends_count_as_obstacles_do(void **state)
{
    static int8_t of_wall[CELLS];
    (void)state;
    draw(1.32, WALL);
    look(1);
    memcpy(of_wall, cells, sizeof cells);
    assert_int_equal(cell_at(1.35, 0.05), 70);
    draw(1.32, AIR);
    look(1);
    for (int i = 0; i < CELLS; i++) {
        const double x = place.origin_m[0] + (i % SIDE + 0.5) * 0.1,
                     y = place.origin_m[1] + ((int)(i / SIDE) + 0.5) * 0.1;
        if (fabs(x) < 1.5 && fabs(y) < 0.4) assert_int_equal(cells[i], of_wall[i]);
    }
}

/* A pixel of the mask spans r^2 / (H f) on the floor: .36 m at 4.8 m, of which a cell has 1 eighth.
 */
static void far_ends_count_in_parts(void **state)
{
    (void)state;
    draw(4.8, AIR);
    look(1);
    int most = 0;
    for (double x = 4.35; x < 5; x += 0.1)
        most = cell_at(x, 0.05) > most ? cell_at(x, 0.05) : most;
    assert_in_range(most, 52, 54);
    look(8);
    assert_true(occupied() > 0);
    draw(4.8, WALL);
    look(1);
    assert_true(occupied() > 0);
}

/* Cells of a metre, to 60 m: the horizon of floor without an end is none, though the network is
 * wrong about it by two pixels. */
static void a_horizon_is_no_end(void **state)
{
    (void)state;
    config.resolution_m = 1;
    config.range_m = 60;
    make_grid();
    draw(1e6, AIR);
    int horizon = 0;
    while (mask[horizon * W + W / 2] == AIR)
        horizon++;
    rows(mask, horizon, 2, AIR);
    look(50);
    assert_int_equal(occupied(), 0);
    assert_true(is_free(cell_at(20.5, 0.5)));
    draw(9.5, AIR);
    look(10);
    assert_true(is_occupied(cell_at(9.5, 0.5)) || is_occupied(cell_at(10.5, 0.5)));
}

static void rays_that_begin_beyond_say_nothing(void **state)
{
    (void)state;
    draw(5, AIR);
    rows(mask, row_of(1.5), H - row_of(1.5), AIR); /* as all that is near */
    look(5);
    assert_int_equal(occupied(), 0);
    assert_int_equal(cell_at(2.55, 0.05), FOVEA_GRID_UNKNOWN);
}

/* One pixel at the picture's border or amid floor is roughness, three pixels are an end. */
static void one_pixel_is_no_end(void **state)
{
    (void)state;
    const int amid = row_of(2);
    draw(1e6, AIR);
    rows(mask, 0, H, FLOOR);
    for (int width = 1; width <= 3; width += 2) {
        rows(mask, amid, width, AIR);
        look(5);
        if (width == 1)
            assert_int_equal(occupied(), 0);
        else
            assert_true(is_occupied(cell_at(1.95, 0.05)) || is_occupied(cell_at(1.85, 0.05)));
    }
    /* The picture ends above the floor 2 m ahead. */
    view.T_odom_cam[1] = -sin(0.7);
    view.T_odom_cam[2] = cos(0.7);
    view.T_odom_cam[9] = -cos(0.7);
    view.T_odom_cam[10] = -sin(0.7);
    rows(mask, 0, H, FLOOR);
    rows(mask, 0, 1, AIR);
    look(5);
    assert_int_equal(occupied(), 0);
    rows(mask, 0, 6, AIR);
    look(5);
    assert_true(occupied() > 3);
    rows(mask, 0, H, FLOOR); /* a wall behind one pixel of it: an obstacle in any case */
    rows(mask, 0, 7, WALL);
    rows(mask, 7, 1, AIR);
    look(5);
    assert_true(occupied() > 3);
    rows(mask, 0, 7, SKY); /* but the robot's own arm */
    look(5);
    assert_int_equal(occupied(), 0);
}

/* Floor is believed first: of which the network is not sure may lie between that and the end, but
 * is none by itself. */
static void only_believed_floor_ends(void **state)
{
    (void)state;
    seen.confidence = confidence;
    draw(2, AIR);
    rows(confidence, row_of(2), row_of(1.7) - row_of(2), UNSURE);
    look(5);
    assert_true(is_occupied(cell_at(1.99, 0.05)) || is_occupied(cell_at(2.05, 0.05)));
    assert_true(is_free(cell_at(1.55, 0.05)));
    assert_int_equal(cell_at(1.85, 0.05), FOVEA_GRID_UNKNOWN);
    rows(confidence, 0, H, UNSURE);
    look(5);
    assert_int_equal(occupied(), 0);
}

static void what_the_floor_leaves_open_counts(void **state)
{
    (void)state;
    draw(2, AIR);
    view.floor_covariance[0] = view.floor_covariance[3] = 0.175 * 0.175; /* ten degrees */
    look(5);
    assert_int_equal(occupied(), 0);
    view.floor_covariance[0] = view.floor_covariance[3] = 0.01 * 0.01;
    look(1);
    assert_int_equal(occupied(), 0);
    look(5);
    assert_true(is_occupied(cell_at(2.05, 0.05)) || is_occupied(cell_at(1.95, 0.05)));
}

/* Two points 0.4 m below the floor, which the sight passes 2 m ahead. */
static void points_beyond_floor_count(void **state)
{
    (void)state;
    static const struct fovea_grid_point pit[2] = {{{3.06f, 0.03f, -0.4f}, 0.01f, 0.005f},
                                                   {{3.06f, 0.09f, -0.4f}, 0.01f, 0.005f}};
    view.points = pit;
    view.point_count = 2;
    rows(mask, 0, H, SKY);
    look(5);
    assert_int_equal(occupied(), 0);
    rows(mask, 0, H, AIR);
    look(5);
    assert_int_equal(occupied(), 1);
    assert_true(is_occupied(cell_at(2.04, 0.04)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(floor_that_ends_is_an_obstacle, setup, free_grid),
        cmocka_unit_test_setup_teardown(near_ends_count_as_obstacles_do, setup, free_grid),
        cmocka_unit_test_setup_teardown(far_ends_count_in_parts, setup, free_grid),
        cmocka_unit_test_setup_teardown(a_horizon_is_no_end, setup, free_grid),
        cmocka_unit_test_setup_teardown(rays_that_begin_beyond_say_nothing, setup, free_grid),
        cmocka_unit_test_setup_teardown(one_pixel_is_no_end, setup, free_grid),
        cmocka_unit_test_setup_teardown(only_believed_floor_ends, setup, free_grid),
        cmocka_unit_test_setup_teardown(what_the_floor_leaves_open_counts, setup, free_grid),
        cmocka_unit_test_setup_teardown(points_beyond_floor_count, setup, free_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
