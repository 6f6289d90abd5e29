#include "app/run/trajectory.h"

#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "support/aligned.h"
#include "base/ring.h"
#include "support/output.h"
#include "geometry/se3.h"

enum { RING_BYTES = 1 << 17 }; /* 0.8 s at 1 kHz; it is emptied four times a second */

/* One world, aligned by itself. Sums are taken about its first sample, which keeps their digits. */
struct map {
    uint32_t id;
    struct fv_similarity_sums sums;
    double origin_p[3], origin_q[3];
};

struct fv_trajectory {
    struct fv_ring ring;
    struct fv_output output;
    FILE *file;         /* its stream; NULL: no file */
    const char *folder; /* NULL: one file; else with a slash at its end, and a file per map in it */
    uint64_t lost;      /* the loop's */

    uint64_t samples, with_truth;
    double last_truth[3], truth_length_m;
    /* world of the last sample, and its index; worlds so far, those met again not counted */
    uint32_t last_id, last, maps;
    uint32_t largest_id; /* of all maps so far */
    bool headed;         /* a sample was written, so its map has a comment line */
    uint32_t headed_id;
    struct map map[FV_TRAJECTORY_MAPS_MAX];
    uint32_t points, stride;
    int failed; /* errno of the first failure */
    bool metric;
    uint8_t memory[RING_BYTES];

    /* Never the loop's, so their pages may wait until they are needed: short runs stay smaller. */
    uint8_t map_of[FV_TRAJECTORY_POINTS_MAX];
    int64_t stamps_ns[FV_TRAJECTORY_POINTS_MAX];
    double centres[FV_TRAJECTORY_POINTS_MAX][3], truths[FV_TRAJECTORY_POINTS_MAX][3];
};

size_t fv_trajectory_bytes(void)
{
    return sizeof(struct fv_trajectory);
}

/* map-N.tum, as file_choose writes it. */
static bool is_of_map(const char *name)
{
    static const char before[] = "map-", after[] = ".tum";
    const size_t digits =
        strncmp(name, before, sizeof before - 1) == 0 ? strspn(name + 4, "0123456789") : 0;
    return digits > 0 && strcmp(name + sizeof before - 1 + digits, after) == 0;
}

/* The folder, without the maps of an earlier run, which would pass for this one's. */
static enum fovea_status folder_open(const char *folder, struct fovea_error *error)
{
    DIR *list = mkdir(folder, 0777) == 0 || errno == EEXIST ? opendir(folder) : NULL;
    if (list == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: the folder cannot be made: %s",
                               folder, strerror(errno));
    enum fovea_status status = FOVEA_OK;
    for (const struct dirent *entry; status == FOVEA_OK && (entry = readdir(list)) != NULL;)
        if (is_of_map(entry->d_name) && unlinkat(dirfd(list), entry->d_name, 0) != 0)
            status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                     "%.200s%.60s: an earlier run's, cannot be removed: %s", folder,
                                     entry->d_name, strerror(errno));
    closedir(list);
    return status;
}

