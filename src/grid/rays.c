/* Of an update of the grid (grid.h): rays over the floor, and what the mask shows along them.
 */
#include "grid/cells.h"

enum { COARSE = 8 };

/* The largest (x^2 + y^2) / z^2 of the image's corners, with a tenth more of the radius for what a
 * lens moves sideways; infinite where a corner has no direction or looks backwards. */
static double outside_of(const struct fovea_camera *camera)
{
    double most = 0;
    for (int i = 0; i < 4; i++) {
        const double pixel[2] = {(i & 1) * camera->width - 0.5, (i >> 1) * camera->height - 0.5};
        double b[3];
        if (fovea_camera_unproject(camera, pixel, b, NULL) != FOVEA_OK || !(b[2] > 0))
            return __builtin_inf();
        const double here = (b[0] * b[0] + b[1] * b[1]) / (b[2] * b[2]);
        most = here > most ? here : most;
    }
    return 1.21 * most;
}

struct fv_grid_look fv_grid_look_of(const struct fovea_grid_view *view)
{
    const struct fovea_segmentation *s = view->seen;
    const double *T = view->T_odom_cam, height = T[11] - fv_grid_floor_at(view, T[3], T[7]);
    struct fv_grid_look look = {.view = view,
                                .from = {T[3], T[7]},
                                .inverse_height = 1 / height,
                                .beside = {T[3] - view->position_m[0], T[7] - view->position_m[1]}};
    look.outside = outside_of(view->camera);
    for (int row = 0; row < 3; row++) {
        for (int k = 0; k < 3; k++)
            look.R[row][k] = T[4 * k + row];
        look.up[row] = -look.R[row][2] * height;
        if (row < 2) look.inverse[row] = 1 / s->raw_scale[row];
    }
    for (int i = 0; i < 256; i++) {
        const uint8_t place = s->index[i];
        const int32_t class_id = place < s->count ? s->list[place].class_id : -1;
        look.of[i] = class_id >= 0 && class_id < 256 ? view->labels[class_id] : FOVEA_GRID_IGNORED;
    }
    return look;
}

/* A ray over the floor from below the camera: one step, in the odometry frame and the camera's, and
 * the variance of the floor's height after i steps, v[0] + 2 v[1] i + v[2] i^2. */
struct ray {
    double x, y, in_camera[3], v[3];
};

static struct ray ray_of(const struct fv_grid_look *look, const double way[2], double step)
{
    const struct fovea_grid_view *view = look->view;
    struct ray ray = {.x = way[0] * step, .y = way[1] * step};
    const double rise = view->floor_slope[0] * ray.x + view->floor_slope[1] * ray.y,
                 *C = view->floor_covariance, *b = look->beside;
    for (int row = 0; row < 3; row++)
        ray.in_camera[row] =
            look->R[row][0] * ray.x + look->R[row][1] * ray.y + look->R[row][2] * rise;
    const double C_way[3] = {C[0] * ray.x + C[1] * ray.y, C[1] * ray.x + C[3] * ray.y,
                             C[2] * ray.x + C[4] * ray.y};
    ray.v[0] = fv_grid_floor_variance(view, look->from[0], look->from[1]);
    ray.v[1] = b[0] * C_way[0] + b[1] * C_way[1] + C_way[2];
    ray.v[2] = ray.x * C_way[0] + ray.y * C_way[1];
    return ray;
}

/* The variance of the distance of the floor's point after i steps, in steps. */
static double variance_at(const struct fv_grid_look *look, const struct ray *ray, int32_t i)
{
    const double steps = i * look->inverse_height;
    return steps * steps * (ray->v[0] + i * (2 * ray->v[1] + i * ray->v[2]));
}

/* Where the mask has a point of the camera's frame, in its pixels; false: it is not in the image.
 */
static bool place_in_mask(const struct fv_grid_look *look, const double point[3], double at[2])
{
    const struct fovea_segmentation *s = look->view->seen;
    double pixel[2];
    const double across = point[0] * point[0] + point[1] * point[1];
    if (look->outside < __builtin_inf() &&
        !(point[2] > 0 && across <= look->outside * point[2] * point[2]))
        return false; /* as most points: less work than to project them */
    if (fovea_camera_project(look->view->camera, point, pixel, NULL) != FOVEA_OK) return false;
    for (int k = 0; k < 2; k++)
        at[k] = (pixel[k] - s->raw_offset[k]) * look->inverse[k] + 0.5;
    return at[0] >= 0 && at[0] < s->width && at[1] >= 0 && at[1] < s->height;
}

int fv_grid_label(const struct fv_grid_look *look, const double point[3])
{
    const struct fovea_segmentation *s = look->view->seen;
    double place[2];
    if (!place_in_mask(look, point, place)) return -1;
    const int64_t at = (int64_t)place[1] * s->width + (int64_t)place[0];
    const int label = look->of[s->pixels[at]];
    return label == FOVEA_GRID_FLOOR && s->confidence != NULL && s->confidence[at] < look->least
               ? FV_GRID_UNSURE
               : label;
}

/* The floor's point after i steps, in the camera's frame. */
static void point_at(const struct fv_grid_look *look, const struct ray *ray, int32_t i,
                     double point[3])
{
    for (int k = 0; k < 3; k++)
        point[k] = look->up[k] + ray->in_camera[k] * i;
}

static int label_at(const struct fv_grid_look *look, const struct ray *ray, int32_t i)
{
    double point[3];
    point_at(look, ray, i, point);
    return fv_grid_label(look, point);
}

