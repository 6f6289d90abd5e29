/* Visual odometry: the stage behind include/fovea/odometry.h.
 *
 * A step (fv_odometry_step) gives the pose of a frame: initialise.c finds the first keyframes,
 * localise.c the pose against the local map, keyframe.c decides whether the frame becomes a
 * keyframe. A job (fv_odometry_unit) does the rest in units: landmark_creation.c triangulates and
 * fuses new landmarks of a keyframe, agreement.c holds the map against the pictures, then the
 * window is optimised and committed. Between frames the pose is carried along when a commit moves
 * the keyframe that it hangs on.
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
#include "map/closure.h"
#include "map/map.h"
#include "map/window.h"
#include "odometry/agreement.h"
#include "odometry/covariance.h"
#include "odometry/distances.h"
#include "odometry/initialise.h"
#include "odometry/landmark_creation.h"
#include "odometry/localise.h"
#include "odometry/relocalise.h"
#include "odometry/turn.h"
#include "odometry/usable.h"

#ifdef __cplusplus
extern "C" {
#endif

/* For how long the camera has stayed in one place. */
struct fv_still_state {
    uint32_t frames;
    double position[3]; /* world */
};

/* Keyframe that the last pose hangs on, and T_world_cam as published with its own frame; what the
 * parts of that frame's image showed, and what its focal length added (covariance.h), zeros where
 * it is not known. */
struct fv_reference_state {
    uint32_t slot, generation;
    struct fv_se3 published;
    double parts[21], lens[21];
    double focal; /* the change of the focal length that was seen there */
};

struct fv_odometry_state {
    enum fovea_tracking_state state;
    bool job_wanted;          /* a keyframe was made since the last window */
    bool covariance_reliable; /* that of the last pose (covariance.h) */
    struct fv_random random;
    uint64_t frame_number;
    uint64_t keyframe_frame; /* number of the frame that became the last keyframe */
    uint64_t first_keyframe; /* number of that with which the last map was initialised */
    uint32_t lost_frames, reset_counter;
    uint32_t newest;           /* slot of the newest keyframe */
    uint32_t keyframe_matches; /* landmarks that the newest keyframe was localised on */
    struct fv_localise_state localise;
    struct fv_turn_state turn;
    struct fv_still_state still;
    struct fv_creation_state creation;
    struct fv_agreement_state agreement;
    struct fv_usable_state usable;
    struct fv_reference_state reference;
    struct fv_covariance_state covariance;
    double parts[21];       /* what those of the last frame's image showed */
    struct fovea_pose pose; /* of the last frame */
};

/* Saving the map. What becomes of the bytes is outside the state. */
struct fv_saver {
    struct fv_archive_state *archive; /* persistent: of the map that is being saved */
    uint8_t *buffer;                  /* the caller's; NULL: do not save */
    size_t capacity;
};

struct fv_odometry {
    struct fovea_odometry_config config;
    struct fovea_camera camera;
    double focal_px; /* mean, for thresholds in pixels */
    struct fv_bearing_table bearings;
    struct fv_map map;
    struct fv_odometry_state *state;
    struct fv_turns *turns; /* persistent; NULL: no gyro */
    /* The step: the first map, the pose of a frame, finding it again, its covariance. */
    struct fv_matches matches;
    struct fv_initialiser initialiser;
    struct fv_localiser localiser;
    struct fv_relocaliser relocaliser;
    struct fv_covariance covariance;
    struct fv_distances distances;
    /* The jobs: new landmarks, window optimisation, closures, saving. */
    struct fv_creator creator;
    struct fv_agreement agreement;
    struct fv_window window;
    struct fv_closure closure;
    struct fv_saver saver;
};

