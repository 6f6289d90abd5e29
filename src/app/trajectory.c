#include "app/trajectory.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/ring.h"
#include "geometry/se3.h"

enum { RING_BYTES = 1 << 20 };

struct fv_trajectory {
    struct fv_ring ring;
    FILE *file;
    uint64_t lost; /* the loop's */

    uint64_t samples, with_truth;
    struct fv_similarity_sums sums;
    double origin_p[3], origin_q[3], last_truth[3], truth_length_m;
    uint32_t points, stride;
    double centres[FV_TRAJECTORY_POINTS_MAX][3], truths[FV_TRAJECTORY_POINTS_MAX][3];
    bool failed;
    uint8_t memory[RING_BYTES];
};

enum fovea_status fv_trajectory_open(const char *path, struct fv_trajectory **trajectory,
                                     struct fovea_error *error)
{
    struct fv_trajectory *opened = aligned_alloc(64, (sizeof *opened + 63) / 64 * 64);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the trajectory");
    memset(opened, 0, sizeof *opened);
    fv_ring_init(&opened->ring, opened->memory, sizeof opened->memory);
    opened->stride = 1;
    if (path != NULL && (opened->file = fopen(path, "we")) == NULL) {
        fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: cannot be written: %s", path, strerror(errno));
        free(opened);
        return FOVEA_ERROR_INPUT;
    }
    *trajectory = opened;
    return FOVEA_OK;
}

/* ---- loop thread
 * ------------------------------------------------------------------------------------------- */

bool fv_trajectory_room(struct fv_trajectory *trajectory)
{
    return trajectory == NULL || fv_ring_room(&trajectory->ring) >= sizeof(struct fv_trajectory_sample);
}

bool fv_trajectory_add(struct fv_trajectory *trajectory, const struct fv_trajectory_sample *sample)
{
    if (trajectory == NULL) return true;
    uint8_t *room = fv_ring_reserve(&trajectory->ring, sizeof *sample);
    if (room == NULL) {
        trajectory->lost++;
        return false;
    }
    memcpy(room, sample, sizeof *sample);
    fv_ring_commit(&trajectory->ring, sizeof *sample);
    return true;
}

/* ---- the other side
 * ---------------------------------------------------------------------------------------- */

static void line_write(struct fv_trajectory *trajectory, const struct fv_trajectory_sample *sample)
{
    double q[4];
    struct fv_se3 pose;
    const double *T = sample->T_world_cam;
    const int64_t second_ns = 1000000000;
    int64_t seconds = sample->stamp_ns / second_ns, rest = sample->stamp_ns % second_ns;
    if (trajectory->file == NULL) return;
    fv_se3_from_rows(T, &pose);
    fv_so3_to_quaternion(pose.R, q);
    int written =
        fprintf(trajectory->file, "%s%" PRId64 ".%09" PRId64 " %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
                sample->stamp_ns < 0 ? "-" : "", seconds < 0 ? -seconds : seconds, rest < 0 ? -rest : rest,
                T[3], T[7], T[11], q[1], q[2], q[3], q[0]);
    if (written < 0) trajectory->failed = true;
}

static void sums_add(struct fv_trajectory *trajectory, const double centre[3], const double truth[3])
{
    struct fv_similarity_sums *sums = &trajectory->sums;
    double p[3], q[3], step2 = 0.0;
    if (trajectory->with_truth == 0) {
        memcpy(trajectory->origin_p, centre, sizeof p);
        memcpy(trajectory->origin_q, truth, sizeof q);
        memcpy(trajectory->last_truth, truth, sizeof q);
    }
    for (int i = 0; i < 3; i++) {
        p[i] = centre[i] - trajectory->origin_p[i];
        q[i] = truth[i] - trajectory->origin_q[i];
        double step = truth[i] - trajectory->last_truth[i];
        step2 += step * step;
        trajectory->last_truth[i] = truth[i];
    }
    for (int i = 0; i < 3; i++) {
        sums->p[i] += p[i];
        sums->q[i] += q[i];
        sums->pp += p[i] * p[i];
        sums->qq += q[i] * q[i];
        for (int j = 0; j < 3; j++)
            sums->qp[3 * i + j] += q[i] * p[j];
    }
    sums->n += 1.0;
    trajectory->with_truth++;
    trajectory->truth_length_m += __builtin_sqrt(step2);
}

