/* The free-space grid on drawn worlds: boxes on a floor, seen as masks from known poses. Floor that
 * was seen is free, obstacles stand where they are, nothing behind them is known; cells stay where
 * they are while the robot moves, what may move is forgotten, and a lost pose leaves nothing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/drawn_world.h"

static struct fovea_error error;

static void look(double x, double y, double yaw, double tilt, double roll, int64_t stamp_ns)
{
    struct fovea_grid_view view = view_from(x, y, yaw, tilt, roll);
    view.stamp_ns = stamp_ns;
    draw(&view);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
}

/* A view in which nothing is known, from (x, y). */
static void pass(double x, double y, int64_t stamp_ns)
{
    struct fovea_grid_view view = view_from(x, y, 0, 0.3, 0);
    view.stamp_ns = stamp_ns;
    memset(mask, SKY, sizeof mask);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
}

static int8_t *cells;
static struct fovea_grid_place place;
static void read_cells(void)
{
    free(cells);
    cells = malloc((size_t)config.side_cells * config.side_cells);
    fovea_grid_cells(grid, cells, &place);
}

static int cell_at(double x, double y)
{
    return grid_mask_cell(cells, &place, x, y);
}

static bool in_box(double x, double y, double margin)
{
    for (int i = 0; i < box_count; i++)
        if (x > boxes[i].x[0] + margin && x < boxes[i].x[1] - margin &&
            y > boxes[i].y[0] + margin && y < boxes[i].y[1] - margin)
            return true;
    return false;
}

/* Whether the floor at (x, y) is in the image of a view and nothing hides it. */
static bool is_seen(const struct fovea_grid_view *view, double x, double y)
{
    const double *T = view->T_odom_cam, from[3] = {T[3], T[7], T[11]},
                 way[3] = {x - T[3], y - T[7], -T[11]};
    double point[3], pixel[2], t;
    for (int k = 0; k < 3; k++)
        point[k] = T[k] * way[0] + T[4 + k] * way[1] + T[8 + k] * way[2];
    if (fovea_camera_project(&camera, point, pixel, NULL) != FOVEA_OK || pixel[0] < 0 ||
        pixel[1] < 0 || pixel[0] > 2 * W - 1 || pixel[1] > 2 * H - 1)
        return false;
    return meets(from, way, &t) == FLOOR && fabs(t - 1) < 1e-6;
}

/* ---- tests ----------------------------------------------------------------------------------- */

/* A drive of 12 frames among boxes: over the cells whose floor was seen in 3 frames from within 3 m
 * the free class has an intersection over union of 0.85 at least, 85 % are known, and of what
 * stands there next to nothing is called free, a cell's width aside. */
static void floor_is_free_and_boxes_are_not(void **state)
{
    (void)state;
    enum { FRAMES = 12 };
    struct fovea_grid_view views[FRAMES];
    add_box(2.0, 2.4, -0.3, 0.3, 0.5, WALL);
    add_box(1.5, 1.8, 0.8, 1.1, 0.3, WALL);
    add_box(2.6, 3.2, -1.4, -0.9, 1.5, CART);
    add_box(4.0, 4.1, -3, 3, 2, WALL);
    for (int i = 0; i < FRAMES; i++) {
        const double x = 0.08 * i, yaw = 0.25 * sin(0.6 * i), roll = 0.04 * cos(i);
        views[i] = view_from(x, 0, yaw, 0.35, roll);
        look(x, 0, yaw, 0.35, roll, i * SECOND / 30);
    }
    read_cells();
    int both = 0, either = 0, known = 0, all = 0, inside = 0, wrong = 0;
    for (double x = 0.05; x < 3.9; x += 0.1) {
        for (double y = -2.95; y < 3; y += 0.1) {
            int frames = 0;
            for (int i = 0; i < FRAMES; i++)
                frames += hypot(x - views[i].position_m[0], y) < 3 && is_seen(&views[i], x, y);
            const int percent = cell_at(x, y);
            const bool standing = in_box(x, y, 0);
            inside += in_box(x, y, 0.1);
            wrong += in_box(x, y, 0.1) && is_free(percent);
            if (frames < 3) continue;
            all++;
            known += is_free(percent) || is_occupied(percent);
            both += !standing && is_free(percent);
            either += !standing || is_free(percent);
        }
    }
    print_message("%d cells seen: free IoU %.3f, known %.3f; %d of %d cells within boxes free\n",
                  all, (double)both / either, (double)known / all, wrong, inside);
    assert_true(all > 300);
    assert_true(both >= 0.85 * either);
    assert_true(known >= 0.85 * all);
    assert_true(inside > 10 && wrong * 100 <= inside);
    assert_int_equal(cell_at(3.0, 0), FOVEA_GRID_UNKNOWN); /* behind the first box */
    assert_true(is_free(cell_at(0.88, 0.0)));              /* where the robot stands */
    for (double y = -0.25; y < 0.3; y += 0.1)              /* its front */
        assert_true(is_occupied(cell_at(2.05, y)) || is_occupied(cell_at(1.95, y)));
}