/* What a step is given: the frame's features, in any order, and the noise of its picture. */
struct fv_odometry_input {
    int64_t stamp_ns;
    uint32_t count;
    const struct fovea_feature *features;
    const uint8_t *descriptors; /* 32 bytes each */
    uint32_t noise;             /* as fv_noise measures it; 0: none */
    /* where a global shutter would have seen them (rolling.h); NULL: where they are */
    const struct fovea_feature *placed;
    /* measured, by feature, metres; NULL: none. Only where they were carved for */
    const struct fv_inverse_distance *distances;
    struct fv_motion_hint hint; /* all zero: none */
    /* Where another camera stood in, as one of this camera's lens and attitude: its place in the
     * camera's axes, metres. Only in a map in metres; such a frame begins none. */
    double seen_from[3];
};

/* Take memory from the three parts; `distances`: inputs may have them; `gyro`: hints may be
 * measured turns. Fills sizes and addresses only. Init-only. */
void fv_odometry_carve(struct fv_odometry *odometry, const struct fovea_odometry_config *config,
                       const struct fovea_camera *camera, uint32_t features_max, bool distances,
                       bool gyro, struct fv_arena *persistent, struct fv_arena *job,
                       struct fv_arena *frame);
void fv_odometry_init(struct fv_odometry *odometry, uint64_t seed);

/* Change inliers_good and lost_frames_reset. Real-time safe. */
void fv_odometry_set(struct fv_odometry *odometry, const struct fovea_odometry_config *config);

/* Forget the map and start again; the reset counter rises. Real-time safe. */
void fv_odometry_reset(struct fv_odometry *odometry);

/* No frame has come for too long to go on from the last pose: a tracked state becomes `lost`, and
 * the next frame is relocalised in the map. Returns whether that is news. Real-time safe. */
bool fv_odometry_interrupt(struct fv_odometry *odometry);

/* Pose of a frame. Writes state->pose. Real-time safe: bounded by the features and landmarks
 * configured. */
void fv_odometry_step(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                      const struct fv_odometry_input *input);

/* One unit of the map's job, bounded work (docs/bounds.md); true when units are left. Real-time
 * safe. */
bool fv_odometry_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels);
bool fv_odometry_job_waiting(const struct fv_odometry *odometry);
/* The same for the job that finds closures and merges maps; `outcome`: what it did to the map,
 * which odometry itself has followed. */
bool fv_odometry_closure_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                              struct fv_closure_outcome *outcome);
bool fv_odometry_closure_waiting(const struct fv_odometry *odometry);

/* Where a save writes: the caller's buffer, which is outside the state, or NULL. */
void fv_odometry_save_to(struct fv_odometry *odometry, uint8_t *buffer, size_t bytes);
/* Begin to save the map, unless a save is under way: the job does it first, in units. */
void fv_odometry_save_begin(struct fv_odometry *odometry);
/* A save is asked for that waits for a grid at its end: its owner calls the two that follow, as
 * archive.h says, or none; the next unit ends it. */
void fv_odometry_save_want_grid(struct fv_odometry *odometry);
bool fv_odometry_save_at_grid(const struct fv_odometry *odometry);
void fv_odometry_save_grid_head(struct fv_odometry *odometry, const struct fv_archive_grid *grid);
void fv_odometry_save_grid_cells(struct fv_odometry *odometry, const int8_t *cells, uint32_t count);
/* Give up a save that is under way. */
void fv_odometry_save_drop(struct fv_odometry *odometry);
bool fv_odometry_saving(const struct fv_odometry *odometry);
/* Bytes of a save that is complete, once; 0: none, or not yet. */
size_t fv_odometry_save_take(struct fv_odometry *odometry);
/* Take a saved map instead of an empty one; the state is `lost` until the camera is found in it.
 * `info` is what the file says. Errors as fv_archive_read. Init-only. */
enum fovea_status fv_odometry_load(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                                   const uint8_t *data, size_t bytes, const char *name,
                                   struct fv_archive_info *info, struct fovea_error *error);

