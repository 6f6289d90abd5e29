/* What points of surfaces say of cells (fovea/grid.h says which count, and why). */
#include "grid/cells.h"

static const double low_m = 0.05, high_m = 1; /* of what a robot would hit, above the floor */
static const double sigmas = 3;
static const double floor_slope = 0.02; /* of the floor ahead against that below the robot */
static const double height_slope = 0.005, height_sigma_m = 0.05; /* of a height that counts */
static const double behind_cells = 0.3; /* what a surface belongs to lies behind it */

/* A point as a surface above the floor. */
struct stands {
    double ahead_m[2]; /* from below the camera */
    double distance_m, height_m, height_sigma_m;
    double point_sigma2; /* of the height without the floor's */
    double in_camera[3];
};

static struct stands stands_of(const struct fv_grid_look *look, const struct fovea_grid_point *p)
{
    const double *T = look->view->T_odom_cam;
    double way[3];
    struct stands s;
    for (int k = 0; k < 3; k++)
        way[k] = (double)p->position_m[k] - T[4 * k + 3];
    for (int row = 0; row < 3; row++)
        s.in_camera[row] =
            look->R[row][0] * way[0] + look->R[row][1] * way[1] + look->R[row][2] * way[2];
    const double flat2 = way[0] * way[0] + way[1] * way[1], d2 = flat2 + way[2] * way[2],
                 along = (double)p->along_m, across = (double)p->across_m;
    s.ahead_m[0] = way[0];
    s.ahead_m[1] = way[1];
    s.distance_m = __builtin_sqrt(flat2);
    const double x = (double)p->position_m[0], y = (double)p->position_m[1];
    s.height_m = (double)p->position_m[2] - fv_grid_floor_at(look->view, x, y);
    s.point_sigma2 = (along * along * way[2] * way[2] + across * across * flat2) / d2;
    s.height_sigma_m = __builtin_sqrt(s.point_sigma2 + floor_slope * floor_slope * flat2 +
                                      fv_grid_floor_variance(look->view, x, y));
    return s;
}

/* Surely what a robot would hit, and its place is known against a cell. */
static bool is_obstacle(const struct fv_grid *g, const struct fovea_grid_point *p,
                        const struct stands *s)
{
    const double reach = sigmas * s->height_sigma_m;
    return s->distance_m > 1e-3 && s->distance_m <= g->config.range_m &&
           (double)p->along_m <= 0.5 * g->config.resolution_m && s->height_m - reach > low_m &&
           s->height_m + reach < high_m;
}

/* A point stands in a cell: that one and those beside are marked once two stand in them. */
static void stand_in(struct fv_grid *g, double x_m, double y_m)
{
    const double cell = g->config.resolution_m;
    const int64_t at = fv_grid_place_at(g, x_m, y_m);
    if (at < 0) return;
    bool another = (g->marks[at] & FV_GRID_MARK_POINT) != 0;
    g->marks[at] |= FV_GRID_MARK_POINT;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            const double x = x_m + dx * cell, y = y_m + dy * cell;
            const int64_t beside = fv_grid_place_at(g, x, y);
            if (beside < 0 || beside == at || !(g->marks[beside] & FV_GRID_MARK_POINT)) continue;
            fv_grid_mark(g, x, y, FV_GRID_MARK_OCCUPIED);
            another = true;
        }
    if (another) fv_grid_mark(g, x_m, y_m, FV_GRID_MARK_OCCUPIED);
}

/* Below the floor: the sight passes it where there is none. */
static bool is_below(const struct stands *s)
{
    return s->height_m + sigmas * s->height_sigma_m < -low_m;
}

/* Its height is known, and its place against a cell. */
static bool has_height(const struct fv_grid *g, const struct fovea_grid_point *p,
                       const struct stands *s)
{
    const double slope = height_slope * s->distance_m;
    return g->heights != NULL && (double)p->along_m <= 0.5 * g->config.resolution_m &&
           s->distance_m > 1e-3 && s->distance_m <= g->config.range_m &&
           s->point_sigma2 + slope * slope <= height_sigma_m * height_sigma_m;
}

/* What it says of a cell: occupied, a height, both or nothing. */
static void take(struct fv_grid *g, const struct fv_grid_look *look,
                 const struct fovea_grid_point *p)
{
    const struct stands s = stands_of(look, p);
    const double camera_m = 1 / look->inverse_height,
                 behind = 1 + (behind_cells * g->config.resolution_m + (double)p->along_m) /
                                  s.distance_m;
    const bool below = is_below(&s), stands = below || is_obstacle(g, p, &s),
               high = has_height(g, p, &s);
    if (!stands && !high) return;
    const int label = fv_grid_label(look, s.in_camera);
    if (label != FOVEA_GRID_FLOOR && label != FOVEA_GRID_OBSTACLE && label != FOVEA_GRID_BEYOND)
        return;
    /* Of the way to the point. */
    const double part = below ? camera_m / (camera_m - s.height_m) : behind,
                 own = s.height_m > low_m ? behind : 1;
    if (stands && s.distance_m * part <= g->config.range_m)
        stand_in(g, look->from[0] + s.ahead_m[0] * part, look->from[1] + s.ahead_m[1] * part);
    if (high)
        fv_grid_height_add(g,
                           fv_grid_place_at(g, look->from[0] + s.ahead_m[0] * own,
                                            look->from[1] + s.ahead_m[1] * own),
                           s.height_m);
}

uint32_t fv_grid_take_points(struct fv_grid *g, const struct fovea_grid_view *view, uint32_t first)
{
    const struct fv_grid_look look = fv_grid_look_of(view);
    const uint32_t left = view->point_count - first,
                   last = left < FV_GRID_POINTS ? view->point_count : first + FV_GRID_POINTS;
    for (uint32_t i = first; i < last; i++)
        take(g, &look, &view->points[i]);
    return last;
}