enum fovea_status fv_trajectory_open(const char *path, struct fv_trajectory **trajectory,
                                     struct fovea_error *error)
{
    struct fv_trajectory *opened = fv_aligned_new(sizeof *opened);
    if (opened == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the trajectory");
    memset(opened, 0, offsetof(struct fv_trajectory, map_of));
    fv_ring_init(&opened->ring, opened->memory, sizeof opened->memory);
    opened->stride = 1;
    opened->output = FV_OUTPUT_CLOSED;
    enum fovea_status status = FOVEA_OK;
    if (path != NULL && path[0] != '\0' && path[strlen(path) - 1] == '/') {
        status = folder_open(path, error);
        opened->folder = path;
        path = NULL;
    }
    if (path != NULL) status = fv_output_open(&opened->output, path, FV_OUTPUT_STREAM, error);
    if (status == FOVEA_OK && path != NULL &&
        (opened->file = fv_output_stream(&opened->output)) == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.200s: out of memory", path);
    if (status != FOVEA_OK) {
        fv_trajectory_close(opened);
        return status;
    }
    *trajectory = opened;
    return FOVEA_OK;
}

/* ---- loop thread ----------------------------------------------------------------------------- */

bool fv_trajectory_room(struct fv_trajectory *trajectory)
{
    return trajectory == NULL ||
           fv_ring_room(&trajectory->ring) >= sizeof(struct fv_trajectory_sample);
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

/* ---- the other side -------------------------------------------------------------------------- */

/* Close the file, and note the first failure. */
static void file_close(struct fv_trajectory *trajectory)
{
    if (trajectory->file == NULL) return;
    errno = 0;
    if (fv_output_close(&trajectory->output, NULL) != FOVEA_OK && trajectory->failed == 0)
        trajectory->failed = errno != 0 ? errno : EIO;
    trajectory->file = NULL;
}

/* In a folder, the file of the sample's map: a new one, or, in a map that was met before, its end.
 */
static void file_choose(struct fv_trajectory *trajectory, const struct fv_trajectory_sample *sample,
                        bool met_before)
{
    char path[FV_OUTPUT_PATH_BYTES];
    if (trajectory->folder == NULL || (trajectory->headed && trajectory->headed_id == sample->map))
        return;
    file_close(trajectory);
    snprintf(path, sizeof path, "%.*smap-%" PRIu32 ".tum", FV_OUTPUT_PATH_BYTES - 32,
             trajectory->folder, sample->map);
    errno = 0;
    const enum fovea_status status =
        met_before ? fv_output_append(&trajectory->output, path, NULL)
                   : fv_output_open(&trajectory->output, path, FV_OUTPUT_STREAM, NULL);
    if (status == FOVEA_OK) trajectory->file = fv_output_stream(&trajectory->output);
    if (trajectory->file == NULL && trajectory->failed == 0)
        trajectory->failed = errno != 0 ? errno : EIO;
}

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
    if (sample->map != FV_TRAJECTORY_NO_MAP &&
        (!trajectory->headed || trajectory->headed_id != sample->map) &&
        fprintf(trajectory->file, "# map %" PRIu32 "\n", sample->map) < 0 &&
        trajectory->failed == 0)
        trajectory->failed = errno;
    trajectory->headed = true;
    trajectory->headed_id = sample->map;
    int written = fprintf(trajectory->file,
                          "%s%" PRId64 ".%09" PRId64 " %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
                          sample->stamp_ns < 0 ? "-" : "", seconds < 0 ? -seconds : seconds,
                          rest < 0 ? -rest : rest, T[3], T[7], T[11], q[1], q[2], q[3], q[0]);
    if (written < 0 && trajectory->failed == 0) trajectory->failed = errno;
}

static void length_add(struct fv_trajectory *trajectory, const double truth[3])
{
    double step2 = 0.0;
    for (int i = 0; i < 3; i++) {
        double step = trajectory->with_truth > 0 ? truth[i] - trajectory->last_truth[i] : 0.0;
        step2 += step * step;
        trajectory->last_truth[i] = truth[i];
    }
    trajectory->with_truth++;
    trajectory->truth_length_m += __builtin_sqrt(step2);
}

static void sums_add(struct map *map, const double centre[3], const double truth[3])
{
    struct fv_similarity_sums *sums = &map->sums;
    double p[3], q[3];
    if (sums->n == 0.0) {
        memcpy(map->origin_p, centre, sizeof p);
        memcpy(map->origin_q, truth, sizeof q);
    }
    for (int i = 0; i < 3; i++) {
        p[i] = centre[i] - map->origin_p[i];
        q[i] = truth[i] - map->origin_q[i];
    }
    fv_similarity_add(sums, p, q);
}

/* Note the world of a sample: one met before, or a new one. Its index, FV_TRAJECTORY_MAPS_MAX for
 * those that are too many to judge. False: it is new. */
static bool map_enter(struct fv_trajectory *trajectory, uint32_t id)
{
    uint32_t known = trajectory->maps < FV_TRAJECTORY_MAPS_MAX ? trajectory->maps
                                                               : FV_TRAJECTORY_MAPS_MAX,
             i = 0;
    while (i < known && trajectory->map[i].id != id)
        i++;
    if (i == FV_TRAJECTORY_MAPS_MAX && trajectory->maps > i && id == trajectory->last_id)
        return true;
    /* Ids rise from map to map: a lower one than the largest is known, also beyond the list. */
    const bool known_by_id = trajectory->maps > 0 && id <= trajectory->largest_id;
    if (!known_by_id) trajectory->largest_id = id;
    trajectory->last = i;
    trajectory->last_id = id;
    if (i < known) return true;
    if (i < FV_TRAJECTORY_MAPS_MAX) trajectory->map[i].id = id;
    trajectory->maps++;
    return i == FV_TRAJECTORY_MAPS_MAX && known_by_id;
}

static void point_keep(struct fv_trajectory *trajectory, int64_t stamp_ns, const double centre[3],
                       const double truth[3])
{
    if (trajectory->samples % trajectory->stride != 0) return;
    if (trajectory->points == FV_TRAJECTORY_POINTS_MAX) { /* keep every second one */
        for (uint32_t i = 0; i < FV_TRAJECTORY_POINTS_MAX / 2; i++) {
            memcpy(trajectory->centres[i], trajectory->centres[2 * i],
                   sizeof trajectory->centres[i]);
            memcpy(trajectory->truths[i], trajectory->truths[2 * i], sizeof trajectory->truths[i]);
            trajectory->map_of[i] = trajectory->map_of[2 * i];
            trajectory->stamps_ns[i] = trajectory->stamps_ns[2 * i];
        }
        trajectory->points /= 2;
        trajectory->stride *= 2;
    }
    memcpy(trajectory->centres[trajectory->points], centre, sizeof trajectory->centres[0]);
    memcpy(trajectory->truths[trajectory->points], truth, sizeof trajectory->truths[0]);
    trajectory->map_of[trajectory->points] = (uint8_t)trajectory->last;
    trajectory->stamps_ns[trajectory->points] = stamp_ns;
    trajectory->points++;
}

static void take(struct fv_trajectory *trajectory, const struct fv_trajectory_sample *sample)
{
    const double *T = sample->T_world_cam, *truth = sample->truth_m;
    const double centre[3] = {T[3], T[7], T[11]};
    file_choose(trajectory, sample, map_enter(trajectory, sample->map));
    trajectory->metric = sample->metric;
    line_write(trajectory, sample);
    point_keep(trajectory, sample->stamp_ns, centre, truth);
    if (sample->has_truth) length_add(trajectory, truth);
    if (sample->has_truth && trajectory->last < FV_TRAJECTORY_MAPS_MAX)
        sums_add(&trajectory->map[trajectory->last], centre, truth);
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

struct fit {
    bool found;
    double scale, rotation[9], translation[3];
};

static void align_point(const struct map *map, const struct fit *fit, double point[3])
{
    double from[3];
    for (int i = 0; i < 3; i++)
        from[i] = point[i] - map->origin_p[i];
    for (int i = 0; i < 3; i++) {
        const double *R = fit->rotation + 3 * i;
        double turned = R[0] * from[0] + R[1] * from[1] + R[2] * from[2];
        point[i] = fit->found ? fit->scale * turned + fit->translation[i] + map->origin_q[i] : NAN;
    }
}

/* Fit every map, and sum up their errors. */
static void judge(struct fv_trajectory *trajectory, struct fv_trajectory_summary *summary)
{
    struct fit fits[FV_TRAJECTORY_MAPS_MAX + 1] = {0};
    double sum2 = 0.0, judged = 0.0, most = 0.0;
    for (uint32_t i = 0; i < trajectory->maps && i < FV_TRAJECTORY_MAPS_MAX; i++) {
        const struct fv_similarity_sums *sums = &trajectory->map[i].sums;
        struct fit *fit = &fits[i];
        double rms;
        fit->found = sums->n >= 3.0 &&
                     fv_similarity_fit(sums, &fit->scale, fit->rotation, fit->translation, &rms);
        if (!fit->found) continue;
        sum2 += sums->n * rms * rms;
        judged += sums->n;
        if (sums->n > most) summary->scale = fit->scale;
        if (sums->n > most) most = sums->n;
    }
    if (!(judged > 0.0)) return;
    summary->judged = (uint64_t)judged;
    summary->error_m = __builtin_sqrt(sum2 / judged);
    for (uint32_t i = 0; i < trajectory->points; i++) {
        uint8_t map = trajectory->map_of[i];
        align_point(&trajectory->map[map < FV_TRAJECTORY_MAPS_MAX ? map : 0], &fits[map],
                    trajectory->centres[i]);
    }
}

void fv_trajectory_finish(struct fv_trajectory *trajectory, struct fv_trajectory_summary *summary)
{
    *summary = (struct fv_trajectory_summary){.error_m = NAN, .scale = NAN};
    if (trajectory == NULL) return;
    fv_trajectory_drain(trajectory);
    file_close(trajectory);
    summary->samples = trajectory->samples;
    summary->lost = trajectory->lost;
    summary->maps = trajectory->maps;
    summary->truth_length_m = trajectory->truth_length_m;
    summary->failed = trajectory->failed;
    summary->metric = trajectory->metric;
    summary->points = trajectory->points;
    summary->centres = (const double(*)[3])trajectory->centres;
    summary->map_of = trajectory->map_of;
    summary->stamps_ns = trajectory->stamps_ns;
    if (trajectory->with_truth == trajectory->samples)
        summary->truths = (const double(*)[3])trajectory->truths;
    judge(trajectory, summary);
}

void fv_trajectory_close(struct fv_trajectory *trajectory)
{
    if (trajectory == NULL) return;
    fv_output_discard(&trajectory->output);
    free(trajectory);
}
