/* Multi-object tracking as fovea/objects.h describes it, on the detections of one image at a time.
 *
 * All state lies in pieces carved from the caller's block and holds no addresses. Real-time safe;
 * 100 objects and 100 detections take about 0.1 ms here. */
#ifndef FOVEA_SRC_OBJECTS_H
#define FOVEA_SRC_OBJECTS_H

#include "base/arena.h"
#include "fovea/camera.h"
#include "fovea/detect.h"
#include "fovea/objects.h"
#include "objects/assign.h"
#include "objects/filter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An inference: an image, and what a network found in it. */
struct fv_objects_inference {
    int64_t stamp_ns;
    uint64_t sequence;
    const struct fovea_detection
        *detections; /* by falling score; with the uncertain ones at most FOVEA_DETECTIONS_MAX */
    uint32_t count,
        uncertain;          /* the uncertain ones come last; they continue objects but start none */
    bool posed;             /* T_world_cam holds */
    bool metric;            /* and its unit is the metre */
    uint64_t world;         /* poses of equal `world` share a frame */
    double T_world_cam[12]; /* row-major 3x4, of the image */
};

enum { FV_OBJECT_X = 0, FV_OBJECT_Y, FV_OBJECT_W, FV_OBJECT_H, FV_OBJECT_NUMBERS };

struct fv_object_slot {
    struct fovea_object object; /* as of the last inference */
    struct fv_filter box[FV_OBJECT_NUMBERS];
    struct fv_filter position[3];                   /* in the world */
    uint64_t world;                                 /* of `position` */
    int64_t position_ns;                            /* when `position` was last measured */
    double score_sum;                               /* over its detections */
    uint32_t used, has_position, matched, reserved; /* matched: in this inference */
};

struct fv_objects_state {
    uint64_t next_id, updates, confirmed, sequence, world;
    int64_t stamp_ns;
    uint32_t posed, listed, started, reserved; /* started: the stamp and what follows hold */
    double R_world_cam[9];                     /* of the last inference */
};

/* One side of a pair that may be matched: a prediction or a detection. */
struct fv_object_side {
    double x, y, half_w, half_h, x_variance, y_variance, w_variance, h_variance, x_reach, y_reach;
    int32_t class_id;
};

struct fv_objects {
    const struct fovea_objects_config *config; /* these two are the caller's */
    const struct fovea_camera *camera;
    const double *T_body_cam; /* 3x4 */
    struct fv_objects_state *state;
    struct fv_object_slot *slots; /* count_max */
    struct fovea_object *list;    /* count_max, what is reported */
    /* scratch of an inference */
    float *cost;
    int32_t *rows, *columns, *column_of; /* slots and detections in an assignment */
    struct fv_object_side *sides;        /* by detection */
    uint8_t *taken;                      /* by detection */
    struct fv_assign_scratch *assign;
};

/* `config`, `camera` and `T_body_cam` must stay where they are. Works in counting mode. Init-only.
 */
void fv_objects_carve(struct fv_objects *objects, const struct fovea_objects_config *config,
                      const struct fovea_camera *camera, const double T_body_cam[12],
                      struct fv_arena *persistent, struct fv_arena *frame);

/* Forget all objects; ids go on. */
void fv_objects_reset(struct fv_objects *objects);

/* Take an inference into account. Inferences must come in the order of their stamps; one that does
 * not is passed over. */
void fv_objects_update(struct fv_objects *objects, const struct fv_objects_inference *inference);

void fv_objects_get(const struct fv_objects *objects, struct fovea_objects *list);

/* Boxes (x_min y_min x_max y_max) of the objects of movable classes after the last inference,
 * tentative ones included. At most `capacity`; returns how many. */
uint32_t fv_objects_movable(const struct fv_objects *objects, float (*boxes)[4], uint32_t capacity);

/* ---- parts, one file each -------------------------------------------------------------------- */

/* locate.c: where an object that was just seen is. */
void fv_objects_locate(const struct fv_objects *objects, struct fv_object_slot *slot,
                       const struct fv_objects_inference *inference);
/* sort.c and centroid.c: match the detections of an inference with the predicted slots; sets
 * slot->matched and objects->taken. */
void fv_objects_match_sort(struct fv_objects *objects,
                           const struct fv_objects_inference *inference);
void fv_objects_match_centroid(struct fv_objects *objects,
                               const struct fv_objects_inference *inference);
/* objects.c: a detection becomes part of an object. */
void fv_objects_take(struct fv_objects *objects, struct fv_object_slot *slot,
                     const struct fv_objects_inference *inference, uint32_t detection);

#ifdef __cplusplus
}
#endif
#endif
