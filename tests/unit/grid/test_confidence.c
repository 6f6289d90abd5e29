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

enum { W = 80, H = 60, CELLS = 128 * 128, SURE = 254, UNSURE = 200 };
static const double height = 0.8, tilt = 0.3;

static uint8_t mask[W * H], confidence[W * H];
static struct fovea_grid_config config;
static struct fovea_grid *grid;
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

/* Floor everywhere; the network is unsure of what lies 2 to 2.5 m ahead. */
static void look(double least, const uint8_t *sure)
{
    size_t bytes;
    struct fovea_error error;
    fovea_grid_config_default(&config);
    config.floor_confidence = least;
    assert_int_equal(fovea_grid_size(&config, &bytes, &error), FOVEA_OK);
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_int_equal(fovea_grid_init(&grid, &config, memory, bytes, &error), FOVEA_OK);
    grid_mask_make(mask, W, H, 4, 200);
    memset(mask, FLOOR, sizeof mask);
    memset(confidence, SURE, sizeof confidence);
    const int far = row_of(2.5), near = row_of(2);
    assert_true(far > 5 && near < H - 5 && near - far >= 3);
    memset(confidence + (size_t)far * W, UNSURE, (size_t)(near - far + 1) * W);
    seen.confidence = sure;
    for (int i = 0; i < 5; i++) {
        const struct fovea_grid_view view = {.stamp_ns = i * INT64_C(100000000),
                                             .seen = &seen,
                                             .labels = labels,
                                             .camera = &camera,
                                             .T_odom_cam = {0, -sin(tilt), cos(tilt), 0, -1, 0, 0,
                                                            0, 0, -cos(tilt), -sin(tilt), height}};
        assert_int_equal(fovea_grid_update(grid, &view), FOVEA_OK);
    }
    seen.confidence = NULL;
    fovea_grid_cells(grid, cells, &place);
    free(memory);
}

static int cell_at(double x)
{
    return grid_mask_cell(cells, &place, x, 0.05);
}

static void unsure_floor_makes_no_cell_free(void **state)
{
    (void)state;
    look(0.98, confidence);
    assert_true(is_free(cell_at(1.75)) && is_free(cell_at(2.85)));
    assert_int_equal(cell_at(2.15), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(2.25), FOVEA_GRID_UNKNOWN);
    assert_int_equal(cell_at(2.35), FOVEA_GRID_UNKNOWN);
}

static void less_may_be_enough(void **state)
{
    (void)state;
    look(0.7, confidence);
    assert_true(is_free(cell_at(1.75)) && is_free(cell_at(2.25)) && is_free(cell_at(2.85)));
    look(0.98, NULL); /* the network does not say */
    assert_true(is_free(cell_at(1.75)) && is_free(cell_at(2.25)) && is_free(cell_at(2.85)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unsure_floor_makes_no_cell_free),
        cmocka_unit_test(less_may_be_enough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