/* Take a settled map (map.h) of the same limits while frames come: the reset counter rises, and the
 * state is `lost` until the camera is found in it. Its place index is made by the job. The file was
 * saved at `frame_number`. Real-time safe; as long as copying it takes. */
void fv_odometry_take_map(struct fv_odometry *odometry, const struct fv_map *from,
                          uint64_t frame_number);

/* ---- for other rooms; all real-time safe ----------------------------------------------------- */

/* Of the last frame: in `odom`, in the unit of the map that began it. The members of the scale and
 * of the reference keyframe are not filled in. */
const struct fovea_pose *fv_odometry_pose(const struct fv_odometry *odometry);
/* What independent errors of the last frame's pixels alone do to its position (in `odom`'s unit)
 * and turn (rad), standard deviations of an axis: unlike its covariance, nothing that frames that
 * follow each other have in common, but for the motion that a stuck picture hides. 0: no pose. */
void fv_odometry_own_sigmas(const struct fv_odometry *odometry, double *position, double *turn);
/* An attitude of the last frame's camera, as R_x_cam, without what the gyro added to it (turn.h):
 * as the picture alone showed it. */
void fv_odometry_seen_attitude(const struct fv_odometry *odometry, double R_x_cam[9]);
/* How often the world of the poses became another: a new one, or that of an older map. */
uint32_t fv_odometry_reset_counter(const struct fv_odometry *odometry);
/* The last frame's pose in the world of the map. */
void fv_odometry_map_pose(const struct fv_odometry *odometry, struct fv_se3 *T_map_cam);
/* The same relative to its reference keyframe. */
struct fv_odometry_reference {
    uint32_t slot;   /* of the keyframe */
    uint64_t number; /* its own */
    int64_t stamp_ns;
    struct fv_se3 T_keyframe_cam;
};
struct fv_odometry_reference fv_odometry_reference(const struct fv_odometry *odometry);
const struct fv_map *fv_odometry_map(const struct fv_odometry *odometry);
double fv_odometry_focal_px(const struct fv_odometry *odometry);
/* Closures and merged maps since the last reset. */
struct fv_closure_counts fv_odometry_closure_counts(const struct fv_odometry *odometry);
/* The last frame's pose is known and not published: the pictures had contradicted its map. */
bool fv_odometry_withholds(const struct fv_odometry *odometry);
/* Keep with the map what is known of its unit. */
void fv_odometry_keep_scale(struct fv_odometry *odometry, const struct fv_map_scale *scale);
/* The same of gravity, in the axes of `world`; and what is kept with the map that the last frame's
 * pose is of. False: nothing is known. */
void fv_odometry_keep_gravity(struct fv_odometry *odometry, const struct fv_map_gravity *gravity);
bool fv_odometry_gravity(const struct fv_odometry *odometry, struct fv_map_gravity *gravity);

/* ---- between the stage's own files ----------------------------------------------------------- */

/* Try to make the first map from the waiting frames and the current one; true when done. */
bool fv_odometry_initialise(struct fv_odometry *odometry, const struct fv_kernels *kernels);
/* Inliers and covariance of the first pose, from the first map. */
void fv_odometry_confirm(struct fv_odometry *odometry);
/* Whether what was noted of the reference keyframe is of the one that is the reference now. */
bool fv_odometry_reference_known(const struct fv_odometry *odometry);
/* Whether the current frame should become a keyframe, and making it one. */
bool fv_odometry_keyframe_needed(struct fv_odometry *odometry, uint32_t inliers);
void fv_odometry_make_keyframe(struct fv_odometry *odometry);
/* Lengths of the current frame's world have another unit, and its points other positions. */
void fv_odometry_follow_correction(struct fv_odometry *odometry, const struct fv_sim3 *S_new_old);
/* Median depth of the landmarks that the current frame sees. */
double fv_odometry_current_depth(const struct fv_odometry *odometry);
#ifdef __cplusplus
}
#endif
#endif