static void the_scan_is_the_nearest_obstacle(void **state)
{
    (void)state;
    float *ranges = malloc(config.rays * sizeof *ranges);
    const double yaw = 1.2; /* it stands south of the box and looks north */
    add_box(0.3, 1.1, 2.0, 2.4, 0.5, WALL);
    for (int i = 0; i < 5; i++)
        look(0.5, 0.2, yaw, 0.5, 0, i);
    fovea_grid_scan(grid, ranges);
    int hits = 0, misses = 0;
    for (int degrees = -30; degrees <= 30; degrees += 2) { /* in the body's frame */
        const double from[3] = {0.5, 0.2, 0.1};
        const float range = ranges[(degrees + 360) % 360];
        int walls = 0;
        double t = 0;
        for (int side = -4; side <= 4; side += 4) { /* a cell's width beside */
            const double angle = (degrees + side) * M_PI / 180 + yaw,
                         way[3] = {cos(angle), sin(angle), 0};
            double other;
            walls += meets(from, way, side == 0 ? &t : &other) == WALL;
        }
        if (walls == 3) assert_true(fabs((double)range - t) < 0.16);
        if (walls == 0) assert_true(isnan(range) || isinf(range));
        hits += walls == 3;
        misses += walls == 0;
    }
    assert_true(hits > 2 && misses > 4);
    assert_true(isnan(ranges[180])); /* it never looked back */
    free(ranges);
}

static void cells_stay_where_they_are_while_the_robot_moves(void **state)
{
    (void)state;
    add_box(2.0, 2.4, -0.3, 0.3, 0.5, WALL);
    for (int i = 0; i < 5; i++)
        look(0, 0, 0, 0.4, 0, 0);
    read_cells();
    static const double ways[][2] = {{1.03, 0}, {1.03, -2.57}, {-3.2, 0.31}, {0, 0}};
    int8_t *before = malloc((size_t)place.width * place.height);
    memcpy(before, cells, (size_t)place.width * place.height);
    const struct fovea_grid_place old = place;
    for (size_t w = 0; w < sizeof ways / sizeof *ways; w++) {
        pass(ways[w][0], ways[w][1], 0);
        read_cells();
        assert_true(fabs(place.origin_m[0] + 0.05 * SIDE - ways[w][0]) <= 0.1 + 1e-9);
        int compared = 0;
        for (uint32_t i = 0; i < old.width * old.height; i++) {
            const uint32_t column = i % old.width, row = i / old.width;
            const double x = old.origin_m[0] + (column + 0.5) * 0.1,
                         y = old.origin_m[1] + (row + 0.5) * 0.1;
            const int now = cell_at(x, y);
            bool stood = false; /* its own cells are free, and have been */
            for (size_t k = 0; k <= w; k++)
                stood = stood || hypot(x - ways[k][0], y - ways[k][1]) < 0.25;
            if (now < -1 || stood || (w == 3 && before[i] != now && now == -1)) continue;
            assert_int_equal(now, before[i]);
            compared += before[i] != FOVEA_GRID_UNKNOWN;
        }
        assert_true(compared > 100);
    }
    pass(500, 500, 0);
    pass(500, 500, 0);
    read_cells();
    assert_true(is_free(cell_at(500.05, 500.05))); /* where it stands */
    assert_int_equal(cell_at(500.35, 500.05), FOVEA_GRID_UNKNOWN);
    pass(0, 0, 0);
    read_cells();
    int known = 0; /* what was left is forgotten */
    for (uint32_t i = 0; i < place.width * place.height; i++)
        known += cells[i] != FOVEA_GRID_UNKNOWN;
    assert_true(known < 20);
    free(before);
}

