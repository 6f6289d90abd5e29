/* The tracker: what fovea/track.h says, on detections handed in image by image.
 *
 * All state lies in pieces carved from the caller's block and holds no addresses. Real-time safe;
 * 100 tracks and 100 detections take about 0.1 ms here. */
#ifndef FOVEA_TRACK_TRACK_H
#define FOVEA_TRACK_TRACK_H

#include "base/arena.h"
#include "fovea/camera.h"
#include "fovea/detect.h"
#include "fovea/track.h"
#include "track/assign.h"
#include "track/filter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An image that was looked at, and what was found in it. */
struct fv_track_look {
    int64_t stamp_ns;
    uint64_t sequence;
    const struct fovea_detection
        *detections; /* by falling score; with the uncertain ones at most FOVEA_DETECTIONS_MAX */
    uint32_t count, uncertain; /* the uncertain ones come last; they go on tracks but start none */
    bool posed;                /* T_world_cam holds */
    bool metric;               /* and its unit is the metre */
    uint64_t world;            /* poses of equal `world` share a frame */
    double T_world_cam[12];    /* row-major 3x4, of the image */
};

enum { FV_TRACK_X = 0, FV_TRACK_Y, FV_TRACK_W, FV_TRACK_H, FV_TRACK_NUMBERS };

struct fv_track_slot {
    struct fovea_track track; /* as of the last look */
    struct fv_filter box[FV_TRACK_NUMBERS];
    struct fv_filter place[3];                   /* in the world */
    uint64_t world;                              /* of `place` */
    int64_t place_ns;                            /* when `place` was last measured */
    double score_sum;                            /* over its detections */
    uint32_t used, has_place, matched, reserved; /* matched: in this look */
};

struct fv_track_state {
    uint64_t next_id, updates, confirmed, sequence, world;
    int64_t stamp_ns;
    uint32_t posed, listed, started, reserved; /* started: the stamp and what follows hold */
    double R_world_cam[9];                     /* of the last look */
};

/* One side of a pair that may be matched: a prediction or a detection. */
struct fv_track_side {
    double x, y, half_w, half_h, x_variance, y_variance, w_variance, h_variance, x_reach, y_reach;
    int32_t class_id;
};

struct fv_tracker {
    const struct fovea_track_config *config; /* these two are the caller's */
    const struct fovea_camera *camera;
    const double *T_base_cam; /* 3x4 */
    struct fv_track_state *state;
    struct fv_track_slot *slots; /* tracks_max */
    struct fovea_track *list;    /* tracks_max, what is told */
    /* scratch of a look */
    float *cost;
    int32_t *rows, *columns, *column_of; /* slots and detections in an assignment */
    struct fv_track_side *sides;         /* by detection */
    uint8_t *taken;                      /* by detection */
    struct fv_assign_scratch *assign;
};

/* `config`, `camera` and `T_base_cam` must stay where they are. Works in counting mode. Init-only.
 */
void fv_track_carve(struct fv_tracker *tracker, const struct fovea_track_config *config,
                    const struct fovea_camera *camera, const double T_base_cam[12],
                    struct fv_arena *persistent, struct fv_arena *frame);

/* Forget all tracks; ids go on. */
void fv_track_reset(struct fv_tracker *tracker);

/* Take a look into account. Looks must come in the order of their stamps; one that does not is
 * passed over. */
void fv_track_update(struct fv_tracker *tracker, const struct fv_track_look *look);

void fv_track_get(const struct fv_tracker *tracker, struct fovea_tracks *tracks);

/* Boxes (x_min y_min x_max y_max) of movable classes in the last look, tracked or coasting. At most
 * `capacity`; returns how many. */
uint32_t fv_track_movable(const struct fv_tracker *tracker, float (*boxes)[4], uint32_t capacity);

/* ---- parts, one file each -------------------------------------------------------------------- */

/* locate.c: where a track that was just seen is. */
void fv_track_locate(const struct fv_tracker *tracker, struct fv_track_slot *slot,
                     const struct fv_track_look *look);
/* sort.c and centroid.c: match the detections of a look with the predicted slots; sets
 * slot->matched and tracker->taken. */
void fv_track_match_sort(struct fv_tracker *tracker, const struct fv_track_look *look);
void fv_track_match_centroid(struct fv_tracker *tracker, const struct fv_track_look *look);
/* track.c: a detection becomes part of a track. */
void fv_track_take(struct fv_tracker *tracker, struct fv_track_slot *slot,
                   const struct fv_track_look *look, uint32_t detection);

#ifdef __cplusplus
}
#endif
#endif
