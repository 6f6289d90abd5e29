#include "poses.h"

#include <stdlib.h>
#include <string.h>

#include "support/text.h"
#include "lines.h"

/* ---- reading --------------------------------------------------------------------------------- */

static enum fovea_status parse_pose(const struct fv_lines *lines, enum fv_poses_layout layout,
                                    struct fv_pose *pose, struct fovea_error *error)
{
    const char *stamp = lines->fields[0];
    double numbers[7];
    if (layout == FV_POSES_EUROC ? !fv_text_integer(stamp, &pose->stamp_ns)
                                 : !fv_stamp_from_seconds(stamp, &pose->stamp_ns))
        return fv_lines_refuse(lines, "timestamp", stamp,
                               layout == FV_POSES_EUROC ? "whole nanoseconds" : "seconds", error);
    const enum fovea_status status = fv_lines_numbers(lines, "pose", 1, 7, numbers, error);
    if (status != FOVEA_OK) return status;
    memcpy(pose->position_m, numbers, sizeof pose->position_m);
    double *q = pose->rotation_wxyz;
    const double *found = numbers + 3;
    const int w_at = layout == FV_POSES_EUROC ? 0 : 3, x_at = layout == FV_POSES_EUROC ? 1 : 0;
    q[0] = found[w_at];
    for (int i = 0; i < 3; i++)
        q[1 + i] = found[x_at + i];
    const double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(square > 0.9025 && square < 1.1025))
        return fv_lines_refuse(lines, "rotation", lines->fields[4], "a unit quaternion", error);
    const double length = __builtin_sqrt(square);
    for (int i = 0; i < 4; i++)
        q[i] /= length;
    return FOVEA_OK;
}

/* Room for one element more than `count`: the list itself, moved if need be, or NULL. */
static void *grow(void *list, size_t count, size_t *capacity, size_t size,
                  struct fovea_error *error)
{
    if (list != NULL && count < *capacity) return list;
    const size_t larger = *capacity == 0 ? 256 : *capacity * 2;
    void *moved = realloc(list, larger * size);
    if (moved == NULL)
        fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory for %zu poses", larger);
    else
        *capacity = larger;
    return moved;
}

static enum fovea_status read_by_stamp(struct fv_lines *lines, enum fv_poses_layout layout,
                                       struct fv_poses *poses, struct fovea_error *error)
{
    size_t capacity = 0;
    enum fovea_status status;
    while ((status = fv_lines_next(lines, layout == FV_POSES_EUROC ? "," : "", error)) ==
           FOVEA_OK) {
        struct fv_pose *list = grow(poses->by_stamp, poses->count, &capacity, sizeof *list, error);
        if (list == NULL) return FOVEA_ERROR_SYSTEM;
        poses->by_stamp = list;
        struct fv_pose *pose = &list[poses->count];
        if ((status = parse_pose(lines, layout, pose, error)) != FOVEA_OK) return status;
        if (poses->count > 0 && pose->stamp_ns <= pose[-1].stamp_ns)
            return fv_lines_refuse(lines, "timestamp", lines->fields[0],
                                   "one later than on the line before", error);
        poses->count++;
    }
    poses->heap_bytes = capacity * sizeof(struct fv_pose);
    return status == FOVEA_END ? FOVEA_OK : status;
}

static enum fovea_status read_by_index(struct fv_lines *lines, struct fv_poses *poses,
                                       struct fovea_error *error)
{
    size_t capacity = 0;
    enum fovea_status status;
    while ((status = fv_lines_next(lines, "", error)) == FOVEA_OK) {
        double(*list)[12] = grow(poses->by_index, poses->count, &capacity, sizeof *list, error);
        if (list == NULL) return FOVEA_ERROR_SYSTEM;
        poses->by_index = list;
        status = fv_lines_numbers(lines, "pose", 0, 12, list[poses->count], error);
        if (status != FOVEA_OK) return status;
        poses->count++;
    }
    poses->heap_bytes = capacity * sizeof poses->by_index[0];
    return status == FOVEA_END ? FOVEA_OK : status;
}