static void what_may_move_is_forgotten_first_and_a_lost_pose_leaves_nothing(void **state)
{
    (void)state;
    add_box(2.0, 2.4, -0.9, -0.3, 0.5, WALL);
    add_box(2.0, 2.4, 0.3, 0.9, 0.5, CART);
    for (int i = 0; i < 6; i++)
        look(0, 0, 0, 0.4, 0, i * SECOND / 30);
    read_cells();
    assert_true(is_occupied(cell_at(2.05, -0.6)) && is_occupied(cell_at(2.05, 0.6)));
    pass(0, 0, 10 * SECOND);
    read_cells();
    assert_true(is_occupied(cell_at(2.05, -0.6)) && !is_occupied(cell_at(2.05, 0.6)));
    pass(0, 0, 1000 * SECOND);
    read_cells();
    assert_true(!is_occupied(cell_at(2.05, -0.6)));
    look(0, 0, 0, 0.4, 0, 1000 * SECOND);
    fovea_grid_forget(grid);
    read_cells();
    float *ranges = malloc(config.rays * sizeof *ranges);
    fovea_grid_scan(grid, ranges);
    for (uint32_t i = 0; i < place.width * place.height; i++)
        assert_int_equal(cells[i], FOVEA_GRID_UNKNOWN);
    for (uint32_t i = 0; i < config.rays; i++)
        assert_true(isnan(ranges[i]));
    assert_int_equal(place.stamp_ns, 0);
    free(ranges);
}

/* However often the grid is updated: after the half-life the log-odds of 97 % are those of 85 %. */
static void log_odds_halve_in_the_half_life(void **state)
{
    static const int64_t steps_ns[] = {60000000000, 1000000000, 100000000, 33333333};
    (void)state;
    add_box(2.0, 2.4, -0.9, -0.3, 0.5, WALL);
    assert_true(config.half_life_s == 60);
    for (int k = 0; k < 4; k++) {
        fovea_grid_forget(grid);
        for (int i = 0; i < 20; i++)
            look(0, 0, 0, 0.4, 0, i * SECOND / 100);
        read_cells();
        const int before = cell_at(2.05, -0.6);
        for (int64_t at = SECOND / 5; at <= SECOND / 5 + 60 * SECOND; at += steps_ns[k])
            pass(0, 0, at);
        pass(0, 0, SECOND / 5 + 60 * SECOND);
        read_cells();
        const int after = cell_at(2.05, -0.6);
        if (before != 97 || after < 83 || after > 87)
            fail_msg("steps of %lld ns: from %d %% to %d %%, expected from 97 to 85",
                     (long long)steps_ns[k], before, after);
    }
}

static void wrong_configurations_and_poses_are_refused(void **state)
{
    (void)state;
    size_t bytes;
    struct fovea_grid_config wrong = config;
    wrong.side_cells = 513;
    assert_int_equal(fovea_grid_size(&wrong, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "side_cells: found 513"));
    wrong = config;
    wrong.range_m = NAN;
    assert_int_equal(fovea_grid_size(&wrong, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_grid_size(&config, &bytes, &error), FOVEA_OK);
    assert_int_equal(fovea_grid_init(&grid, &config, grid_memory, bytes - 1, &error),
                     FOVEA_ERROR_MEMORY);
    struct fovea_grid_view view = view_from(0, 0, 0, 0.4, 0);
    view.stamp_ns = 5;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    view.stamp_ns = 4;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_ERROR_ARGUMENT);
    view.stamp_ns = 6;
    struct fovea_grid_view low = view, turned = view;
    low.floor_m =
        view.T_odom_cam[11]; /* the camera lies on the floor: nothing would be beyond it */
    assert_int_equal(fovea_grid_update(grid, &low), FOVEA_ERROR_ARGUMENT);
    turned.T_odom_cam[2] *= 1.01;
    assert_int_equal(fovea_grid_update(grid, &turned), FOVEA_ERROR_ARGUMENT);
    const struct fovea_segmentation none = {.width = W, .height = H};
    struct fovea_grid_view early = view;
    early.seen = &none; /* no mask has come yet */
    assert_int_equal(fovea_grid_update(grid, &early), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    view.T_odom_cam[5] = NAN;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_ERROR_ARGUMENT);
}