/* The first step of a ray at which it is in the image, in large steps at first. */
static int32_t view_begin(const struct fv_grid_look *look, const struct ray *ray, int32_t steps)
{
    int32_t i = 0;
    while (i <= steps && label_at(look, ray, i) < 0)
        i += COARSE;
    while (i > 0 && i <= steps && label_at(look, ray, i - 1) >= 0)
        i--;
    return i;
}

static void mark_step(struct fv_grid *g, const struct fv_grid_look *look, const struct ray *ray,
                      int32_t step, uint8_t mark)
{
    fv_grid_mark(g, look->from[0] + ray->x * step, look->from[1] + ray->y * step, mark);
}

/* Free from where the last call ended up to the steps that would be floor if this one were nearer
 * by its sigma. */
static void free_up_to(struct fv_grid *g, const struct fv_grid_look *look, const struct ray *ray,
                       int32_t step)
{
    struct fv_grid_state *s = g->state;
    for (; s->free <= step; s->free++) {
        const double variance = variance_at(look, ray, s->free), way = step - s->free;
        if (variance >= 1 && variance > way * way) return;
        mark_step(g, look, ray, s->free, FV_GRID_MARK_FREE);
    }
}

/* Of an obstacle whose distance has this variance, in steps: the part of its evidence that is in
 * its cell, in eighths. */
static uint8_t mark_of(double variance, bool movable)
{
    const double root_of_turn = 2.5066282746310002,
                 sigma = variance > 0 ? __builtin_sqrt(variance) : 0,
                 part = FV_GRID_MARK_EIGHTHS * FV_GRID_RAY_STEPS / root_of_turn;
    const int eighths =
        sigma * FV_GRID_MARK_EIGHTHS <= part ? FV_GRID_MARK_EIGHTHS : (int)(part / sigma + 0.5);
    return eighths == 0 ? FV_GRID_MARK_NONE : (uint8_t)(2 * eighths + movable);
}

/* What lies beyond floor is at `step`, and there was floor before: whether that ends, by what two
 * pixels of the mask further show, and how surely, by how far on the floor a pixel spans. */
enum { END_LOOKUPS = 3, END_PIXELS = 2 };
static void end_floor(struct fv_grid *g, const struct fv_grid_look *look, const struct ray *ray,
                      int32_t step)
{
    double point[3], at[2], before[2];
    point_at(look, ray, step, point);
    if (!place_in_mask(look, point, at)) return;
    point_at(look, ray, step - 1, point);
    if (!place_in_mask(look, point, before)) return;
    const double dx = at[0] - before[0], dy = at[1] - before[1], pixels2 = dx * dx + dy * dy;
    if (!(pixels2 > 1e-4)) return; /* a pixel of 50 cells */
    const int32_t further = (int32_t)(END_PIXELS / __builtin_sqrt(pixels2)) + 1;
    const int label = label_at(look, ray, step + further);
    if (label != FOVEA_GRID_BEYOND && label != FOVEA_GRID_OBSTACLE && label != FOVEA_GRID_MOVABLE)
        return;
    mark_step(g, look, ray, step, mark_of(variance_at(look, ray, step) + 1 / pixels2, false));
}

/* Outwards until an obstacle, the end of the floor, of the view or of the range; steps of half a
 * cell. False: the lookups of this piece are used up, and the ray goes on. */
static bool follow_ray(struct fv_grid *g, const struct fv_grid_look *look, int32_t *lookups)
{
    struct fv_grid_state *s = g->state;
    const int32_t steps = fv_grid_steps(g);
    const struct ray ray =
        ray_of(look, g->rays[s->ray], g->config.resolution_m / FV_GRID_RAY_STEPS);
    if (s->step < 0) {
        s->step = s->free = view_begin(look, &ray, steps);
        s->floor = 0;
        *lookups -= (s->step < steps ? s->step : steps) / COARSE + COARSE; /* at most */
    }
    for (; s->step <= steps; s->step++) {
        if (--*lookups < 0) return false;
        const int label = label_at(look, &ray, s->step);
        if (label < 0 || label == FOVEA_GRID_IGNORED) return true;
        if (label == FV_GRID_UNSURE) {
            s->free = s->step + 1;
            continue;
        }
        if (label == FOVEA_GRID_BEYOND) {
            if (s->floor) end_floor(g, look, &ray, s->step);
            *lookups -= s->floor ? END_LOOKUPS : 0;
            return true;
        }
        if (label != FOVEA_GRID_FLOOR) {
            mark_step(g, look, &ray, s->step,
                      mark_of(variance_at(look, &ray, s->step), label == FOVEA_GRID_MOVABLE));
            return true;
        }
        s->floor = 1;
        free_up_to(g, look, &ray, s->step);
    }
    return true;
}

bool fv_grid_follow_rays(struct fv_grid *g, const struct fovea_grid_view *view)
{
    struct fv_grid_state *s = g->state;
    struct fv_grid_look look = fv_grid_look_of(view);
    look.least = (uint8_t)(255 * g->config.floor_confidence + 0.5);
    int32_t lookups = FV_GRID_LOOKUPS;
    while (s->ray < (int32_t)g->config.rays && lookups > 0) {
        if (!follow_ray(g, &look, &lookups)) return false;
        s->ray++;
        s->step = -1;
    }
    return s->ray == (int32_t)g->config.rays;
}
