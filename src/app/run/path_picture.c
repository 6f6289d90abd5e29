/* The map and the path of a run from above, beside the truth.
 *
 * Up is the mean of the cameras' upper edges, or the normal of the path's plane where the path is
 * level: so the picture is aligned with the floor, whatever the first camera looked at. Landmarks
 * and closures come from the saved map with most keyframes. It has a world of its own, which is
 * fitted to the path by the keyframes' times. Lengths are metres where truth or a scale source
 * gives them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/lab/map_open.h"
#include "app/run/run_picture.h"
#include "geometry/linear.h"
#include "geometry/vec.h"

enum { LEGEND = 24, SIDE_LINES = 8 };

static const double level_max = 0.3;   /* of the path's extent: thinner, and its plane is level */
static const double upright_min = 0.8; /* cosine between the plane's normal and the cameras' up */
static const double gap_max_s = 1.0;   /* between path points, across which a time is looked up */
static const double stray_fraction =
    0.02; /* of landmarks on each side that do not widen the projection */

/* From a map's world to that of the path that is drawn: q = scale R p + t. */
struct placing {
    bool found;
    double scale, R[9], t[3];
};

/* From the path to the sheet: the plane of `axis`, seen from `up`. */
struct projection {
    double axis[2][3], up[3], low[2], high[2];
    double px_per_unit;
    struct fv_area plot;
};

/* ---- placing the map ------------------------------------------------------------------------- */

/* Where the path was at a time. */
static bool path_at(const struct fv_trajectory_summary *path, int64_t stamp_ns, double centre[3])
{
    for (uint32_t i = 1; i < path->points; i++) {
        const int64_t from = path->stamps_ns[i - 1], to = path->stamps_ns[i];
        if (stamp_ns < from || stamp_ns > to || path->map_of[i] != path->map_of[i - 1] ||
            to <= from || (double)(to - from) * 1e-9 > gap_max_s || isnan(path->centres[i][0]) ||
            isnan(path->centres[i - 1][0]))
            continue;
        const double fraction = (double)(stamp_ns - from) / (double)(to - from);
        for (int k = 0; k < 3; k++)
            centre[k] = (1.0 - fraction) * path->centres[i - 1][k] + fraction * path->centres[i][k];
        return true;
    }
    return false;
}

static void placing_fit(const struct fv_map_open *open, uint32_t map_id,
                        const struct fv_trajectory_summary *path, struct placing *placing)
{
    uint32_t slots[FV_MAP_KEYFRAMES_MAX];
    const uint32_t count = fv_map_open_order(open, map_id, slots);
    struct fv_similarity_sums sums = {0};
    double p[3], q[3], rms;
    for (uint32_t i = 0; i < count; i++) {
        fv_map_open_centre(open, slots[i], p);
        if (!path_at(path, open->map.keyframes[slots[i]].stamp_ns, q)) continue;
        fv_similarity_add(&sums, p, q);
    }
    placing->found =
        sums.n >= 4.0 && fv_similarity_fit(&sums, &placing->scale, placing->R, placing->t, &rms);
}

static void place_point(const struct placing *placing, const double p[3], double q[3])
{
    for (int i = 0; i < 3; i++)
        q[i] = placing->scale * fv_dot3(placing->R + 3 * i, p) + placing->t[i];
}

/* ---- the projection from above --------------------------------------------------------------- */

/* Mean of the keyframes' upward direction (-y of the camera), in the path's world. */
static void cameras_up(const struct fv_map_open *open, uint32_t map_id,
                       const struct placing *placing, double up[3])
{
    uint32_t slots[FV_MAP_KEYFRAMES_MAX];
    const uint32_t count = fv_map_open_order(open, map_id, slots);
    double sum[3] = {0};
    for (uint32_t i = 0; i < count; i++) {
        const double *R = open->map.keyframes[slots[i]].T_cam_world.R;
        for (int k = 0; k < 3; k++)
            sum[k] -= R[3 + k];
    }
    for (int k = 0; k < 3; k++)
        up[k] = fv_dot3(placing->R + 3 * k, sum);
}

static void normalise(double v[3])
{
    const double length = sqrt(fv_dot3(v, v));
    for (int k = 0; k < 3 && length > 0.0; k++)
        v[k] /= length;
}