/* Odds of 0.85 once and twice, of -0.4 once, as probabilities: 70, 85 and 40 percent. */
static void evidence_adds_up_as_log_odds(void **state)
{
    (void)state;
    config.half_life_s = 10000;
    make_grid();
    add_box(2.02, 2.4, -3, 3, 2, WALL);
    look(0, 0, 0, 0.3, 0, 0);
    read_cells();
    assert_int_equal(cell_at(2.05, 0.05), 70);
    assert_int_equal(cell_at(1.55, 0.05), 40);
    look(0, 0, 0, 0.3, 0, SECOND / 30);
    read_cells();
    assert_int_equal(cell_at(2.05, 0.05), 85);
}

/* The camera sits 0.5 m ahead of the body, and the floor 2 m below the odometry frame's origin. */
static void the_camera_and_not_the_body_looks_and_the_floor_lies_where_it_does(void **state)
{
    (void)state;
    add_box(2.02, 2.4, -3, 3, 2, WALL);
    struct fovea_grid_view view = view_from(0.5, 0.3, 0, 0.3, 0);
    draw(&view);
    view.position_m[0] = view.position_m[1] = 0;
    view.T_odom_cam[11] -= 2;
    view.floor_m = -2;
    for (int i = 0; i < 3; i++) {
        view.stamp_ns = i * SECOND / 30;
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    }
    read_cells();
    assert_true(is_occupied(cell_at(2.05, 0.35)) && is_free(cell_at(1.85, 0.35)));
    assert_int_equal(cell_at(2.55, 0.35), FOVEA_GRID_UNKNOWN);
    float ranges[360];
    fovea_grid_scan(grid, ranges);
    assert_true(fabsf(ranges[0] - 2.0f) < 0.11f); /* from the body */
}

/* The world leans against the odometry frame: with the floor's slopes cells lie where they lay, and
 * with a level floor they do not. */
static void a_floor_may_slope(void **state)
{
    (void)state;
    const double lean = 0.06, c = cos(lean), s = sin(lean);
    add_box(2.5, 2.9, -1, 1, 0.5, WALL);
    for (int level = 0; level < 2; level++) {
        struct fovea_grid_view view = view_from(0, 0, 0, 0.35, 0);
        draw(&view);
        double T[12];
        memcpy(T, view.T_odom_cam, sizeof T);
        for (int k = 0; k < 4; k++) { /* about y: what lies ahead is higher */
            view.T_odom_cam[k] = c * T[k] - s * T[8 + k];
            view.T_odom_cam[8 + k] = s * T[k] + c * T[8 + k];
        }
        view.position_m[0] = 1; /* the body need not be below the camera */
        view.floor_slope[0] = level ? 0 : tan(lean);
        view.floor_m = level ? 0 : tan(lean);
        fovea_grid_forget(grid);
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
        read_cells();
        int wall = 0;
        for (double x = 1.05; x < 5; x += 0.1)
            if (is_occupied(cell_at(x, 0.05)) && wall == 0) wall = (int)(10 * x);
        if (level) {
            assert_true(wall == 0 || wall > 27);
        } else {
            assert_true(wall == 24 || wall == 25);
            for (double x = 1.05; x < 2.3; x += 0.1)
                assert_int_equal(cell_at(x, 0.05), 40);
        }
    }
}

/* A degree of tilt: sigma_r = r^2 sigma / H. Nothing is said that near to the wall, its own
 * evidence is the part in one cell, and the floor that is nearer is as free as ever. */
