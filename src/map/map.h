/* The map: keyframes and landmarks in pools of fixed capacity.
 *
 * Everything is linked by slot number; the generation of a slot shows whether it still holds what a
 * link was made to. The two links between a keyframe's feature and its landmark (frame.landmark[],
 * landmark.observers[]) are kept consistent by the functions below, and nothing else writes them.
 * State holds no addresses: the addresses are in struct fv_map, which carving fills again after a
 * copy.
 *
 * The slots after those of the keyframes hold the current frame, and the FV_MAP_WAITING_MAX frames
 * that initialisation waits on; the links of these are scratch of initialisation. World points are
 * doubles. A frame's features are kept in the order of its grid, as pixels in fixed point (1/64 px
 * up to 1024 pixels, 1/16 px at 4096); bearings and Jacobians follow from the lens model, and are
 * floats (6e-8 rad) where they are kept. Real-time safe; no heap.
 *
 * Several maps may share the pools: each keyframe names its map, and maps have worlds of their own.
 * Landmarks belong to the map of their observers; links never join keyframes of two maps.
 *
 * Rules of a full pool (keep.c). Keyframes: the most redundant one is removed; redundancy is the
 * fraction of its landmarks that at least FV_MAP_ENOUGH_OBSERVERS others see as well. The newest
 * FV_MAP_KEEP_NEWEST of them stay, and those at an edge of a closure are removed only when no other
 * is left. Landmarks: a clock sweep over the pool removes those that were not seen for
 * FV_MAP_UNSEEN_FRAMES frames, first those with few observers. */
#ifndef FOVEA_MAP_MAP_H
#define FOVEA_MAP_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "geometry/se3.h"
#include "fovea/camera.h"
#include "fovea/features.h"
#include "geometry/bearing.h"
#include "geometry/inverse_distance.h"
#include "geometry/sim3.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_MAP_OBSERVERS_MAX = 12, /* keyframes that a landmark remembers */
    FV_MAP_DESCRIPTOR_BYTES = 32,
    FV_MAP_DIRECTION_ONE = 32767,
    FV_MAP_CELL_PX = 24, /* of the grid in which a frame's features are found */
    FV_MAP_KEYFRAMES_MAX = 256,
    FV_MAP_WAITING_MAX = 8,      /* frames held while initialisation waits for parallax */
    FV_MAP_WORLDS_MAX = 8,       /* maps that were left, whose odom frame is remembered */
    FV_MAP_EDGES_MAX = 128,      /* of closures; the oldest gives way */
    FV_MAP_ENOUGH_OBSERVERS = 3, /* besides a keyframe, that make it redundant for a landmark */
    FV_MAP_KEEP_NEWEST =
        16, /* keyframes that are never culled: odometry and its window work on them */
    FV_MAP_UNSEEN_FRAMES = 60, /* before a landmark may be taken from a full pool */
    FV_MAP_FUSE_DISTANCE_MAX =
        50, /* Hamming, of a feature and a landmark that are the same point */
    FV_MAP_NONE = -1
};

/* px^2 of level 0: matches are not better than that, however well the few of a frame agree. */
#define FV_MAP_VARIANCE_MIN 0.05
/* rad: to which gravity must be known to hold roll and pitch of a map. */
#define FV_MAP_GRAVITY_SIGMA 0.02

/* A feature of a frame. */
struct fv_pixel {
    uint16_t x, y; /* raw image, in map->pixel_px */
    uint8_t level, reserved;
};

/* What geometry needs of a feature. */
struct fv_keypoint {
    float bearing[3]; /* unit, camera frame */
    float A[6];       /* d(pixel)/d(point) at the bearing, 2x3 row-major */
    float weight;     /* 1 / sigma_px^2 */
};

struct fv_keyframe {
    struct fv_se3 T_cam_world;
    int64_t stamp_ns;
    uint64_t number;     /* counts keyframes, oldest lowest; never restarts */
    uint32_t generation; /* of the slot */
    uint32_t features;   /* it has */
    uint32_t landmarks;  /* that its features see */
    int32_t parent;      /* slot of the keyframe that its pose is bound to; FV_MAP_NONE: none */
    double depth;        /* median depth of its landmarks when it was made */
    uint32_t map_id;     /* of the map that it belongs to */
    uint16_t redundancy; /* thousandths of its landmarks that enough others see; as last computed */
    bool used;
    bool held;           /* an edge of a closure ends here */
    float unit_variance; /* of the logarithm of its unit of length over the map's; 0 in a new
                            keyframe and in a map from a file (odometry/covariance.h) */
    /* Where its features were seen from, in the axes of the camera whose pose is published, and
     * metres: not 0 where another camera of a rig stood in, in a map in metres. Of that place is
     * T_cam_world; 0 in a map from a file. */
    double seen_from[3];
};