/* Principal directions of the path, by falling extent. */
static void path_directions(const struct fv_trajectory_summary *path, double values[3], double V[9])
{
    double mean[3] = {0}, S[9] = {0}, count = 0.0;
    for (uint32_t i = 0; i < path->points; i++) {
        if (isnan(path->centres[i][0])) continue;
        for (int r = 0; r < 3; r++)
            mean[r] += path->centres[i][r];
        count += 1.0;
    }
    for (uint32_t i = 0; i < path->points; i++) {
        if (isnan(path->centres[i][0])) continue;
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                S[3 * r + c] += (path->centres[i][r] - mean[r] / count) *
                                (path->centres[i][c] - mean[c] / count);
    }
    fv_eigen_symmetric(S, 3, values, V);
}

/* The axes of the sheet: right, along the path's longest level extent, and away from the reader's
 * feet; seen from above. */
static void axes_choose(const struct fv_trajectory_summary *path, const double camera_up[3],
                        struct projection *projection)
{
    double values[3], V[9], up[3];
    path_directions(path, values, V);
    memcpy(up, camera_up, sizeof up);
    normalise(up);
    const double upright = fv_dot3(V + 6, up);
    if (fv_dot3(up, up) < 0.5 ||
        (fabs(upright) > upright_min && values[2] < level_max * level_max * values[1]))
        for (int k = 0; k < 3; k++)
            up[k] = upright < 0.0 ? -V[6 + k] : V[6 + k];
    const double *longest = fabs(fv_dot3(V, up)) < 0.9 ? V : V + 3;
    const double along = fv_dot3(longest, up);
    for (int k = 0; k < 3; k++)
        projection->axis[0][k] = longest[k] - along * up[k];
    normalise(projection->axis[0]);
    fv_cross3(up, projection->axis[0], projection->axis[1]);
    memcpy(projection->up, up, sizeof up);
}

