/* Of an update of the grid (grid.h): rays over the floor, and what the mask shows along them.
 */
#include "grid/cells.h"

/* A ray over the floor from below the camera: one step, in the odometry frame and the camera's, and
 * the variance of the floor's height after i steps, v[0] + 2 v[1] i + v[2] i^2. */
struct ray {
    double x, y, in_camera[3], v[3];
};

/* Labels of the next steps of a ray, which are looked up together. */
struct ahead {
    int32_t first, last; /* last exclusive */
    int16_t label[FV_GRID_AHEAD];
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

static int next_label(const struct fv_grid_look *look, const struct ray *ray, int32_t i,
                      struct ahead *ahead)
{
    if (i < ahead->first || i >= ahead->last) {
        fv_grid_labels(look, ray->in_camera, i, ahead->label);
        ahead->first = i;
        ahead->last = i + FV_GRID_AHEAD;
    }
    return ahead->label[i - ahead->first];
}

/* The first step of a ray at which it is in the image, in large steps at first. */
static int32_t view_begin(const struct fv_grid_look *look, const struct ray *ray, int32_t steps)
{
    int16_t before[FV_GRID_AHEAD];
    int32_t i = 0;
    for (;; i += FV_GRID_AHEAD) {
        double point[3];
        point_at(look, ray, i, point);
        if (i > steps || (!(point[2] > 0) && !(ray->in_camera[2] > 0))) return steps + 1;
        if (fv_grid_label(look, point) >= 0) break;
    }
    if (i == 0) return 0;
    fv_grid_labels(look, ray->in_camera, i - FV_GRID_AHEAD, before);
    for (int k = FV_GRID_AHEAD; k > 0 && before[k - 1] >= 0; k--)
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
    const struct fv_grid_window in = fv_grid_window_of(g);
    const double inverse = 1 / g->config.resolution_m, x = look->from[0] * inverse,
                 y = look->from[1] * inverse, dx = ray->x * inverse, dy = ray->y * inverse;
    int32_t free = g->state->free;
    for (; free <= step; free++) {
        const double variance = variance_at(look, ray, free), way = step - free;
        if (variance >= 1 && variance > way * way) break;
        fv_grid_mark_in(&in, fv_grid_whole(x + dx * free), fv_grid_whole(y + dy * free),
                        FV_GRID_MARK_FREE);
    }
    g->state->free = free;
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
    if (!fv_grid_in_mask(look, point, at)) return;
    point_at(look, ray, step - 1, point);
    if (!fv_grid_in_mask(look, point, before)) return;
    const double dx = at[0] - before[0], dy = at[1] - before[1], pixels2 = dx * dx + dy * dy;
    if (!(pixels2 > 1e-4)) return; /* a pixel of 50 cells */
    const int32_t further = (int32_t)(END_PIXELS / __builtin_sqrt(pixels2)) + 1;
    const int label = label_at(look, ray, step + further);
    if (label != FOVEA_GRID_BEYOND && label != FOVEA_GRID_OBSTACLE && label != FOVEA_GRID_MOVABLE)
        return;
    mark_step(g, look, ray, step, mark_of(variance_at(look, ray, step) + 1 / pixels2, false));
}

/* A ray shows something that is neither floor nor what may be: what that says of its cell. */
static void end_ray(struct fv_grid *g, const struct fv_grid_look *look, const struct ray *ray,
                    int label, int32_t *lookups)
{
    const int32_t step = g->state->step;
    if (label == FOVEA_GRID_BEYOND && g->state->floor) {
        end_floor(g, look, ray, step);
        *lookups -= END_LOOKUPS;
    }
    if (label == FOVEA_GRID_OBSTACLE || label == FOVEA_GRID_MOVABLE)
        mark_step(g, look, ray, step,
                  mark_of(variance_at(look, ray, step), label == FOVEA_GRID_MOVABLE));
}

/* Where a ray comes into the image there is something movable already: its foot is nearer, hidden
 * from the camera, as likely as not in each cell up to the robot's edge, for a way that such things
 * are wide. What does not move was seen from farther away before. */
static void mark_hidden(struct fv_grid *g, const struct fv_grid_look *look, const struct ray *ray,
                        int32_t *lookups)
{
    const uint8_t half = FV_GRID_MARK_OCCUPIED / 2 + 1; /* of the evidence, and it may move */
    const double wide_m = 0.3, least = g->config.robot_radius_m;
    const int32_t begin = g->state->begin,
                  count = (int32_t)(wide_m * FV_GRID_RAY_STEPS / g->config.resolution_m);
    for (int32_t i = begin > count ? begin - count : 0; i < begin; i++) {
        const double dx = look->from[0] + ray->x * i - g->state->position_m[0],
                     dy = look->from[1] + ray->y * i - g->state->position_m[1];
        if (dx * dx + dy * dy > least * least) mark_step(g, look, ray, i, half);
        --*lookups;
    }
}

/* All steps since the last call up to this one were floor. */
static void end_run(struct fv_grid *g, const struct fv_grid_look *look, const struct ray *ray,
                    int32_t step)
{
    if (g->state->free >= step) return;
    g->state->floor = 1;
    free_up_to(g, look, ray, step - 1);
}

/* Outwards until an obstacle, the end of the floor, of the view or of the range; steps of half a
 * cell. False: the lookups of this piece are used up, and the ray goes on. */
static bool follow_ray(struct fv_grid *g, const struct fv_grid_look *look, int32_t *lookups)
{
    struct fv_grid_state *s = g->state;
    struct ahead ahead = {0};
    const int32_t steps = fv_grid_steps(g);
    const struct ray ray =
        ray_of(look, g->rays[s->ray], g->config.resolution_m / FV_GRID_RAY_STEPS);
    if (s->step < 0) {
        s->step = s->free = view_begin(look, &ray, steps);
        s->begin = (uint16_t)s->step;
        s->floor = 0;
        *lookups -=
            (s->step < steps ? s->step : steps) / FV_GRID_AHEAD + FV_GRID_AHEAD; /* at most */
    }
    int32_t step = s->step;
    for (; step <= steps && *lookups > 0; step++) {
        const int label = next_label(look, &ray, step, &ahead);
        --*lookups;
        if (label == FOVEA_GRID_FLOOR) continue;
        end_run(g, look, &ray, step);
        s->step = step;
        if (label != FV_GRID_UNSURE) {
            if (label == FOVEA_GRID_MOVABLE && step == s->begin)
                mark_hidden(g, look, &ray, lookups);
            end_ray(g, look, &ray, label, lookups);
            return true;
        }
        s->free = step + 1;
    }
    end_run(g, look, &ray, step);
    s->step = step;
    return step > steps;
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