struct fv_observer {
    uint16_t keyframe, feature;
};

struct fv_landmark {
    double point[3]; /* world */
    float distance;  /* from the reference camera, world units */
    float
        spread; /* rms angle (rad) of the rays from its observers around their mean: its parallax */
    uint32_t generation; /* of the slot */
    uint32_t mark;       /* scratch of gathering: the last round that included it */
    uint32_t born, seen; /* numbers of frames, modulo 2^32: first, and last found */
    uint16_t expected,
        found; /* frames in which it should have been, and was, seen; both halved when large */
    int16_t direction[3]; /* mean unit vector from the cameras that see it to it, of
                             FV_MAP_DIRECTION_ONE */
    uint8_t observer_count;
    uint8_t best;  /* the observer whose descriptor is nearest to the others' */
    uint8_t level; /* of the reference observation */
    bool used;
    struct fv_observer observers[FV_MAP_OBSERVERS_MAX]; /* the first is the reference */
};

/* Two keyframes that a closure ties together. */
struct fv_map_edge {
    uint32_t a, b, generation_a, generation_b;
};

/* What is known of the unit of an `odom` frame. Corrections of the map leave it alone. */
struct fv_map_scale {
    uint32_t source; /* enum fovea_scale_source; FOVEA_SCALE_FREE: nothing */
    uint32_t reserved;
    double log_scale, variance; /* natural logarithm of metres per unit, and its variance */
};

/* What is known of gravity in a map, in the mean of its way. Where an `odom` frame has it, its axes
 * are that frame's. Corrections of the map leave it alone. */
struct fv_map_gravity {
    double down[3]; /* unit vector, in which things fall */
    double sigma;   /* of its direction, rad, of an axis; 0: nothing is known */
};

/* The continuous frame in which poses of a map are published, `world` of struct fovea_pose:
 * REP-105's `odom` in the axes of the camera. S_map_world takes its points to the map's own frame,
 * which T_cam_world and points of the map have. Corrections of the map change it, and not the
 * published pose; nor does joining another map. */
struct fv_map_odom {
    uint32_t map_id, odom_id;
    struct fv_sim3 S_map_world;
    struct fv_map_scale scale;
    struct fv_map_gravity gravity;
};

struct fv_map_state {
    uint64_t keyframe_number; /* of the next keyframe */
    uint32_t keyframe_count, landmark_count;
    uint32_t free_count; /* of the list of free landmark slots */
    uint32_t mark;
    uint32_t map_id;     /* of the map that is being made or tracked */
    uint32_t map_next;   /* id of the next map; ids are never used again */
    uint32_t edge_count; /* edges written, modulo FV_MAP_EDGES_MAX the next one's place */
    uint32_t sweep;      /* landmark slot at which the clock sweep for room continues */
    uint32_t odom_id; /* of the frame that poses are published in; that of the map that began it */
    uint32_t left_count; /* maps left, modulo FV_MAP_WORLDS_MAX the next one's place */
    uint32_t
        landmark_top; /* slots from here on were never used: passes over all landmarks end here */
    uint32_t reserved;
    struct fv_sim3 S_map_world; /* of the current map, as are scale and gravity */
    struct fv_map_scale scale;
    struct fv_map_gravity gravity;
    struct fv_map_odom left[FV_MAP_WORLDS_MAX];
};

struct fv_map_limits {
    uint32_t keyframes, landmarks, features;
    int32_t width, height; /* of the image, for the grid */
    bool distances;        /* features may have measured inverse distances */
};

struct fv_map {
    struct fv_map_limits limits;
    const struct fovea_camera *camera;
    const struct fv_bearing_table *bearings;
    int32_t columns, rows;
    double pixel_px; /* unit of a feature's position: a power of two */
    struct fv_map_state *state;
    struct fv_keyframe
        *keyframes; /* limits.keyframes, then the current frame, then the waiting ones */
    struct fv_landmark *landmarks;
    uint32_t *free_landmarks;
    struct fv_map_edge *edges; /* FV_MAP_EDGES_MAX */
    struct fv_pixel
        *points; /* of frame v: limits.features from v * limits.features; likewise the next two */
    uint8_t *descriptors;
    int16_t *links;
    struct fv_keypoint *keypoints; /* of the current and the waiting frames */
    uint16_t *cells;               /* columns * rows + 1 per frame */
    /* as points, metres; NULL without limits.distances */
    struct fv_inverse_distance *distances;
};

