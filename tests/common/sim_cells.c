#include "common/sim_cells.h"

#include "fovea/grid.h"

static const double sample_m = 0.01; /* between samples of a surface */

static void mark_occupied(const struct sim_cells *grid, const double p[3], uint8_t *cells)
{
    const double x = fv_floor((p[0] - grid->origin_m[0]) / grid->cell_m),
                 y = fv_floor((p[1] - grid->origin_m[1]) / grid->cell_m);
    if (p[2] < SIM_CELL_LOW_M || p[2] > SIM_CELL_HIGH_M || x < 0 || y < 0 || x >= grid->width ||
        y >= grid->height)
        return;
    cells[(int64_t)y * grid->width + (int64_t)x] = SIM_CELL_OCCUPIED;
}

static int32_t samples_of(double length_m)
{
    return (int32_t)(length_m / sample_m) + 2;
}

static double length_of(const double v[3])
{
    return __builtin_sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void mark_face(const struct fv_sim_face *f, const struct sim_cells *grid, uint8_t *cells)
{
    const int32_t across = samples_of(length_of(f->u)), up = samples_of(length_of(f->v));
    for (int32_t j = 0; j < up; j++) {
        for (int32_t i = 0; i < across; i++) {
            const double s = (i + 0.5) / across, t = (j + 0.5) / up;
            double p[3];
            if (f->disc && (s - 0.5) * (s - 0.5) + (t - 0.5) * (t - 0.5) > 0.25) continue;
            for (int32_t k = 0; k < 3; k++)
                p[k] = f->origin[k] + s * f->u[k] + t * f->v[k];
            mark_occupied(grid, p, cells);
        }
    }
}

static void mark_round(const struct fv_sim_round *r, const struct sim_cells *grid, uint8_t *cells)
{
    enum { AROUND = 128 };
    const double *a = r->axis, *e = r->side;
    const double f[3] = {a[1] * e[2] - a[2] * e[1], a[2] * e[0] - a[0] * e[2],
                         a[0] * e[1] - a[1] * e[0]};
    const int32_t up = samples_of(r->height);
    for (int32_t j = 0; j < up; j++) {
        const double s = r->height * (j + 0.5) / up, square = r->q0 + r->q1 * s + r->q2 * s * s;
        const double radius = square > 0 ? __builtin_sqrt(square) : 0;
        for (int32_t i = 0; i < AROUND; i++) {
            const double c = radius * fv_cos(2 * FV_PI * i / AROUND),
                         d = radius * fv_sin(2 * FV_PI * i / AROUND);
            double p[3];
            for (int32_t k = 0; k < 3; k++)
                p[k] = r->base[k] + s * a[k] + c * e[k] + d * f[k];
            mark_occupied(grid, p, cells);
        }
    }
}

/* Floor faces are level rectangles along the axes, apart from one another: a cell has floor under
 * all of it where the middle and the corners have. */
static bool has_floor(const struct fv_sim_world *world, double x, double y)
{
    for (int32_t i = 0; i < world->static_faces; i++) {
        const struct fv_sim_face *f = &world->face[i];
        if (f->truth_class != FOVEA_TRUTH_FLOOR || f->u[2] != 0 || f->v[2] != 0) continue;
        const double s = (x - f->origin[0]) / f->u[0], t = (y - f->origin[1]) / f->v[1];
        if (s >= 0 && s <= 1 && t >= 0 && t <= 1) return true;
    }
    return false;
}

static bool cell_has_floor(const struct fv_sim_world *world, const struct sim_cells *grid,
                           int32_t column, int32_t row)
{
    static const double at[5][2] = {
        {0.5, 0.5}, {0.01, 0.01}, {0.99, 0.01}, {0.01, 0.99}, {0.99, 0.99}};
    for (int32_t k = 0; k < 5; k++)
        if (!has_floor(world, grid->origin_m[0] + (column + at[k][0]) * grid->cell_m,
                       grid->origin_m[1] + (row + at[k][1]) * grid->cell_m))
            return false;
    return true;
}

void sim_cells_find(const struct fv_sim_world *world, const struct sim_cells *grid, bool moving,
                    uint8_t *cells)
{
    for (int32_t i = 0; i < grid->width * grid->height; i++)
        cells[i] = !moving && cell_has_floor(world, grid, i % grid->width, i / grid->width)
                       ? SIM_CELL_FLOOR
                       : SIM_CELL_NONE;
    const int32_t first_face = moving ? world->static_faces : 0,
                  first_round = moving ? world->static_rounds : 0;
    for (int32_t i = first_face; i < (moving ? world->face_count : world->static_faces); i++)
        mark_face(&world->face[i], grid, cells);
    for (int32_t i = first_round; i < (moving ? world->round_count : world->static_rounds); i++)
        mark_round(&world->round[i], grid, cells);
}

struct fovea_segmentation sim_mask_of(const struct fovea_truth *truth,
                                      const struct fovea_camera *camera)
{
    static struct fovea_segmentation_class list[FOVEA_TRUTH_CLASS_COUNT];
    static uint8_t index[256];
    for (int i = 0; i < FOVEA_TRUTH_CLASS_COUNT; i++) {
        list[i].class_id = i;
        index[i] = (uint8_t)i;
    }
    return (struct fovea_segmentation){.width = camera->width,
                                       .height = camera->height,
                                       .image_width = camera->width,
                                       .image_height = camera->height,
                                       .raw_scale = {1, 1},
                                       .count = FOVEA_TRUTH_CLASS_COUNT,
                                       .list = list,
                                       .pixels = truth->class_mask,
                                       .index = index};
}

const uint8_t sim_labels[256] = {
    [FOVEA_TRUTH_BACKGROUND] = FOVEA_GRID_BEYOND, [FOVEA_TRUTH_BALL] = FOVEA_GRID_MOVABLE,
    [FOVEA_TRUTH_CONE] = FOVEA_GRID_MOVABLE,      [FOVEA_TRUTH_BOX] = FOVEA_GRID_MOVABLE,
    [FOVEA_TRUTH_PERSON] = FOVEA_GRID_MOVABLE,    [FOVEA_TRUTH_FLOOR] = FOVEA_GRID_FLOOR,
    [FOVEA_TRUTH_WALL] = FOVEA_GRID_OBSTACLE,     [FOVEA_TRUTH_OBSTACLE] = FOVEA_GRID_OBSTACLE,
    [FOVEA_TRUTH_PIT] = FOVEA_GRID_OBSTACLE};
