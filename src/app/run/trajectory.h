/* The camera's path: from the loop thread through a wait-free ring to whoever writes it to a file
 * and holds it against the truth. All memory is taken at open, whatever the length of the run.
 *
 * The file has the TUM format: one line "time x y z qx qy qz qw" per posed frame, time in seconds,
 * T_world_cam as it was published with that frame. A line "# map N" precedes the poses of each
 * stretch in one map, since poses of two maps have no common world; readers of the format take it
 * for a comment. A path that ends with a slash is a folder, made where it is not there, with a file
 * map-N.tum per map; those of an earlier run are removed first. The error is the root mean square
 * distance of the camera centres to the truth after the best similarity transform (Umeyama, PAMI
 * 1991), from running sums. Maps that were started after a loss are each aligned by themselves: the
 * first FV_TRAJECTORY_MAPS_MAX of them, later ones are not judged. */
#ifndef FOVEA_APP_RUN_TRAJECTORY_H
#define FOVEA_APP_RUN_TRAJECTORY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

/* Map of samples that are in no map of the run, as the truth: no line says it. */
#define FV_TRAJECTORY_NO_MAP UINT32_MAX

enum { FV_TRAJECTORY_POINTS_MAX = 4096, FV_TRAJECTORY_MAPS_MAX = 64 };

struct fv_trajectory;

struct fv_trajectory_sample {
    int64_t stamp_ns;
    uint32_t map; /* poses of different maps have different worlds */
    double T_world_cam[12];
    bool metric; /* the scale was known: lengths are metres */
    bool has_truth;
    double truth_m[3]; /* of the camera's centre, in the truth's world */
};

/* Bytes that an open trajectory takes. */
size_t fv_trajectory_bytes(void);

/* `path` may be NULL: no file; it stays the caller's, and there until it is closed.
 * FOVEA_ERROR_INPUT: the file cannot be made. Init-only. */
enum fovea_status fv_trajectory_open(const char *path, struct fv_trajectory **trajectory,
                                     struct fovea_error *error);

/* Hand over one posed frame. False, and counted, when the ring is full. Loop thread, real-time
 * safe. */
bool fv_trajectory_add(struct fv_trajectory *trajectory, const struct fv_trajectory_sample *sample);
/* Whether there is room for another; for a loop that may wait. Loop thread. */
bool fv_trajectory_room(struct fv_trajectory *trajectory);

/* Write and sum up what has come. The thread that opened it; at least four times a second. */
void fv_trajectory_drain(struct fv_trajectory *trajectory);

struct fv_trajectory_summary {
    uint64_t samples, lost; /* written; not written since the ring was full */
    uint32_t maps;          /* worlds that the samples are in */
    uint64_t judged;        /* samples that the error is of: with truth, in maps of some extent */
    double truth_length_m;  /* of the path through the samples with truth */
    double error_m;         /* root mean square; NaN when nothing could be judged */
    double scale; /* from the trajectory's unit to metres, of the map with most samples; NaN
                     likewise */
    bool metric;  /* the last sample was in metres, so that the scale should be 1 */
    int failed;   /* 0; or errno: why the file could not be written whole */

    /* Camera centres for a picture: at most FV_TRAJECTORY_POINTS_MAX, evenly thinned; owned by the
     * trajectory. With an error they are aligned to the truth, and those that could not be are NaN.
     * `map_of` counts maps from 0. */
    uint32_t points;
    const double (*centres)[3], (*truths)[3]; /* truths is NULL unless every sample had truth */
    const int64_t *stamps_ns;
    const uint8_t *map_of;
};

/* Drain, and sum up; valid until closed. */
void fv_trajectory_finish(struct fv_trajectory *trajectory, struct fv_trajectory_summary *summary);
void fv_trajectory_close(struct fv_trajectory *trajectory);

/* Best similarity of points p to points q (Umeyama), from sums over samples about any origin: n,
 * sum p, sum q, sum q p^T (row-major), sum |p|^2, sum |q|^2. False without extent. */
struct fv_similarity_sums {
    double n, p[3], q[3], qp[9], pp, qq;
};
/* One more pair. */
void fv_similarity_add(struct fv_similarity_sums *sums, const double p[3], const double q[3]);
bool fv_similarity_fit(const struct fv_similarity_sums *sums, double *scale, double rotation[9],
                       double translation[3], double *rms);

#endif