/* A frame of the map: a keyframe, the current frame or a waiting one. */
struct fv_map_frame {
    struct fv_keyframe *keyframe; /* its pose and counts, of whatever kind it is */
    struct fv_pixel *points;      /* cell by cell */
    uint8_t *descriptors;
    /* slot, or FV_MAP_NONE; written by fv_map_link / unlink only, except for the current
     * frame */
    int16_t *landmark;
    struct fv_keypoint *keypoints; /* of the current and the waiting frames; NULL for keyframes */
    uint16_t *cells;               /* the first feature of each cell, then the number of features */
};

/* Camera and bearings stay the caller's; their addresses are set anew by carving again after a
 * copy. */
void fv_map_carve(struct fv_map *map, const struct fv_map_limits *limits,
                  const struct fovea_camera *camera, const struct fv_bearing_table *bearings,
                  struct fv_arena *persistent);
/* Empty the map; generations go on rising, so that links from before no longer hold. */
void fv_map_reset(struct fv_map *map);

/* Maps that are taken whole (take.c). `from` was read from a file: give its maps and keyframes
 * numbers without gaps, from 0 on, and forget maps without keyframes. Init-only. */
void fv_map_settle(struct fv_map *from);
/* Before that: the number that a map of the file will have; UINT32_MAX: it has no keyframes, and is
 * not the current one. Init-only. */
uint32_t fv_map_settled_id(const struct fv_map *from, uint32_t map_id);
/* Take a settled map of the same limits in place of what is there. Its maps and keyframes are
 * numbered on from those that there were, generations rise as with fv_map_reset, and frames of
 * landmarks become `frames_later` more. Bounded by the limits. */
void fv_map_take(struct fv_map *map, const struct fv_map *from, uint32_t frames_later);
bool fv_map_same_limits(const struct fv_map *a, const struct fv_map *b);

struct fv_map_frame fv_map_frame_at(const struct fv_map *map, uint32_t slot);
static inline uint32_t fv_map_current(const struct fv_map *map)
{
    return map->limits.keyframes;
}
static inline uint32_t fv_map_waiting(const struct fv_map *map, uint32_t i)
{
    return map->limits.keyframes + 1 + i;
}
static inline uint32_t fv_map_frame_count(const struct fv_map *map)
{
    return map->limits.keyframes + 1 + FV_MAP_WAITING_MAX;
}

/* Parts of the image: the errors of each show whether errors are correlated, as where something
 * moves. */
enum {
    FV_MAP_PART_COLUMNS = 6,
    FV_MAP_PART_ROWS = 4,
    FV_MAP_PARTS = FV_MAP_PART_COLUMNS * FV_MAP_PART_ROWS
};
static inline int fv_map_part(const struct fv_map *map, const struct fv_pixel *p)
{
    const int column = (int)(p->x * map->pixel_px * FV_MAP_PART_COLUMNS / map->limits.width),
              row = (int)(p->y * map->pixel_px * FV_MAP_PART_ROWS / map->limits.height);
    return (row < FV_MAP_PART_ROWS ? row : FV_MAP_PART_ROWS - 1) * FV_MAP_PART_COLUMNS +
           (column < FV_MAP_PART_COLUMNS ? column : FV_MAP_PART_COLUMNS - 1);
}

/* Size of a level's pixels in those of level 0. */
static inline double fv_level_scale(uint32_t level)
{
    static const double scales[FOVEA_PYRAMID_LEVELS_MAX] = {1,      1.2,     1.44,     1.728,
                                                            2.0736, 2.48832, 2.985984, 3.5831808};
    return scales[level & 7];
}

/* Level at which a landmark should appear at this distance, in the landmark's own unit; -1: none. A
 * camera that is nearer than the reference sees it larger, so on a coarser level. */
