/* A floor that ends with nothing beyond, in halls of `sim:drive` that have a pit: the mask calls
 * the pit what it calls ceilings, as a network calls the sky beyond a quay. Three grids are fed by
 * the truth's masks and poses: one that knows the pit as an obstacle, one that knows what lies
 * beyond floor, and one that ignores it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_cells.h"
#include "common/sim_rig.h"
#include "fovea/grid.h"

enum { AS_OBSTACLE, AS_BEYOND, AS_IGNORED, GRIDS, SIDE = 256 };

static struct sim_rig rig;
static struct fovea_grid *grids[GRIDS];
static void *memory[GRIDS];
static int8_t cells[GRIDS][SIDE * SIDE];
static struct fovea_grid_place place;

/* By truth class. */
static uint8_t labels[GRIDS][256];

static void make_labels(int k)
{
    memcpy(labels[k], sim_labels, sizeof labels[k]);
    labels[k][FOVEA_TRUTH_BACKGROUND] = k == AS_BEYOND ? FOVEA_GRID_BEYOND : FOVEA_GRID_IGNORED;
    if (k != AS_OBSTACLE) labels[k][FOVEA_TRUTH_PIT] = labels[k][FOVEA_TRUTH_BACKGROUND];
}

static void make_grid(int k)
{
    struct fovea_grid_config config;
    struct fovea_error error;
    size_t bytes;
    make_labels(k);
    fovea_grid_config_default(&config);
    config.side_cells = SIDE; /* the hall stays in it */
    assert_int_equal(fovea_grid_size(&config, &bytes, &error), FOVEA_OK);
    memory[k] = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_int_equal(fovea_grid_init(&grids[k], &config, memory[k], bytes, &error), FOVEA_OK);
}

static void update(const struct fovea_truth *truth)
{
    const struct fovea_camera *camera = &rig.source->info.rig.cameras[0].camera;
    const struct fovea_segmentation seen = sim_mask_of(truth, camera);
    struct fovea_grid_view view = {.stamp_ns = rig.frame.stamp_ns, .seen = &seen, .camera = camera};
    memcpy(view.T_odom_cam, truth->T_world_cam, sizeof view.T_odom_cam);
    view.position_m[0] = view.T_odom_cam[3];
    view.position_m[1] = view.T_odom_cam[7];
    for (int k = 0; k < GRIDS; k++) {
        view.labels = labels[k];
        assert_int_equal(fovea_grid_update(grids[k], &view), FOVEA_OK);
    }
}

static void drive(int seed)
{
    static struct fovea_truth truth;
    char uri[64];
    snprintf(uri, sizeof uri, "sim:drive?seed=%d&width=320&height=240&rate=4", seed);
    sim_rig_open(&rig, uri, 0, 0);
    for (int k = 0; k < GRIDS; k++)
        make_grid(k);
    while (sim_rig_next(&rig)) {
        assert_int_equal(rig.ops->truth(rig.source, &rig.frame, &truth), FOVEA_OK);
        update(&truth);
        rig.ops->requeue(rig.source, &rig.frame);
        rig.frames++;
    }
    for (int k = 0; k < GRIDS; k++)
        fovea_grid_cells(grids[k], cells[k], &place);
}

static bool is_occupied(int percent)
{
    return percent > 100 * FOVEA_GRID_OCCUPIED_ABOVE;
}

/* Cells of the pit and those beside it, as each grid calls them. */
struct figures {
    int occupied[GRIDS], both;
    int free_inside[GRIDS]; /* further than a cell from the edge */
};

static void add_cell(struct figures *f, double x, double y, const double pit[4])
{
    const int32_t column = (int32_t)((x - place.origin_m[0]) / place.resolution_m),
                  row = (int32_t)((y - place.origin_m[1]) / place.resolution_m);
    assert_true(column >= 0 && column < SIDE && row >= 0 && row < SIDE);
    const bool inside =
        x > pit[0] + 0.1 && x < pit[1] - 0.1 && y > pit[2] + 0.1 && y < pit[3] - 0.1;
    for (int k = 0; k < GRIDS; k++) {
        const int percent = cells[k][row * SIDE + column];
        f->occupied[k] += is_occupied(percent);
        f->free_inside[k] += inside && percent >= 0 && percent < 100 * FOVEA_GRID_FREE_BELOW;
    }
    f->both += is_occupied(cells[AS_OBSTACLE][row * SIDE + column]) &&
               is_occupied(cells[AS_BEYOND][row * SIDE + column]);
}

static void the_edge_of_a_pit_without_a_class_is_occupied(void **state)
{
    static const int seeds[] = {1001, 1004};
    struct figures f = {0};
    (void)state;
    for (size_t i = 0; i < sizeof seeds / sizeof *seeds; i++) {
        drive(seeds[i]);
        const double *pit = rig.source->world.drive.pit;
        assert_true(pit[0] < pit[1]);
        for (double y = pit[2] - 0.05; y < pit[3] + 0.1; y += 0.1)
            for (double x = pit[0] - 0.05; x < pit[1] + 0.1; x += 0.1)
                add_cell(&f, x, y, pit);
        sim_rig_close(&rig);
        for (int k = 0; k < GRIDS; k++)
            free(memory[k]);
    }
    print_message("occupied: %d as an obstacle, %d as what lies beyond floor (%d of them both), %d "
                  "ignored; free inside %d, %d, %d\n",
                  f.occupied[0], f.occupied[1], f.both, f.occupied[2], f.free_inside[0],
                  f.free_inside[1], f.free_inside[2]);
    assert_true(f.occupied[AS_OBSTACLE] > 20);
    /* Rays that begin in the pit, and few views from far away, mark those of an obstacle alone. */
    assert_true(f.both >= 0.75 * f.occupied[AS_OBSTACLE]);
    assert_true(f.occupied[AS_IGNORED] < 0.1 * f.occupied[AS_OBSTACLE]);
    assert_true(f.free_inside[AS_BEYOND] <= f.free_inside[AS_OBSTACLE]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_edge_of_a_pit_without_a_class_is_occupied),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
