/* Floor of which the network is not sure makes no cell free, and hides none behind it: of the pits
 * that it takes for floor it is less sure than of floor. */
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
#include "fovea/fovea.h"

enum { W = 80, H = 60, SIDE = 128, CELLS = SIDE * SIDE, SURE = 254, UNSURE = 200 };
static const double height = 0.8, tilt = 0.3;

static uint8_t mask[W * H], confidence[W * H];
static int8_t cells[CELLS];
static struct fovea_grid_place place;

/* Row of the mask that shows the floor so far ahead. */
static int row_of(double x)
{
    const double p[3] = {0, cos(tilt) * height - sin(tilt) * x, sin(tilt) * height + cos(tilt) * x};
    double pixel[2];
    assert_int_equal(fovea_camera_project(&camera, p, pixel, NULL), FOVEA_OK);
    return (int)((pixel[1] - seen.raw_offset[1]) / seen.raw_scale[1] + 0.5);
}

/* What lies so far ahead, and how sure the network is of it; floor everywhere else. */
struct band {
    double near_m, far_m;
    uint8_t sure, label;
};
static const struct band unsure_floor = {2, 2.5, UNSURE, FLOOR};

static void look_at(const struct band *band, double least, const uint8_t *sure)
{
    fovea_grid_config_default(&config);
    config.side_cells = SIDE;
    config.floor_confidence = least;
    make_grid();
    grid_mask_make(mask, W, H, 4, 200);
    memset(mask, FLOOR, sizeof mask);
    memset(confidence, SURE, sizeof confidence);
    const int far = row_of(band->far_m), near = row_of(band->near_m);
    assert_true(far > 5 && near < H - 5 && near - far >= 3);
    memset(confidence + (size_t)far * W, band->sure, (size_t)(near - far + 1) * W);
    memset(mask + (size_t)far * W, band->label, (size_t)(near - far + 1) * W);
    seen.confidence = sure;
    for (int i = 0; i < 5; i++) {
        struct fovea_grid_view view = grid_mask_view(height, tilt);
        view.stamp_ns = i * INT64_C(100000000);
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    }
    seen.confidence = NULL;
    fovea_grid_cells(grid, cells, &place);
    free_grid(NULL);
}

static int cell_at(double x)
{
    return grid_mask_cell(cells, &place, x, 0.05);
}

static void unsure_floor_makes_no_cell_free(void **state)
{
    (void)state;
    look_at(&unsure_floor, 0.98, confidence);
    assert_true(is_free(cell_at(1.75)) && is_free(cell_at(2.85)));
    assert_int_equal(cell_at(2.15), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(2.25), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(2.35), FOVEA_GRID_UNKNOWN);
}

/* However the cells lie to what is unsure: none that is unsure as a whole is free. */
static void none_of_its_cells_is_free(void **state)
{
    int whole = 0;
    (void)state;
    for (int k = 0; k < 40; k++) {
        const struct band band = {2, 2.5 + 0.06 * k, UNSURE, FLOOR};
        look_at(&band, 0.98, confidence);
        const int far = row_of(band.far_m), near = row_of(band.near_m);
        for (int i = 0; i < CELLS; i++) {
            const double x = place.origin_m[0] + i % SIDE * place.resolution_m;
            if (x < 1.5 || x > 5) continue;
            if (row_of(x) > near || row_of(x + place.resolution_m) < far) continue;
            assert_int_equal(cells[i], FOVEA_GRID_UNKNOWN);
            whole++;
        }
    }
    assert_true(whole > 1000);
}

static void less_may_be_enough(void **state)
{
    (void)state;
    look_at(&unsure_floor, 0.7, confidence);
    assert_true(is_free(cell_at(1.75)) && is_free(cell_at(2.25)) && is_free(cell_at(2.85)));
    look_at(&unsure_floor, 0.98, NULL); /* the network does not say */
    assert_true(is_free(cell_at(1.75)) && is_free(cell_at(2.25)) && is_free(cell_at(2.85)));
}

/* 0.98 of 255 is 250. */
static void as_sure_as_asked_is_enough(void **state)
{
    (void)state;
    struct band band = unsure_floor;
    for (band.sure = 249; band.sure <= 250; band.sure++) {
        look_at(&band, 0.98, confidence);
        assert_int_equal(is_free(cell_at(2.25)), band.sure == 250);
    }
}

/* An obstacle of which the network is not sure is one. */
static void unsure_obstacles_count(void **state)
{
    (void)state;
    const struct band wall = {2, 2.5, UNSURE, WALL};
    look_at(&wall, 0.98, confidence);
    assert_true(is_free(cell_at(1.75)));
    assert_true(is_occupied(cell_at(1.95)) || is_occupied(cell_at(2.05)));
    assert_int_equal(cell_at(2.85), FOVEA_GRID_UNKNOWN);
}

static void it_is_90_percent_unless_set_and_a_part_of_one(void **state)
{
    (void)state;
    static struct fovea_config runtime;
    const double wrong[] = {-0.01, 1.01, NAN};
    struct fovea_error error;
    size_t bytes;
    fovea_grid_config_default(&config);
    assert_true(config.floor_confidence == 0.9);
    fovea_config_default(&runtime);
    assert_true(runtime.grid_job.grid.floor_confidence == 0.9);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        config.floor_confidence = wrong[i];
        assert_int_equal(fovea_grid_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
        assert_non_null(strstr(error.text, "floor_confidence"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unsure_floor_makes_no_cell_free),
        cmocka_unit_test(none_of_its_cells_is_free),
        cmocka_unit_test(less_may_be_enough),
        cmocka_unit_test(as_sure_as_asked_is_enough),
        cmocka_unit_test(unsure_obstacles_count),
        cmocka_unit_test(it_is_90_percent_unless_set_and_a_part_of_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