static inline int fv_map_predict_level(const struct fv_landmark *l, double distance)
{
    double ratio = (double)l->distance / distance;
    int level = l->level;
    for (; ratio > 1.0954 && level < FOVEA_PYRAMID_LEVELS_MAX; ratio /= 1.2) /* half a level */
        level++;
    for (; ratio < 0.9129 && level > -1; ratio *= 1.2)
        level--;
    return level < FOVEA_PYRAMID_LEVELS_MAX ? level : -1;
}

/* ---- frames (keyframe.c) --------------------------------------------------------------------- */

/* Fill the current or a waiting frame: features go cell by cell, those of a cell in their order;
 * those for which the lens model has no bearing are left out. `from`, unless NULL, gets the number
 * of each in `features`. At most limits.features are used. */
void fv_map_fill_frame(const struct fv_map *map, uint32_t slot,
                       const struct fovea_feature *features, const uint8_t *descriptors,
                       uint32_t count, uint16_t *from);
/* Find the cells of a frame whose features are ordered by cell. False: they are not, and the frame
 * cannot be used. */
bool fv_map_index_frame(const struct fv_map *map, uint32_t slot);
/* What geometry needs of a feature. False, and `keypoint` is untouched: the lens model has no
 * bearing there; features of frames have one. */
bool fv_map_keypoint(const struct fv_map *map, const struct fv_pixel *point,
                     struct fv_keypoint *keypoint);
/* The same of several features, in less time; those without a bearing become zeros, which weigh
 * nothing. */
void fv_map_keypoints(const struct fv_map *map, const struct fv_pixel *points, uint32_t count,
                      struct fv_keypoint *keypoints);
/* Bearings of a frame's features, limits.features elements. */
void fv_map_bearings(const struct fv_map *map, uint32_t slot, float (*bearings)[3]);
/* Weighted squared error of a feature that sees the point q (camera frame), px^2; 1e9 behind the
 * camera. */
double fv_map_error2(const struct fv_map *map, const struct fv_pixel *point, const double q[3]);
/* Copy a frame to another slot; links are not copied. The slot's generation rises.
 */
void fv_map_copy_frame(struct fv_map *map, uint32_t from, uint32_t to);

/* Make a keyframe of a frame (current or waiting), in the current map. When no slot is free, the
 * most redundant keyframe goes. Returns its slot. */
uint32_t fv_map_add_keyframe(struct fv_map *map, uint32_t from);
/* Drop a keyframe; landmarks that are left with no observer go with it. */
void fv_map_remove_keyframe(struct fv_map *map, uint32_t slot);
/* Free `wanted` landmark slots, by the rules above; `frame_number` is now. When no landmark may go,
 * the most redundant keyframes do; at least two stay. */
void fv_map_make_room(struct fv_map *map, uint32_t wanted, uint64_t frame_number);

/* A new landmark without observers; FV_MAP_NONE when the pool is full. */
int32_t fv_map_add_landmark(struct fv_map *map, const double point[3], uint64_t frame_number);
void fv_map_remove_landmark(struct fv_map *map, uint32_t landmark);
/* Feature `feature` of a keyframe sees the landmark. False when either is taken, or the landmark is
 * seen by that keyframe already. A full list of observers gives up its second oldest. */
bool fv_map_link(struct fv_map *map, uint32_t landmark, uint32_t keyframe, uint32_t feature);
void fv_map_unlink(struct fv_map *map, uint32_t landmark, uint32_t keyframe);
/* Recompute direction, distance and spread from observers, and choose the descriptor nearest to the
 * others. */
void fv_map_refresh_landmark(struct fv_map *map, uint32_t landmark);
/* A component of a unit vector, as a landmark keeps it. */
static inline int16_t fv_map_direction(double component)
{
    const double scaled = component * FV_MAP_DIRECTION_ONE;
    return (int16_t)(scaled < 0 ? scaled - 0.5 : scaled + 0.5);
}
/* Of a landmark that has observers. */
static inline const uint8_t *fv_map_descriptor(const struct fv_map *map,
                                               const struct fv_landmark *l)
{
    const struct fv_observer o = l->observers[l->best];
    return map->descriptors +
           ((size_t)o.keyframe * map->limits.features + o.feature) * FV_MAP_DESCRIPTOR_BYTES;
}
/* Cosine between the direction in which a landmark was seen and that of a ray of this length. */
static inline double fv_map_cosine(const struct fv_landmark *l, const double ray[3], double length)
{
    return (l->direction[0] * ray[0] + l->direction[1] * ray[1] + l->direction[2] * ray[2]) /
           (FV_MAP_DIRECTION_ONE * length);
}