static void widen(struct projection *projection, const double p[3])
{
    for (int a = 0; a < 2; a++) {
        const double at = fv_dot3(projection->axis[a], p);
        projection->low[a] = fmin(projection->low[a], at);
        projection->high[a] = fmax(projection->high[a], at);
    }
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void widen_landmarks(struct projection *projection, const struct fv_map_open *open,
                            uint32_t map_id, const struct placing *placing)
{
    const uint32_t all = open->map.limits.landmarks;
    double *values = malloc(all * sizeof *values), q[3];
    for (int a = 0; values != NULL && a < 2; a++) {
        uint32_t count = 0;
        for (uint32_t i = 0; i < all; i++) {
            const struct fv_landmark *l = &open->map.landmarks[i];
            if (!l->used || fv_map_open_map_of(open, l) != map_id) continue;
            place_point(placing, l->point, q);
            values[count++] = fv_dot3(projection->axis[a], q);
        }
        if (count == 0) break;
        qsort(values, count, sizeof *values, by_value);
        const uint32_t stray = (uint32_t)(stray_fraction * count);
        projection->low[a] = fmin(projection->low[a], values[stray]);
        projection->high[a] = fmax(projection->high[a], values[count - 1 - stray]);
    }
    free(values);
}

static void projection_fit(struct projection *projection)
{
    const double sides[2] = {projection->plot.width, projection->plot.height};
    projection->px_per_unit = INFINITY;
    for (int a = 0; a < 2; a++)
        if (projection->high[a] > projection->low[a])
            projection->px_per_unit =
                fmin(projection->px_per_unit,
                     0.94 * sides[a] / (projection->high[a] - projection->low[a]));
    if (!isfinite(projection->px_per_unit)) projection->px_per_unit = 1.0;
}

static bool to_sheet(const struct projection *projection, const double p[3], float at[2])
{
    double from[2];
    for (int a = 0; a < 2; a++)
        from[a] =
            (fv_dot3(projection->axis[a], p) - (projection->low[a] + projection->high[a]) / 2) *
            projection->px_per_unit;
    at[0] = (float)(projection->plot.left + projection->plot.width / 2.0 + from[0]);
    at[1] = (float)(projection->plot.top + projection->plot.height / 2.0 - from[1]);
    return fabs(from[0]) < projection->plot.width / 2.0 &&
           fabs(from[1]) < projection->plot.height / 2.0;
}

/* ---- drawing --------------------------------------------------------------------------------- */

static void grid(struct fv_canvas *canvas, const struct projection *projection, double tick)
{
    const struct fv_area *plot = &projection->plot;
    const double pitch = tick * projection->px_per_unit;
    fv_canvas_fill(canvas, plot->left, plot->top, plot->width, plot->height, 0xfafafa);
    for (int k = 0; k * pitch < plot->width; k++)
        fv_canvas_fill(canvas, plot->left + (int)(k * pitch), plot->top, 1, plot->height,
                       FV_PICTURE_GRID);
    for (int k = 0; k * pitch < plot->height; k++)
        fv_canvas_fill(canvas, plot->left, plot->top + (int)(k * pitch), plot->width, 1,
                       FV_PICTURE_GRID);
}

/* Landmarks that many keyframes see are dark. */
static void landmarks_draw(struct fv_canvas *canvas, const struct projection *projection,
                           const struct fv_map_open *open, uint32_t map_id,
                           const struct placing *placing)
{
    for (uint32_t i = 0; i < open->map.limits.landmarks; i++) {
        const struct fv_landmark *l = &open->map.landmarks[i];
        double q[3];
        float at[2];
        if (!l->used || fv_map_open_map_of(open, l) != map_id) continue;
        place_point(placing, l->point, q);
        if (!to_sheet(projection, q, at)) continue;
        const uint32_t grey = l->observer_count > 8 ? 0x48 : 0xb8 - 0x0e * l->observer_count;
        fv_canvas_disc(canvas, at[0], at[1], 0.9F, grey << 16 | grey << 8 | grey);
    }
}

static void closures_draw(struct fv_canvas *canvas, const struct projection *projection,
                          const struct fv_map_open *open, uint32_t map_id,
                          const struct placing *placing)
{
    const struct fv_map *map = &open->map;
    for (uint32_t i = 0; i < map->state->edge_count && i < FV_MAP_EDGES_MAX; i++) {
        const uint32_t ends[2] = {map->edges[i].a, map->edges[i].b};
        float at[2][2];
        if (!map->keyframes[ends[0]].used || map->keyframes[ends[0]].map_id != map_id) continue;
        for (int e = 0; e < 2; e++) {
            double p[3], q[3];
            fv_map_open_centre(open, ends[e], p);
            place_point(placing, p, q);
            (void)to_sheet(projection, q, at[e]);
        }
        fv_canvas_line(canvas, at[0][0], at[0][1], at[1][0], at[1][1], 3.0F, 0xd62728);
        fv_canvas_circle(canvas, at[0][0], at[0][1], 8.0F, 2.0F, 0xd62728);
    }
}

static void path_draw(struct fv_canvas *canvas, const struct projection *projection,
                      const struct fv_trajectory_summary *path)
{
    float last[2] = {0}, at[2];
    for (uint32_t i = 0; path->truths != NULL && i < path->points; i++) {
        (void)to_sheet(projection, path->truths[i], at);
        if (i > 0) fv_canvas_line(canvas, last[0], last[1], at[0], at[1], 5.0F, FV_PICTURE_TRUTH);
        memcpy(last, at, sizeof last);
    }
    bool drawn = false;
    for (uint32_t i = 0; i < path->points; i++) {
        if (isnan(path->centres[i][0])) continue;
        (void)to_sheet(projection, path->centres[i], at);
        if (!drawn || path->map_of[i] != path->map_of[i - 1])
            fv_canvas_circle(canvas, at[0], at[1], 7.0F, 2.0F, FV_PICTURE_OURS);
        else
            fv_canvas_line(canvas, last[0], last[1], at[0], at[1], 2.0F, FV_PICTURE_OURS);
        memcpy(last, at, sizeof last);
        drawn = true;
    }
    if (drawn) fv_canvas_disc(canvas, last[0], last[1], 6.0F, FV_PICTURE_OURS);
}

static void scale_bar(struct fv_canvas *canvas, const struct projection *projection, double tick,
                      const char *unit)
{
    const struct fv_area *plot = &projection->plot;
    const int length = (int)(tick * projection->px_per_unit), left = plot->left + 14,
              base = plot->top + plot->height - 14;
    char label[64];
    snprintf(label, sizeof label, "%.4g %s", tick, unit);
    const int width = fv_canvas_letters_width(FV_PICTURE_TEXT_PX, label);
    fv_canvas_fill(canvas, left - 6, base - 26, (width > length ? width : length) + 12, 34,
                   0xffffff);
    fv_canvas_fill(canvas, left, base - 2, length, 4, FV_PICTURE_INK);
    fv_canvas_letters(canvas, left, base - 8, FV_PICTURE_TEXT_PX, FV_PICTURE_INK, label);
}

static void legend(struct fv_canvas *canvas, const struct fv_area *area, bool truth, bool closures,
                   bool landmarks)
{
    const int base = area->top + area->height - 5;
    int x = fv_picture_legend(canvas, area->left, base, FV_PICTURE_OURS,
                              "path (ring: a map starts, disc: end)");
    if (truth) x = fv_picture_legend(canvas, x, base, FV_PICTURE_TRUTH, "truth");
    if (landmarks) x = fv_picture_legend(canvas, x, base, 0x707070, "landmarks");
    if (closures) fv_picture_legend(canvas, x, base, 0xd62728, "closure");
}

/* ---- the part -------------------------------------------------------------------------------- */

/* The map as the runtime has it at the end. False: there is none yet, or no memory. */
static bool map_take(struct fovea *rt, const struct fovea_config *config, struct fv_map_open *open,
                     uint32_t *map_id)
{
    struct fovea_error error;
    const size_t capacity = fovea_map_bytes_max(config);
    uint8_t *buffer = malloc(capacity);
    if (buffer == NULL) return false;
    const size_t bytes = fovea_map_save(rt, buffer, capacity);
    const bool opened =
        bytes > 0 && fv_map_open_bytes(buffer, bytes, "map", open, &error) == FOVEA_OK;
    free(buffer);
    if (opened && fv_map_open_largest(open, map_id)) return true;
    if (opened) fv_map_open_free(open);
    return false;
}

static const char *unit_of(const struct fv_trajectory_summary *path)
{
    return isfinite(path->scale) || path->metric ? "m" : "median depths at the start";
}

enum fovea_status fv_picture_map(struct fv_canvas *canvas, const struct fv_area *area,
                                 const struct fv_run_picture *picture, struct fovea *rt,
                                 const struct fovea_config *config)
{
    static struct fv_map_open open; /* large */
    const struct fv_trajectory_summary *path = picture->path;
    struct projection projection = {.low = {INFINITY, INFINITY}, .high = {-INFINITY, -INFINITY}};
    struct placing placing = {.found = false};
    double up[3] = {0};
    uint32_t map_id = 0;
    const bool mapped = map_take(rt, config, &open, &map_id);
    if (mapped) placing_fit(&open, map_id, path, &placing);
    if (placing.found) cameras_up(&open, map_id, &placing, up);
    axes_choose(path, up, &projection);
    const struct fv_area rest = fv_picture_title(
        canvas, area, placing.found ? "map and path, from above" : "path, from above");
    projection.plot = (struct fv_area){rest.left, rest.top, rest.width, rest.height - LEGEND};
    for (uint32_t i = 0; i < path->points; i++) {
        widen(&projection, path->centres[i]); /* NaN widens nothing */
        if (path->truths != NULL) widen(&projection, path->truths[i]);
    }
    if (placing.found) widen_landmarks(&projection, &open, map_id, &placing);
    projection_fit(&projection);
    const double tick = fv_picture_tick(projection.plot.width / projection.px_per_unit, SIDE_LINES);
    grid(canvas, &projection, tick);
    if (placing.found) landmarks_draw(canvas, &projection, &open, map_id, &placing);
    path_draw(canvas, &projection, path);
    if (placing.found) closures_draw(canvas, &projection, &open, map_id, &placing);
    scale_bar(canvas, &projection, tick, unit_of(path));
    legend(canvas, area, path->truths != NULL && isfinite(path->scale),
           placing.found && open.map.state->edge_count > 0, placing.found);
    if (mapped) fv_map_open_free(&open);
    return FOVEA_OK;
}
