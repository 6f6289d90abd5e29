/* Visual odometry: the stage behind include/fovea/odometry.h.
 *
 * A step (fv_odometry_step) gives the pose of a frame: initialise.c finds the first keyframes,
 * localise.c the pose against the local map, keyframe.c decides whether the frame becomes a
 * keyframe. A job (fv_odometry_unit) does the rest in units: landmark_creation.c triangulates and
 * fuses new landmarks of a keyframe, then the window is optimised and committed. Between frames the
 * pose is carried along when a commit moves the keyframe that it hangs on.
 *
 * struct fv_odometry holds sizes and addresses only; everything else is in the three arenas,
 * without addresses. */
#ifndef FOVEA_ODOMETRY_ODOMETRY_H
#define FOVEA_ODOMETRY_ODOMETRY_H

#include "base/arena.h"
#include "fovea/camera.h"
#include "base/elementary.h"
#include "fovea/features.h"
#include "fovea/odometry.h"
#include "geometry/bearing.h"
#include "geometry/pose.h"
#include "kernels/kernels.h"
#include "map/archive.h"
#include "map/loop.h"
#include "map/map.h"
#include "map/window.h"
#include "odometry/relocalise.h"
#include "odometry/initialise.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_CREATION_NEIGHBOURS_MAX = 5,
    FV_CREATION_PENDING_MAX = 4,
    FV_LOCAL_KEYFRAMES_MAX = 12,
    FV_COVARIANCE_POSES_MAX = 8
};

/* Where landmark creation for a keyframe stands. */
enum fv_creation_phase { FV_CREATION_IDLE = 0, FV_CREATION_TRIANGULATE = 1, FV_CREATION_FUSE = 2 };

struct fv_creation_state {
    enum fv_creation_phase phase;
    uint32_t keyframe, generation;
    uint32_t neighbour_count, neighbour, next; /* in work */
    uint32_t neighbours[FV_CREATION_NEIGHBOURS_MAX],
        neighbour_generations[FV_CREATION_NEIGHBOURS_MAX];
};

/* A landmark as the last frame saw it. */
struct fv_recent {
    uint32_t landmark, generation;
    uint32_t level;
};

struct fv_odometry_state {
    enum fovea_tracking_state state;
    bool moving_known;    /* `motion` holds */
    bool job_wanted;      /* a keyframe was made since the last window */
    struct fv_se3 motion; /* T_camera_lastcamera of the last two frames */
    struct fovea_random random;
    uint64_t frame_number;
    uint64_t keyframe_frame; /* number of the frame that became the last keyframe */
    uint32_t lost_frames, reset_counter;
    struct fv_initialise_state initialise;
    uint32_t still_frames; /* for which the camera has stayed at still_place */
    double still_place[3]; /* world */
    uint32_t recent_count;
    uint32_t newest;           /* slot of the newest keyframe */
    uint32_t keyframe_matches; /* landmarks that the newest keyframe was tracked on */
    int32_t pending[FV_CREATION_PENDING_MAX];
    uint32_t pending_count;
    struct fv_creation_state creation;
    bool sound;              /* the last covariance is to be relied on (covariance.h) */
    uint64_t first_keyframe; /* number of that with which the last map was started */
    uint32_t reference, reference_generation; /* keyframe that the last pose hangs on, */
    struct fv_se3 reference_published;        /* and T_world_cam as it was told at its own frame */
    struct fovea_pose pose;                   /* of the last frame */
};

struct fv_odometry {
    struct fovea_odometry_config config;
    struct fovea_camera camera;
    double focal_px; /* mean, for thresholds in pixels */
    struct fv_bearing_table bearings;
    struct fv_map map;
    struct fv_window window;
    struct fv_relocaliser relocaliser;
    struct fv_archive_state *archive; /* of the map that is being saved */
    uint8_t
        *save_to; /* the caller's buffer, or NULL: what becomes of the bytes is outside the state */
    size_t save_capacity;
    struct fv_loop_closer loop;
    struct fv_odometry_state *state;
    struct fv_recent *recent; /* features_max */
    float *guessed_depth;     /* inverse depths guessed, by feature of the first view */
    float (
        *line)[3]; /* job part: bearings of the neighbour in which new landmarks are looked for */
    /* Frame part. */
    struct fv_sight *sights;            /* of the matched features */
    uint32_t *sight_feature;            /* feature of each sight */
    uint16_t *match_distance;           /* by feature */
    double *joint;                      /* normal equations of covariance.c */
    uint32_t *local;                    /* landmarks of the local map */
    struct fv_pair *pairs;              /* initialisation */
    struct fv_feature_track *tracks;    /* initialisation: of each pair */
    struct fv_initialise_depth *depths; /* initialisation: of each track */
    uint8_t *inlier;
    uint32_t *nearest, *second;
    uint8_t *gathered; /* descriptors of landmarks, for search without prediction */
    uint32_t local_max;
};

/* What a step is given: the frame's features, in any order. */
struct fv_odometry_input {
    int64_t stamp_ns;
    uint32_t count;
    const struct fovea_feature *features;
    const uint8_t *descriptors; /* 32 bytes each */
};

/* Take memory from the three parts. Fills sizes and addresses only. Init-only. */
void fv_odometry_carve(struct fv_odometry *odometry, const struct fovea_odometry_config *config,
                       const struct fovea_camera *camera, uint32_t features_max,
                       struct fv_arena *persistent, struct fv_arena *job, struct fv_arena *frame);