/* Merge two landmarks that are the same point: `keep` gets what `drop` has, as far as it has
 * room and keyframes do not see both; `drop` goes. */
void fv_map_fuse_landmarks(struct fv_map *map, uint32_t keep, uint32_t drop);

/* ---- measured distances ---------------------------------------------------------------------- */

/* A landmark that one keyframe sees stands on a distance that is known to one part in this number.
 */
#define FV_MAP_KNOWN_PARTS 20.0

/* Of a frame's features; NULL: none are measured. */
static inline struct fv_inverse_distance *fv_map_distances(const struct fv_map *map, uint32_t slot)
{
    return map->distances == NULL ? NULL : map->distances + (size_t)slot * map->limits.features;
}
/* What is known of the `odom` frame of any map, by its id: the current one, or one that was left.
 * False: nothing. */
bool fv_map_odom_of(const struct fv_map *map, uint32_t map_id, struct fv_map_odom *odom);
/* Whether measured distances hold in the current map: its unit is the metre, because it was begun
 * with them. Other maps have a scale at most (fv_map_scale). */
bool fv_map_metric(const struct fv_map *map);
/* The same of any map, by its id. */
bool fv_map_metric_of(const struct fv_map *map, uint32_t map_id);
/* Metres per unit of any map's own frame, as it is now; 0: not known, or no such map. `variance`,
 * unless NULL: of its logarithm. */
double fv_map_scale_of(const struct fv_map *map, uint32_t map_id, double *variance);
/* Gravity in any map's own axes, as they are now. False: not known, or no such map. */
bool fv_map_gravity_of(const struct fv_map *map, uint32_t map_id, struct fv_map_gravity *gravity);
/* The same where it is known well enough to hold a map: to FV_MAP_GRAVITY_SIGMA. */
bool fv_map_upright(const struct fv_map *map, uint32_t map_id, struct fv_map_gravity *gravity);
/* Whether enough is known of where a landmark is: two keyframes see it, or the one that sees it
 * knows its distance. */
bool fv_map_landmark_stands(const struct fv_map *map, const struct fv_landmark *landmark);

/* ---- covisibility, redundancy and maps (keep.c) ---------------------------------------------- */

/* A keyframe that shares landmarks with another. */
struct fv_neighbour {
    uint32_t slot, generation, shared;
};

/* How many landmarks each keyframe shares with a frame's links; `shared` by slot, limits.keyframes
 * elements. */
void fv_map_count_shared(const struct fv_map *map, uint32_t slot, uint16_t *shared);
/* The keyframes that share at least `shared_min` landmarks with a keyframe, most first (of equals
 * the newer), at most `max` (itself left out). Returns their number. */
uint32_t fv_map_neighbours(const struct fv_map *map, uint32_t slot, uint32_t shared_min,
                           struct fv_neighbour *neighbours, uint32_t max);
/* The slot with most in `shared`; of equals the lowest, or the newest keyframe. */
static inline uint32_t fv_map_best_shared(const struct fv_map *map, const uint16_t *shared)
{
    uint32_t best = 0;
    for (uint32_t k = 1; k < map->limits.keyframes; k++)
        if (shared[k] > shared[best]) best = k;
    return best;
}
static inline uint32_t fv_map_best_shared_newest(const struct fv_map *map, const uint16_t *shared)
{
    uint32_t best = 0;
    for (uint32_t k = 1; k < map->limits.keyframes; k++)
        if (shared[k] > shared[best] ||
            (shared[k] == shared[best] && map->keyframes[k].number > map->keyframes[best].number))
            best = k;
    return best;
}
static inline bool fv_map_holds(const struct fv_map *map, uint32_t slot, uint32_t generation)
{
    return map->keyframes[slot].used && map->keyframes[slot].generation == generation;
}

/* Rate a keyframe's redundancy anew. To be called for a keyframe and its neighbours when it has its
 * landmarks. */
void fv_map_rate_keyframe(struct fv_map *map, uint32_t slot);
/* The keyframe that would go next. */
uint32_t fv_map_most_redundant(struct fv_map *map);

/* Remember that a closure ties keyframes a and b. */
void fv_map_add_edge(struct fv_map *map, uint32_t a, uint32_t b);
/* Begin another map in the same pools; its world is new, S_map_world is the identity. */
void fv_map_begin_another(struct fv_map *map);
/* The same in the world of the map before, where S_map_world tells how the new map lies. What was
 * known of gravity stays known, with the variance of the turn that led there. */