enum fovea_status fv_poses_read(const char *path, enum fv_poses_layout layout,
                                const double T_body_cam[12], struct fv_poses *poses,
                                struct fovea_error *error)
{
    struct fv_lines lines;
    struct fv_poses found = {0};
    enum fovea_status status = fv_lines_open(&lines, path, error);
    if (status != FOVEA_OK) return status;
    status = read_by_stamp(&lines, layout, &found, error);
    fv_lines_close(&lines);
    memcpy(found.T_body_cam, T_body_cam, sizeof found.T_body_cam);
    if (status == FOVEA_OK)
        *poses = found;
    else
        fv_poses_free(&found);
    return status;
}

enum fovea_status fv_poses_read_kitti(const char *path, struct fv_poses *poses,
                                      struct fovea_error *error)
{
    struct fv_lines lines;
    struct fv_poses found = {0};
    enum fovea_status status = fv_lines_open(&lines, path, error);
    if (status != FOVEA_OK) return status;
    status = read_by_index(&lines, &found, error);
    fv_lines_close(&lines);
    if (status == FOVEA_OK)
        *poses = found;
    else
        fv_poses_free(&found);
    return status;
}

void fv_poses_free(struct fv_poses *poses)
{
    free(poses->by_stamp);
    free(poses->by_index);
    *poses = (struct fv_poses){0};
}

/* ---- asking ---------------------------------------------------------------------------------- */

static void to_matrix(const double q[4], const double t[3], double T[12])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double R[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    for (int i = 0; i < 3; i++) {
        memcpy(T + 4 * i, R + 3 * i, 3 * sizeof R[0]);
        T[4 * i + 3] = t[i];
    }
}

static void compose(const double A[12], const double B[12], double C[12])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            C[4 * i + j] = A[4 * i] * B[j] + A[4 * i + 1] * B[4 + j] + A[4 * i + 2] * B[8 + j] +
                           (j == 3 ? A[4 * i + 3] : 0.0);
}

static void interpolate(const struct fv_pose *a, const struct fv_pose *b, double fraction,
                        double q[4], double t[3])
{
    double dot = 0.0, square = 0.0;
    for (int i = 0; i < 4; i++)
        dot += a->rotation_wxyz[i] * b->rotation_wxyz[i];
    const double sign = dot < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < 4; i++) {
        q[i] = (1.0 - fraction) * a->rotation_wxyz[i] + fraction * sign * b->rotation_wxyz[i];
        square += q[i] * q[i];
    }
    const double length =
        __builtin_sqrt(square); /* at least 0.7: the two are less than 180 degrees apart */
    for (int i = 0; i < 4; i++)
        q[i] /= length;
    for (int i = 0; i < 3; i++)
        t[i] = (1.0 - fraction) * a->position_m[i] + fraction * b->position_m[i];
}

bool fv_poses_at(const struct fv_poses *poses, int64_t stamp_ns, uint64_t index,
                 double T_world_cam[12])
{
    if (poses->by_index != NULL) {
        if (index >= poses->count) return false;
        memcpy(T_world_cam, poses->by_index[index], 12 * sizeof T_world_cam[0]);
        return true;
    }
    if (poses->count == 0) return false;
    size_t low = 0, high = poses->count; /* first pose later than the stamp */
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (poses->by_stamp[middle].stamp_ns <= stamp_ns)
            low = middle + 1;
        else
            high = middle;
    }
    if (low == 0) return false;
    const struct fv_pose *a = &poses->by_stamp[low - 1], *b = low < poses->count ? a + 1 : a;
    double q[4], t[3], T_world_body[12], fraction = 0.0;
    if (stamp_ns != a->stamp_ns) {
        /* Unsigned: stamps of a hostile file may be further apart than an int64_t holds. */
        const uint64_t gap = (uint64_t)b->stamp_ns - (uint64_t)a->stamp_ns,
                       into = (uint64_t)stamp_ns - (uint64_t)a->stamp_ns;
        if (a == b || gap > (uint64_t)FV_POSES_GAP_NS) return false;
        fraction = (double)into / (double)gap;
    }
    interpolate(a, b, fraction, q, t);
    to_matrix(q, t, T_world_body);
    compose(T_world_body, poses->T_body_cam, T_world_cam);
    return true;
}