void fv_odometry_init(struct fv_odometry *odometry, uint64_t seed);

/* Forget the map and start again; the reset counter rises. Real-time safe. */
void fv_odometry_reset(struct fv_odometry *odometry);

/* No frame has come for too long to go on from the last pose: a tracked state becomes `lost`, and
 * the next frame is looked for in the map. Returns whether that is news. Real-time safe. */
bool fv_odometry_interrupt(struct fv_odometry *odometry);

/* Pose of a frame. Writes state->pose. Real-time safe: bounded by the features and landmarks
 * configured. */
void fv_odometry_step(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                      const struct fv_odometry_input *input);

/* One unit of the map's job, at most about 0.25 ms; true when units are left. Real-time safe. */
bool fv_odometry_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels);
bool fv_odometry_job_waiting(const struct fv_odometry *odometry);
/* The same for the job that closes loops and merges maps. */
bool fv_odometry_loop_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels);
bool fv_odometry_loop_waiting(const struct fv_odometry *odometry);

/* Where a save writes: the caller's buffer, which is outside the state, or NULL. */
void fv_odometry_save_to(struct fv_odometry *odometry, uint8_t *buffer, size_t bytes);
/* Begin to save the map, unless a save is under way: the job does it first, in units. */
void fv_odometry_save_begin(struct fv_odometry *odometry);
/* Give up a save that is under way. */
void fv_odometry_save_drop(struct fv_odometry *odometry);
bool fv_odometry_saving(const struct fv_odometry *odometry);
/* Bytes of a save that is complete, once; 0: none, or not yet. */
size_t fv_odometry_save_take(struct fv_odometry *odometry);
/* Take a saved map instead of an empty one; the state is `lost` until the camera is found in it.
 * Errors as fv_archive_read. Init-only. */
enum fovea_status fv_odometry_load(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                                   const uint8_t *data, size_t bytes, const char *name,
                                   struct fovea_error *error);

/* ---- for other rooms; all real-time safe ----------------------------------------------------- */

/* Of the last frame: in `odom`, in the unit of the map that began it. The members of the scale and
 * of the reference keyframe are not filled in. */
const struct fovea_pose *fv_odometry_pose(const struct fv_odometry *odometry);
/* How often a new world was started. */
uint32_t fv_odometry_reset_counter(const struct fv_odometry *odometry);
/* The last frame's pose in the world of the map. */
void fv_odometry_map_pose(const struct fv_odometry *odometry, struct fv_se3 *T_map_cam);
/* The same relative to its reference keyframe, which is returned. */
const struct fv_keyframe *fv_odometry_keyframe_pose(const struct fv_odometry *odometry,
                                                    struct fv_se3 *T_keyframe_cam);
const struct fv_map *fv_odometry_map(const struct fv_odometry *odometry);
double fv_odometry_focal_px(const struct fv_odometry *odometry);
/* Loops closed and maps merged since the last reset. */
struct fv_loop_closer_counts fv_odometry_loop_counts(const struct fv_odometry *odometry);
/* Keep with the map what is known of its unit. */
void fv_odometry_keep_scale(struct fv_odometry *odometry, const struct fv_map_scale *scale);

/* ---- between the stage's own files ----------------------------------------------------------- */

/* A key point that sees a point of the world. */
static inline void fv_sight_from(const struct fv_keypoint *p, const double point[3],
                                 struct fv_sight *s)
{
    for (int k = 0; k < 3; k++) {
        s->point[k] = point[k];
        s->bearing[k] = (double)p->bearing[k];
    }
    for (int k = 0; k < 6; k++)
        s->A[k] = (double)p->A[k];
    s->weight = (double)p->weight;
    s->inlier = true;
}

/* Try to make the first map from the waiting frames and the current one; true when done. */
bool fv_odometry_initialise(struct fv_odometry *odometry, const struct fv_kernels *kernels);
/* Pose of the current view against the local map; number of inliers (0: failed). */
uint32_t fv_odometry_localise(struct fv_odometry *odometry, const struct fv_kernels *kernels);
/* Pieces of localisation that relocalisation shares: forget the view's matches; make sights of
 * them, returning their number; refine over them and forget those that do not fit; match the local
 * map around them (`widen` times the usual radius), returning how many landmarks are in view. */
void fv_odometry_clear_matches(struct fv_odometry *odometry, const struct fv_view *view);
uint32_t fv_odometry_collect_sights(struct fv_odometry *odometry, const struct fv_view *view);
uint32_t fv_odometry_refine(struct fv_odometry *odometry, const struct fv_view *view, int rounds,
                            int steps, struct fv_se3 *T, struct fv_pose_fit *fit);
uint32_t fv_odometry_match_local(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                                 const struct fv_view *view, const struct fv_se3 *T, double widen);
/* Inliers and covariance of the first pose, from the first map. */
void fv_odometry_confirm(struct fv_odometry *odometry);
/* Whether the current view should become a keyframe, and making it one. */
bool fv_odometry_keyframe_needed(struct fv_odometry *odometry, uint32_t inliers);
void fv_odometry_make_keyframe(struct fv_odometry *odometry);
/* Queue a keyframe for landmark creation. */
void fv_odometry_queue(struct fv_odometry *odometry, uint32_t keyframe);
/* One unit of landmark creation; true when units are left. */
bool fv_odometry_creation_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels);
/* Drop landmarks that are not found again. */
void fv_odometry_cull(struct fv_odometry *odometry);

#ifdef __cplusplus
}
#endif
#endif