static void what_is_uncertain_gives_less_evidence(void **state)
{
    (void)state;
    const double sigma = 0.0175, r = 2.5, sigma_r = r * r * sigma / 0.8;
    add_box(2.5, 2.9, -1, 1, 0.5, WALL);
    struct fovea_grid_view view = view_from(0, 0, 0, 0.35, 0);
    view.floor_covariance[0] = view.floor_covariance[3] = sigma * sigma;
    draw(&view);
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    read_cells();
    for (double x = 0.95; x < 2.5 - sigma_r - 0.1; x += 0.1)
        assert_int_equal(cell_at(x, 0.05), 40);
    assert_false(cell_at(2.45, 0.05) == 40);
    const int eighths = (int)(8 * 0.1 / (2.5066 * sigma_r) + 0.5),
              once = (int)(100 / (1 + exp(-0.85 * eighths / 8)) + 0.5);
    assert_true(eighths == 2 && once < 60);
    assert_in_range(cell_at(2.55, 0.05), once - 1, once + 1);
    for (int i = 0; i < 5; i++) {
        view.stamp_ns++;
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    }
    read_cells();
    assert_true(is_occupied(cell_at(2.55, 0.05)));
    assert_false(is_free(cell_at(2.45, 0.05)));
    assert_true(is_free(cell_at(2.25, 0.05)));
    /* Ten degrees: nothing of the wall, and floor only near by. */
    fovea_grid_forget(grid);
    view.floor_covariance[0] = view.floor_covariance[3] = 100 * sigma * sigma;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    read_cells();
    assert_int_equal(cell_at(2.55, 0.05), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(1.95, 0.05), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(1.05, 0.05), 40);
    /* A height alone: sigma_r = r sigma_height / H. */
    fovea_grid_forget(grid);
    memset(view.floor_covariance, 0, sizeof view.floor_covariance);
    view.floor_covariance[5] = 0.08 * 0.08;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    read_cells();
    assert_int_equal(cell_at(2.35, 0.05), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(2.05, 0.05), 40);
    view.floor_covariance[5] = -1;
    assert_int_equal(fovea_grid_update(grid, &view), FOVEA_ERROR_ARGUMENT);
}

/* Whatever the grid leaves is unknown when it comes back, along either axis. */
static void what_is_left_is_forgotten_along_both_axes(void **state)
{
    (void)state;
    for (int axis = 0; axis < 2; axis++) {
        make_grid();
        for (int i = 0; i < 3; i++)
            look(0, 0, axis == 0 ? 0 : 1.5708, 0.35, 0, i * SECOND / 30);
        read_cells();
        assert_true(is_free(axis == 0 ? cell_at(2.05, 0.05) : cell_at(0.05, 2.05)));
        for (int i = 1; i <= 60; i++) /* away by 6 m, where that cell is out of reach, and back */
            pass(axis == 0 ? -0.1 * i : 0, axis == 0 ? 0 : -0.1 * i, SECOND / 10 + i);
        for (int i = 59; i >= 0; i--)
            pass(axis == 0 ? -0.1 * i : 0, axis == 0 ? 0 : -0.1 * i, SECOND + 60 - i);
        read_cells();
        assert_int_equal(axis == 0 ? cell_at(2.05, 0.05) : cell_at(0.05, 2.05), FOVEA_GRID_UNKNOWN);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(floor_is_free_and_boxes_are_not, setup, free_grid),
        cmocka_unit_test_setup_teardown(the_scan_is_the_nearest_obstacle, setup, free_grid),
        cmocka_unit_test_setup_teardown(cells_stay_where_they_are_while_the_robot_moves, setup,
                                        free_grid),
        cmocka_unit_test_setup_teardown(
            what_may_move_is_forgotten_first_and_a_lost_pose_leaves_nothing, setup, free_grid),
        cmocka_unit_test_setup_teardown(log_odds_halve_in_the_half_life, setup, free_grid),
        cmocka_unit_test_setup_teardown(wrong_configurations_and_poses_are_refused, setup,
                                        free_grid),
        cmocka_unit_test_setup_teardown(evidence_adds_up_as_log_odds, setup, free_grid),
        cmocka_unit_test_setup_teardown(
            the_camera_and_not_the_body_looks_and_the_floor_lies_where_it_does, setup, free_grid),
        cmocka_unit_test_setup_teardown(a_floor_may_slope, setup, free_grid),
        cmocka_unit_test_setup_teardown(what_is_uncertain_gives_less_evidence, setup, free_grid),
        cmocka_unit_test_setup_teardown(what_is_left_is_forgotten_along_both_axes, setup,
                                        free_grid),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    free(cells);
    return failed;
}
