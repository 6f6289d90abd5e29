#include "common/sim_seen.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/vec.h"

enum { FLOOR = 1, SURFACE = 2 }; /* what a frame shows of a cell; under the floor too */
enum { FRAMES = 3 };
static const double range_m = 3, cell_m = 0.1;

static int32_t cell_of(const struct sim_cells *place, const double p[3])
{
    const double x = fv_floor((p[0] - place->origin_m[0]) / cell_m),
                 y = fv_floor((p[1] - place->origin_m[1]) / cell_m);
    if (x < 0 || y < 0 || x >= place->width || y >= place->height) return -1;
    return (int32_t)y * place->width + (int32_t)x;
}

static void find_rays(struct sim_seen *seen, const struct fovea_camera *camera)
{
    seen->ray = malloc((size_t)(camera->width * camera->height) * sizeof *seen->ray);
    assert_non_null(seen->ray);
    for (int32_t i = 0; i < camera->width * camera->height; i++) {
        const double pixel[2] = {i % camera->width, (int32_t)(i / camera->width)};
        double b[3];
        assert_int_equal(fovea_camera_unproject(camera, pixel, b, NULL), FOVEA_OK);
        for (int k = 0; k < 2; k++)
            seen->ray[i][k] = (float)(b[k] / b[2]);
    }
}

void sim_seen_begin(struct sim_seen *seen, const struct fv_sim_world *world,
                    const struct fovea_camera *camera)
{
    memset(seen, 0, sizeof *seen);
    seen->place.cell_m = cell_m;
    for (int k = 0; k < 2; k++)
        seen->place.origin_m[k] = -cell_m * (double)((int)(world->drive.half[k] / cell_m) + 2);
    seen->place.width = (int32_t)(-seen->place.origin_m[0] / cell_m * 2 + 0.5);
    seen->place.height = (int32_t)(-seen->place.origin_m[1] / cell_m * 2 + 0.5);
    assert_true(sim_seen_cells(seen) <= SIM_SEEN_CELLS_MAX);
    sim_cells_find(world, &seen->place, false, seen->still);
    find_rays(seen, camera);
}

void sim_seen_end(struct sim_seen *seen)
{
    free(seen->ray);
    seen->ray = NULL;
}

static void touch(struct sim_seen *seen, const struct fovea_camera *camera,
                  const struct fovea_truth *truth)
{
    const double *T = truth->T_world_cam;
    memset(seen->touched, 0, sizeof seen->touched);
    for (int32_t i = 0; i < camera->width * camera->height; i++) {
        const double depth = (double)truth->depth_m[i];
        const double x = depth * (double)seen->ray[i][0], y = depth * (double)seen->ray[i][1];
        double p[3];
        if (depth <= 0 || depth > 2 * range_m) continue;
        for (int k = 0; k < 3; k++)
            p[k] = T[4 * k] * x + T[4 * k + 1] * y + T[4 * k + 2] * depth + T[4 * k + 3];
        const int32_t cell = p[2] <= SIM_CELL_HIGH_M ? cell_of(&seen->place, p) : -1;
        if (cell >= 0) seen->touched[cell] |= p[2] < SIM_CELL_LOW_M ? FLOOR : SURFACE;
    }
}

void sim_seen_frame(struct sim_seen *seen, const struct fv_sim_world *world,
                    const struct fovea_camera *camera, const struct fovea_truth *truth)
{
    const double *T = truth->T_world_cam;
    sim_cells_find(world, &seen->place, true, seen->moving);
    touch(seen, camera, truth);
    for (int32_t i = 0; i < sim_seen_cells(seen); i++) {
        const int32_t column = i % seen->place.width, row = i / seen->place.width;
        const double x = seen->place.origin_m[0] + (column + 0.5) * cell_m - T[3],
                     y = seen->place.origin_m[1] + (row + 0.5) * cell_m - T[7];
        const bool near = x * x + y * y <= range_m * range_m;
        if (seen->moving[i] != seen->was[i]) seen->floor[i] = seen->surface[i] = 0;
        seen->was[i] = seen->moving[i];
        seen->floor[i] += near && (seen->touched[i] & FLOOR) != 0;
        seen->surface[i] += near && (seen->touched[i] & SURFACE) != 0;
    }
}

int32_t sim_seen_cells(const struct sim_seen *seen)
{
    return seen->place.width * seen->place.height;
}

enum sim_cell sim_seen_truth(const struct sim_seen *seen, int32_t cell)
{
    return seen->moving[cell] == SIM_CELL_OCCUPIED ? SIM_CELL_OCCUPIED
                                                   : (enum sim_cell)seen->still[cell];
}

bool sim_seen_is(const struct sim_seen *seen, int32_t cell)
{
    return (sim_seen_truth(seen, cell) == SIM_CELL_OCCUPIED ? seen->surface[cell]
                                                            : seen->floor[cell]) >= FRAMES;
}

int sim_seen_floor_about(const struct sim_seen *seen, int32_t cell)
{
    int floor = 0;
    for (int32_t y = -1; y <= 1; y++)
        for (int32_t x = -1; x <= 1; x++) {
            const int32_t beside = cell + y * seen->place.width + x;
            if (beside >= 0 && beside < sim_seen_cells(seen))
                floor += sim_seen_truth(seen, beside) == SIM_CELL_FLOOR;
        }
    return floor;
}
