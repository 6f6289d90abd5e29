#include "app/trajectory.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/ring.h"
#include "geometry/se3.h"

enum { RING_BYTES = 1 << 20 };

struct posed {
    int64_t stamp_ns;
    double T_world_cam[12];
};

struct fv_trajectory {
    FILE *file;
    char path[512];
    struct fv_ring ring;
    atomic_uint overrun; /* poses that found the ring full */
    uint8_t memory[RING_BYTES];
};

enum fovea_status fv_trajectory_open(const char *path, struct fv_trajectory **trajectory, struct fovea_error *error)
{
    struct fv_trajectory *opened = calloc(1, sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory");
    opened->file = fopen(path, "we");
    if (opened->file == NULL) {
        free(opened);
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: cannot be written: %s", path, strerror(errno));
    }
    snprintf(opened->path, sizeof opened->path, "%s", path);
    fv_ring_init(&opened->ring, opened->memory, RING_BYTES);
    *trajectory = opened;
    return FOVEA_OK;
}

void fv_trajectory_add(struct fv_trajectory *trajectory, int64_t stamp_ns, const struct fovea_pose *pose)
{
    if (trajectory == NULL || !pose->posed) return;
    struct posed *posed = (struct posed *)(void *)fv_ring_reserve(&trajectory->ring, sizeof *posed);
    if (posed == NULL) {
        atomic_fetch_add(&trajectory->overrun, 1);
        return;
    }
    posed->stamp_ns = stamp_ns;
    memcpy(posed->T_world_cam, pose->T_world_cam, sizeof posed->T_world_cam);
    fv_ring_commit(&trajectory->ring, sizeof *posed);
}

static void write_one(FILE *file, const struct posed *posed)
{
    struct fv_se3 T;
    double q[4];
    fv_se3_from_rows(posed->T_world_cam, &T);
    fv_so3_to_quaternion(T.R, q);
    fprintf(file, "%" PRId64 ".%09" PRId64 " %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", posed->stamp_ns / 1000000000,
            posed->stamp_ns % 1000000000, T.t[0], T.t[1], T.t[2], q[1], q[2], q[3], q[0]);
}

void fv_trajectory_drain(struct fv_trajectory *trajectory)
{
    size_t bytes;
    const uint8_t *data;
    if (trajectory == NULL) return;
    while ((data = fv_ring_peek(&trajectory->ring, &bytes)) != NULL) {
        for (size_t at = 0; at + sizeof(struct posed) <= bytes; at += sizeof(struct posed)) {
            struct posed posed;
            memcpy(&posed, data + at, sizeof posed);
            write_one(trajectory->file, &posed);
        }
        fv_ring_release(&trajectory->ring, bytes);
    }
}

enum fovea_status fv_trajectory_close(struct fv_trajectory *trajectory, struct fovea_error *error)
{
    if (trajectory == NULL) return FOVEA_OK;
    fv_trajectory_drain(trajectory);
    bool failed = ferror(trajectory->file) != 0;
    failed = fclose(trajectory->file) != 0 || failed;
    const unsigned overrun = atomic_load(&trajectory->overrun);
    enum fovea_status status = FOVEA_OK;
    if (failed) {
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: could not be written whole", trajectory->path);
    } else if (overrun > 0) {
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: %u poses came faster than they could be written",
                                 trajectory->path, overrun);
    }
    free(trajectory);
    return status;
}