static void point_keep(struct fv_trajectory *trajectory, const double centre[3], const double truth[3])
{
    if (trajectory->samples % trajectory->stride != 0) return;
    if (trajectory->points == FV_TRAJECTORY_POINTS_MAX) { /* keep every second one */
        for (uint32_t i = 0; i < FV_TRAJECTORY_POINTS_MAX / 2; i++) {
            memcpy(trajectory->centres[i], trajectory->centres[2 * i], sizeof trajectory->centres[i]);
            memcpy(trajectory->truths[i], trajectory->truths[2 * i], sizeof trajectory->truths[i]);
        }
        trajectory->points /= 2;
        trajectory->stride *= 2;
    }
    memcpy(trajectory->centres[trajectory->points], centre, sizeof trajectory->centres[0]);
    memcpy(trajectory->truths[trajectory->points], truth, sizeof trajectory->truths[0]);
    trajectory->points++;
}

static void take(struct fv_trajectory *trajectory, const struct fv_trajectory_sample *sample)
{
    const double *T = sample->T_world_cam, *Q = sample->truth;
    const double centre[3] = {T[3], T[7], T[11]}, truth[3] = {Q[3], Q[7], Q[11]};
    line_write(trajectory, sample);
    point_keep(trajectory, centre, truth);
    if (sample->has_truth) sums_add(trajectory, centre, truth);
    trajectory->samples++;
}

void fv_trajectory_drain(struct fv_trajectory *trajectory)
{
    size_t bytes;
    const uint8_t *data;
    if (trajectory == NULL) return;
    while ((data = fv_ring_peek(&trajectory->ring, &bytes)) != NULL) {
        struct fv_trajectory_sample sample;
        memcpy(&sample, data, sizeof sample);
        fv_ring_release(&trajectory->ring, sizeof sample);
        take(trajectory, &sample);
    }
}

void fv_trajectory_finish(struct fv_trajectory *trajectory, struct fv_trajectory_summary *summary)
{
    *summary = (struct fv_trajectory_summary){.error_m = NAN, .scale = NAN};
    if (trajectory == NULL) return;
    fv_trajectory_drain(trajectory);
    if (trajectory->file != NULL) {
        if (fclose(trajectory->file) != 0) trajectory->failed = true;
        trajectory->file = NULL;
    }
    summary->samples = trajectory->samples;
    summary->lost = trajectory->lost;
    summary->with_truth = trajectory->with_truth;
    summary->truth_length_m = trajectory->truth_length_m;
    summary->failed = trajectory->failed;
    summary->points = trajectory->points;
    summary->centres = (const double(*)[3])trajectory->centres;
    if (trajectory->with_truth == trajectory->samples)
        summary->truths = (const double(*)[3])trajectory->truths;
    double scale, rotation[9], translation[3], rms;
    if (trajectory->with_truth < 3 ||
        !fv_similarity_fit(&trajectory->sums, &scale, rotation, translation, &rms))
        return;
    summary->scale = scale;
    summary->error_m = rms;
    memcpy(summary->rotation, rotation, sizeof rotation);
    for (int i = 0; i < 3; i++) { /* sums were taken about the first samples */
        double turned = 0.0;
        for (int j = 0; j < 3; j++)
            turned += rotation[3 * i + j] * trajectory->origin_p[j];
        summary->translation[i] = translation[i] + trajectory->origin_q[i] - scale * turned;
    }
}

void fv_trajectory_close(struct fv_trajectory *trajectory)
{
    if (trajectory == NULL) return;
    if (trajectory->file != NULL) fclose(trajectory->file);
    free(trajectory);
}
