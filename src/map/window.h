/* Window optimisation: the newest keyframes and the landmarks that they see, adjusted together; a
 * job.
 *
 * Levenberg-Marquardt on robust (Huber) pixel errors; landmarks are eliminated by the Schur
 * complement, the reduced system of poses is solved by our own LDL^T. After B. Triggs et al.,
 * "Bundle adjustment: a modern synthesis" (2000). The window is copied into job memory when the job
 * starts; the copy is worked on in units; the commit writes back what still holds by (slot,
 * generation). Keyframes outside the window that see its landmarks take part unmoved. In a metric
 * map the measured inverse distance of an observation is a third error of it. State holds
 * no addresses. Real-time safe; every unit is bounded. */
#ifndef FOVEA_MAP_WINDOW_H
#define FOVEA_MAP_WINDOW_H

#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_WINDOW_KEYFRAMES_MAX = 12,
    FV_WINDOW_FIXED_MAX = 20,
    FV_WINDOW_POSES_MAX = FV_WINDOW_KEYFRAMES_MAX + FV_WINDOW_FIXED_MAX,
    FV_WINDOW_SYSTEM_MAX = 6 * FV_WINDOW_KEYFRAMES_MAX,
    FV_WINDOW_STEPS_MIN = 3
};

struct fv_window_limits {
    uint32_t keyframes;    /* moved, [2, FV_WINDOW_KEYFRAMES_MAX] */
    uint32_t landmarks;    /* [100, 4000] */
    uint32_t observations; /* of all of them */
    uint32_t passes;       /* over the window: one more than Levenberg-Marquardt steps; [4, 200] */
    /* fraction of the cost: from step FV_WINDOW_STEPS_MIN on, one that saves no more is the last */
    double converged;
};

struct fv_window_pose {
    struct fv_se3 T_cam_world, before; /* in work, and as last accepted */
    struct fv_se3 at_start;
    uint32_t slot, generation;
    int32_t column; /* of its block in the reduced system; -1: not moved */
    uint32_t reserved;
};

struct fv_window_landmark {
    double point[3], before[3];
    double inverse[6]; /* of its damped 3x3 block */
    double gradient[3];
    uint32_t slot, generation;
    uint32_t first, count; /* observations */
};

struct fv_window_observation {
    float bearing[3], A[6], weight;
    struct fv_pixel seen; /* until the first pass makes the above of it */
    uint16_t pose;
    /* 3x6 block between landmark and pose. It multiplies what vanishes at the optimum, which floats
     * leave where it is. */
    float cross[18];
};

enum fv_window_phase { FV_WINDOW_IDLE = 0, FV_WINDOW_PASS = 1, FV_WINDOW_DONE = 2 };

struct fv_window_state {
    enum fv_window_phase phase;
    uint32_t pose_count, moved_count, landmark_count, observation_count;
    uint32_t next;         /* landmark of the pass */
    uint32_t pass, passes; /* completed, and at most */
    bool step_pending;     /* the pass applies `step` first */
    bool packed;           /* observations are pixels so far */
    bool accepted_any;
    double damping, cost, cost_before, cost_at_start;
    double step[FV_WINDOW_SYSTEM_MAX];
    double gradient[FV_WINDOW_SYSTEM_MAX];
    double system[FV_WINDOW_SYSTEM_MAX *
                  FV_WINDOW_SYSTEM_MAX]; /* row-major with 6 * moved_count columns */
    struct fv_window_pose poses[FV_WINDOW_POSES_MAX];
    int8_t pose_of[FV_MAP_KEYFRAMES_MAX + 2]; /* index in poses by slot; -1: not in the window */
    uint64_t keyframe_number;                 /* newest keyframe when the job started */
};

struct fv_window {
    struct fv_window_limits limits;
    const struct fv_map *map; /* that pixels are of */
    struct fv_window_state *state;
    struct fv_window_landmark *landmarks;
    struct fv_window_observation *observations;
    /* by observation, where the map is metric; NULL where the map keeps none */
    struct fv_inverse_distance *distances;
};

/* `map` stays the caller's. */
void fv_window_carve(struct fv_window *window, const struct fv_window_limits *limits,
                     const struct fv_map *map, struct fv_arena *job);

/* Copy the window around keyframe `newest`. False when there is nothing to optimise (then the job
 * stays idle). */
bool fv_window_start(struct fv_window *window, struct fv_map *map, uint32_t newest);

/* One unit of work; true when units are left. */
bool fv_window_unit(struct fv_window *window);

/* Write the result to the map: poses, landmarks, and what hangs on them (keyframes and landmarks
 * outside the window move with their parent or reference); observations that do not fit are
 * unlinked. Ends the job. */
struct fv_window_result {
    uint32_t moved_keyframes, dropped_observations;
    double cost_at_start, cost; /* robust, weighted px^2 */
};
struct fv_window_result fv_window_commit(struct fv_window *window, struct fv_map *map);

void fv_window_abort(struct fv_window *window);

/* ---- what window_copy.c, which fills the window, and window.c share ------------------------- */

/* An empty window. */
void fv_window_clear(struct fv_window *window);
/* A landmark; its observations follow it. */
void fv_window_put_landmark(struct fv_window *window, const double point[3]);
/* Begin the first of at most `passes` passes. */
void fv_window_begin(struct fv_window *window, uint32_t passes);

#ifdef __cplusplus
}
#endif
#endif
