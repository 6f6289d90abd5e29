/* The map: keyframes and landmarks in pools of fixed capacity.
 *
 * Everything is linked by slot number; a slot's generation tells whether it still holds what a link meant.
 * The two links between a keyframe's feature and its landmark (view.landmark[], landmark.observers[]) are
 * kept in step by the functions below, and nothing else writes them. State holds no addresses: the addresses
 * are in struct fv_map, which carving fills again after a copy.
 *
 * Besides the keyframes there are two more views: that of the current frame, and that of the frame that the
 * start waits on. World points are doubles; a feature's bearing and Jacobian are floats (6e-8 rad). Real-time
 * safe; no heap. */
#ifndef FOVEA_MAP_MAP_H
#define FOVEA_MAP_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "geometry/se3.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_MAP_OBSERVERS_MAX = 12, /* keyframes that a landmark remembers */
    FV_MAP_DESCRIPTOR_BYTES = 32,
    FV_MAP_CELL_PX = 24, /* of the grid in which a view's features are looked up */
    FV_MAP_NONE = -1
};

/* A feature of a view, with what geometry needs of it. */
struct fv_keypoint {
    float bearing[3]; /* unit, camera frame */
    float A[6];       /* d(pixel)/d(point) at the bearing, 2x3 row-major */
    float x_px, y_px; /* raw image */
    float weight;     /* 1 / sigma_px^2 */
    uint32_t level;
};

struct fv_keyframe {
    struct fv_se3 T_cam_world;
    int64_t stamp_ns;
    uint64_t number;     /* counts keyframes since the reset, oldest lowest */
    uint32_t generation; /* of the slot */
    uint32_t features;   /* in its view */
    uint32_t landmarks;  /* of its features */
    int32_t parent;      /* slot of the keyframe that its pose is bound to; FV_MAP_NONE: none */
    double depth;        /* median depth of its landmarks when it was made */
    bool used;
    uint8_t reserved[7];
};

struct fv_observer {
    uint16_t keyframe, feature;
};

struct fv_landmark {
    double point[3];          /* world */
    float direction[3];       /* mean unit vector from the cameras that see it to it */
    float distance;           /* from the reference camera, world units */
    uint32_t generation;      /* of the slot */
    uint32_t mark;            /* scratch of gathering: last round that met it */
    uint64_t born;            /* number of the frame */
    uint16_t expected, found; /* frames in which it should have been, and was, seen; both halved when large */
    uint16_t observer_count;
    uint8_t level; /* of the reference observation */
    bool used;
    struct fv_observer observers[FV_MAP_OBSERVERS_MAX]; /* the first is the reference */
    uint8_t descriptor[FV_MAP_DESCRIPTOR_BYTES];
};

struct fv_map_state {
    uint64_t keyframe_number; /* of the next keyframe */
    uint32_t keyframe_count, landmark_count;
    uint32_t free_count; /* of the list of free landmark slots */
    uint32_t mark;
};

struct fv_map_limits {
    uint32_t keyframes, landmarks, features;
    int32_t width, height; /* of the image, for the grid */
};

struct fv_map {
    struct fv_map_limits limits;
    int32_t columns, rows;
    struct fv_map_state *state;
    struct fv_keyframe *keyframes; /* limits.keyframes, then the current frame, then the start's reference */
    struct fv_landmark *landmarks;
    uint32_t *free_landmarks;
    struct fv_keypoint
        *keypoints; /* of view v: limits.features from v * limits.features; likewise the next four */
    uint8_t *descriptors;
    int32_t *links;
    uint16_t *order;
    uint16_t *cells; /* columns * rows + 1 per view */
};

/* One view's pieces. */
struct fv_view {
    struct fv_keyframe *frame;
    struct fv_keypoint *points;
    uint8_t *descriptors;
    int32_t *landmark; /* slot, or FV_MAP_NONE; written by fv_map_link / unlink only, except for the current
                          frame */
    uint16_t *order;   /* features by cell */
    uint16_t *cells;   /* where each cell starts in `order` */
};

void fv_map_carve(struct fv_map *map, const struct fv_map_limits *limits, struct fv_arena *persistent);
/* Empty the map; generations go on rising, so that links from before no longer hold. */
void fv_map_reset(struct fv_map *map);

struct fv_view fv_map_view(const struct fv_map *map, uint32_t slot);
static inline uint32_t fv_map_current(const struct fv_map *map)
{
    return map->limits.keyframes;
}
static inline uint32_t fv_map_waiting(const struct fv_map *map)
{
    return map->limits.keyframes + 1;
}

/* Sort the view's features into its grid. */
void fv_map_sort_view(const struct fv_map *map, uint32_t slot);
/* Copy a view with its frame to another slot; links are not copied. The slot's generation rises. */
void fv_map_copy_view(struct fv_map *map, uint32_t from, uint32_t to);

/* Make a keyframe of a view (current or waiting). Frees the keyframe of lowest number when no slot is free.
 * Returns its slot. */
uint32_t fv_map_add_keyframe(struct fv_map *map, uint32_t from);
/* Drop a keyframe; landmarks that are left with no observer go with it. */
void fv_map_remove_keyframe(struct fv_map *map, uint32_t slot);
/* Drop the oldest keyframes until `wanted` landmark slots are free; at least two keyframes stay. */
void fv_map_make_room(struct fv_map *map, uint32_t wanted);

/* A new landmark without observers; FV_MAP_NONE when the pool is full. */
int32_t fv_map_add_landmark(struct fv_map *map, const double point[3], uint64_t frame_number);
void fv_map_remove_landmark(struct fv_map *map, uint32_t landmark);
/* Feature `feature` of a keyframe sees the landmark. False when either is taken, or the landmark is seen by
 * that keyframe already. A full list of observers gives up its second oldest. */
bool fv_map_link(struct fv_map *map, uint32_t landmark, uint32_t keyframe, uint32_t feature);
void fv_map_unlink(struct fv_map *map, uint32_t landmark, uint32_t keyframe);
/* Recompute direction and distance from observers, and take the descriptor nearest to the others. */
void fv_map_refresh_landmark(struct fv_map *map, uint32_t landmark);

/* ---- guided search ----------------------------------------------------------------------------------- */

struct fv_found {
    int32_t feature; /* FV_MAP_NONE: none */
    uint32_t distance,
        second; /* Hamming distances; second nearest of a similar level, 256 when there is none */
};

/* The feature of a view nearest to `descriptor` within radius_px of (x, y), of levels [level_min, level_max].
 * When `only_free`, features that have a landmark are left out. */
struct fv_found fv_map_search(const struct fv_map *map, const struct fv_kernels *kernels, uint32_t slot,
                              double x_px, double y_px, double radius_px, int level_min, int level_max,
                              const uint8_t *descriptor, bool only_free);

/* The feature without landmark nearest to `descriptor` within `box` (x0 y0 x1 y1, px) whose bearing lies
 * within limit_rad times its level's scale of the plane with the unit normal `normal` (the view's frame). */
struct fv_found fv_map_search_line(const struct fv_map *map, const struct fv_kernels *kernels, uint32_t slot,
                                   const double box[4], const double normal[3], double limit_rad,
                                   int level_min, int level_max, const uint8_t *descriptor);

#ifdef __cplusplus
}
#endif
#endif