void fv_map_continue_in_another(struct fv_map *map, const struct fv_sim3 *S_map_world,
                                double turn_variance);
/* Another map is the current one from now on, with the `odom` frame that it was left with, if that
 * is still known. */
void fv_map_enter(struct fv_map *map, uint32_t map_id);
/* Drop all keyframes of a map, with their landmarks. */
void fv_map_drop(struct fv_map *map, uint32_t map_id);
uint32_t fv_map_count_keyframes(const struct fv_map *map, uint32_t map_id);

/* ---- for those who show a map ---------------------------------------------------------------- */

/* Map and position (its world) of the landmark in a slot below limits.landmarks. False: none. */
bool fv_map_landmark_at(const struct fv_map *map, uint32_t slot, uint32_t *map_id,
                        double position[3]);
/* What others may know of a keyframe. */
struct fv_map_keyframe {
    uint32_t map_id;
    int32_t parent; /* slot of the keyframe that its pose is bound to; FV_MAP_NONE: none */
    uint64_t number;
    int64_t stamp_ns;
    struct fv_se3 T_world_cam; /* in the world of its map */
};
/* The keyframe in a slot below limits.keyframes. False: none, and `keyframe` is untouched. */
bool fv_map_keyframe_at(const struct fv_map *map, uint32_t slot, struct fv_map_keyframe *keyframe);
/* T_world_cam of the camera whose pose is published, at a keyframe or the current frame. */
struct fv_se3 fv_map_camera_at(const struct fv_map *map, uint32_t slot);
struct fv_map_slots {
    uint32_t keyframes, landmarks;
};
static inline struct fv_map_slots fv_map_slot_counts(const struct fv_map *map)
{
    return (struct fv_map_slots){map->limits.keyframes, map->limits.landmarks};
}
static inline uint32_t fv_map_current_id(const struct fv_map *map)
{
    return map->state->map_id;
}

/* ---- guided search --------------------------------------------------------------------------- */

struct fv_found {
    int32_t feature; /* FV_MAP_NONE: none */
    /* Hamming distances; second nearest of a similar level, 256 when there is none */
    uint32_t distance, second;
};

/* Whether a search found one feature: within the distance, and clearly nearer than the second. */
static inline bool fv_map_found_one(const struct fv_found *found, uint32_t distance_max)
{
    const double ratio_max = 0.9; /* D. Lowe, 2004 */
    return found->feature != FV_MAP_NONE && found->distance <= distance_max &&
           !(found->distance > ratio_max * found->second);
}

/* The feature of a frame nearest to `descriptor` within radius_px of (x, y), of levels [level_min,
 * level_max]. When `only_free`, features that have a landmark are left out. */
struct fv_found fv_map_search(const struct fv_map *map, const struct fv_kernels *kernels,
                              uint32_t slot, double x_px, double y_px, double radius_px,
                              int level_min, int level_max, const uint8_t *descriptor,
                              bool only_free);

/* Pixel of a point in the camera frame; false where the image does not show it. */
static inline bool fv_map_project(const struct fv_map *map, const double q[3], double pixel[2])
{
    return fovea_camera_project(map->camera, q, pixel, 0) == FOVEA_OK && pixel[0] >= 0 &&
           pixel[1] >= 0 && pixel[0] < map->limits.width && pixel[1] < map->limits.height;
}

/* The feature of a keyframe that shows a landmark which that keyframe does not see yet, within
 * radius_px (times its level's scale) of where it should appear; FV_MAP_NONE: none fits. When
 * `only_free`, features that have a landmark are left out. */
int32_t fv_map_find_landmark(const struct fv_map *map, const struct fv_kernels *kernels,
                             const struct fv_landmark *l, uint32_t keyframe, double radius_px,
                             bool only_free);

/* The feature without landmark nearest to `descriptor` within `box` (x0 y0 x1 y1, px) whose bearing
 * (of fv_map_bearings) lies within limit_rad times its level's scale of the plane with the unit
 * normal `normal` (camera frame). */
struct fv_found fv_map_search_line(const struct fv_map *map, const struct fv_kernels *kernels,
                                   uint32_t slot, const float (*bearings)[3], const double box[4],
                                   const double normal[3], double limit_rad, int level_min,
                                   int level_max, const uint8_t *descriptor);

#ifdef __cplusplus
}
#endif
#endif
