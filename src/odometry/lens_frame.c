/* The focal length that one frame fits, landmarks fixed. */
#include <string.h>

#include "geometry/linear.h"
#include "odometry/lens.h"
#include "odometry/odometry.h"

enum { SIZE = 7, POINTS_MIN = 40 };

bool fv_lens_error(const struct fv_map *map, const struct fv_se3 *T, const double point[3],
                   const struct fv_pixel *seen, struct fv_lens_error *error)
{
    double q[3], pixel[2], J[6];
    const double scale = fv_level_scale(seen->level);
    fv_se3_apply(T, point, q);
    if (fovea_camera_project(map->camera, q, pixel, J) != FOVEA_OK) return false;
    error->error[0] = pixel[0] - seen->x * map->pixel_px;
    error->error[1] = pixel[1] - seen->y * map->pixel_px;
    error->weight = 1 / (scale * scale);
    for (int r = 0; r < 2; r++) {
        const double *j = J + 3 * r;
        double *by = error->by[r];
        by[0] = j[0];
        by[1] = j[1];
        by[2] = j[2];
        by[3] = j[2] * q[1] - j[1] * q[2];
        by[4] = j[0] * q[2] - j[2] * q[0];
        by[5] = j[1] * q[0] - j[0] * q[1];
        by[6] = pixel[r] - (r == 0 ? map->camera->cx : map->camera->cy);
        for (int c = 0; c < 3; c++)
            by[7 + c] = j[0] * T->R[c] + j[1] * T->R[3 + c] + j[2] * T->R[6 + c];
    }
    return true;
}

/* Normal equations of pose and focal length. */
struct sums {
    double matrix[SIZE * SIZE], vector[SIZE], cost;
};

static void sums_add(struct sums *sums, const struct fv_lens_error *e)
{
    for (int r = 0; r < 2; r++) {
        for (int a = 0; a < SIZE; a++) {
            const double weighted = e->weight * e->by[r][a];
            sums->vector[a] -= weighted * e->error[r];
            for (int b = 0; b <= a; b++)
                sums->matrix[SIZE * a + b] += weighted * e->by[r][b];
        }
        sums->cost += e->weight * e->error[r] * e->error[r];
    }
}

static void parts_add(struct fv_lens_frame *out, const struct fv_lens_error *e, int part)
{
    out->points++;
    out->error2 += e->error[0] * e->error[0] + e->error[1] * e->error[1];
    out->part_points[part]++;
    for (int r = 0; r < 2; r++)
        out->part_sum_px[part][r] -= (float)e->error[r];
}

bool fv_lens_frame_measure(const struct fv_odometry *o, struct fv_lens_frame *out)
{
    const struct fv_map *map = &o->map;
    const struct fv_map_frame frame = fv_map_frame_at(map, fv_map_current(map));
    const uint32_t stride = o->state->pose.inliers / FV_LENS_FRAME_POINTS + 1;
    struct sums sums;
    memset(out, 0, sizeof *out);
    memset(&sums, 0, sizeof sums);
    if (!o->state->pose.posed || o->state->usable.frozen) return false;
    for (uint32_t f = 0, n = 0; f < frame.keyframe->features; f++) {
        struct fv_lens_error e;
        if (frame.landmark[f] == FV_MAP_NONE || n++ % stride != 0) continue;
        const struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
        if (!fv_lens_error(map, &frame.keyframe->T_cam_world, l->point, &frame.points[f], &e))
            continue;
        sums_add(&sums, &e);
        parts_add(out, &e, fv_map_part(map, &frame.points[f]));
    }
    if (out->points < POINTS_MIN) return false;
    double step[SIZE], last[SIZE] = {0}, left = sums.cost;
    last[SIZE - 1] = 1;
    memcpy(step, sums.vector, sizeof step);
    if (!fv_ldlt_factor(sums.matrix, SIZE)) return false;
    fv_ldlt_back(sums.matrix, SIZE, step);
    fv_ldlt_back(sums.matrix, SIZE, last);
    for (int a = 0; a < SIZE; a++)
        left -= step[a] * sums.vector[a];
    if (left < 0) left = 0;
    out->change = step[SIZE - 1];
    out->sigma = __builtin_sqrt(last[SIZE - 1] * left / (2 * out->points - SIZE));
    out->error2_fitted = sums.cost > 0 ? out->error2 * (left / sums.cost) : 0;
    return true;
}
