/* The focal length that one frame fits, landmarks fixed. */
#include <string.h>

#include "geometry/linear.h"
#include "geometry/vec.h"
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
    uint32_t errors;
};

static void sums_add(struct sums *sums, double weight, double error, const double by[SIZE])
{
    for (int a = 0; a < SIZE; a++) {
        const double weighted = weight * by[a];
        sums->vector[a] -= weighted * error;
        for (int b = 0; b <= a; b++)
            sums->matrix[SIZE * a + b] += weighted * by[b];
    }
    sums->cost += weight * error * error;
    sums->errors++;
}

/* Lenses that zoom alike show a disparity that is larger as the focal length is. */
static void sums_add_distance(struct sums *sums, const struct fv_se3 *T, const double point[3],
                              const struct fv_keypoint *keypoint,
                              const struct fv_inverse_distance *measured)
{
    double q[3], e, by[SIZE];
    const double bearing[3] = {(double)keypoint->bearing[0], (double)keypoint->bearing[1],
                               (double)keypoint->bearing[2]};
    fv_se3_apply(T, point, q);
    if (!fv_inverse_distance_error(measured, bearing, q, &e, by)) return;
    fv_cross3(q, by, by + 3);
    by[SIZE - 1] = e + (double)measured->value;
    sums_add(sums, fv_inverse_distance_robust(measured, e), e, by);
}

static void parts_add(struct fv_lens_frame *out, const struct fv_lens_error *e, int part)
{
    out->points++;
    out->error2 += e->error[0] * e->error[0] + e->error[1] * e->error[1];
    out->part_points[part]++;
    for (int r = 0; r < 2; r++)
        out->part_sum_px[part][r] -= (float)e->error[r];
}

/* The sums of every `stride`-th of the frame's landmarks. */
static void collect(const struct fv_odometry *o, const struct fv_inverse_distance *distances,
                    uint32_t stride, struct sums *sums, struct fv_lens_frame *out)
{
    const struct fv_map *map = &o->map;
    const struct fv_map_frame frame = fv_map_frame_at(map, fv_map_current(map));
    const struct fv_se3 *T = &frame.keyframe->T_cam_world;
    memset(sums, 0, sizeof *sums);
    memset(out, 0, sizeof *out);
    for (uint32_t f = 0, n = 0; f < frame.keyframe->features; f++) {
        struct fv_lens_error e;
        if (frame.landmark[f] == FV_MAP_NONE || n++ % stride != 0) continue;
        const double *point = map->landmarks[frame.landmark[f]].point;
        if (!fv_lens_error(map, T, point, &frame.points[f], &e)) continue;
        for (int r = 0; r < 2; r++)
            sums_add(sums, e.weight, e.error[r], e.by[r]);
        parts_add(out, &e, fv_map_part(map, &frame.points[f]));
        if (distances != NULL)
            sums_add_distance(sums, T, point, &frame.keypoints[f], &distances[f]);
    }
}

bool fv_lens_frame_current(const struct fv_odometry *o, const struct fv_inverse_distance *distances,
                           uint32_t stride, struct fv_lens_frame *out)
{
    struct sums sums;
    collect(o, distances, stride, &sums, out);
    double step[SIZE], last[SIZE] = {0}, left = sums.cost;
    last[SIZE - 1] = 1;
    memcpy(step, sums.vector, sizeof step);
    if (sums.errors <= SIZE || !fv_ldlt_factor(sums.matrix, SIZE)) return false;
    fv_ldlt_back(sums.matrix, SIZE, step);
    fv_ldlt_back(sums.matrix, SIZE, last);
    for (int a = 0; a < SIZE; a++)
        left -= step[a] * sums.vector[a];
    if (left < 0) left = 0;
    out->change = step[SIZE - 1];
    out->sigma_unit = __builtin_sqrt(last[SIZE - 1]);
    out->sigma = out->sigma_unit * __builtin_sqrt(left / (sums.errors - SIZE));
    out->error2_fitted = sums.cost > 0 ? out->error2 * (left / sums.cost) : 0;
    for (int a = 0; a < SIZE - 1; a++)
        out->moved[a] = out->change * last[a] / last[SIZE - 1];
    return true;
}

bool fv_lens_frame_measure(const struct fv_odometry *o, struct fv_lens_frame *out)
{
    const uint32_t stride = o->state->pose.inliers / FV_LENS_FRAME_POINTS + 1;
    return o->state->pose.posed && !o->state->usable.frozen &&
           fv_lens_frame_current(o, NULL, stride, out) && out->points >= POINTS_MIN;
}
