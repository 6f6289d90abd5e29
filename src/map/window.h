/* Window optimisation: the newest keyframes and the landmarks that they see, adjusted together; a
 * job.
 *
 * Levenberg-Marquardt on robust (Huber) pixel errors; landmarks are eliminated by the Schur
 * complement, the reduced system of poses is solved by our own LDL^T. After B. Triggs et al.,
 * "Bundle adjustment: a modern synthesis" (2000). The window is copied into job memory when the job
 * starts; the copy is worked on in units; the commit writes back what still holds by (slot,
 * generation). Keyframes outside the window that see its landmarks take part unmoved. In a metric
 * map the measured inverse distance of an observation is a third error of it. Where a gyro measured
 * how the camera turned from one keyframe of the window to the next (turns.h), that is an error,
 * too: of the turn between their poses, robust (Huber) like the pixels'. The keyframe before the
 * window takes part for it, unmoved. The gyro's bias is one more unknown, held by what is known of
 * it, and eliminated like a landmark. State holds no addresses. Real-time safe; every unit is
 * bounded. */
#ifndef FOVEA_MAP_WINDOW_H
#define FOVEA_MAP_WINDOW_H

#include "map/map.h"
#include "map/turns.h"

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

/* The gyro's part: its bias, and the turns between keyframes that follow each other. */
struct fv_window_gyro {
    uint64_t count;                 /* turns */
    double bias[3], mean[3];        /* in work, and as it was known, rad/s in the camera's axes */
    double before[3];               /* as last accepted */
    double weight;                  /* of what was known: 1 / sigma^2 */
    double inverse[6], gradient[3]; /* of its damped block, */
    double cross[FV_WINDOW_KEYFRAMES_MAX][18]; /* and between it and the poses, by column */
    struct fv_window_turn {
        uint64_t a, b; /* poses */
        double weight; /* 1 / variance */
        struct fv_turn turn;
    } turns[FV_WINDOW_KEYFRAMES_MAX];
};

struct fv_window {
    struct fv_window_limits limits;
    const struct fv_map *map; /* that pixels are of */
    struct fv_window_state *state;
    struct fv_window_landmark *landmarks;
    struct fv_window_observation *observations;
    /* by observation, where the map is metric; NULL where the map keeps none */
    struct fv_inverse_distance *distances;
    const struct fv_turns *turns; /* as measured; NULL: none are */
    struct fv_window_gyro *gyro;  /* NULL: there is none */
};

/* `map` stays the caller's, as do the `turns` that it sets where there is a `gyro`. */
void fv_window_carve(struct fv_window *window, const struct fv_window_limits *limits,
                     const struct fv_map *map, bool gyro, struct fv_arena *job);

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

/* ---- between the window's own files ---------------------------------------------------------- */

/* An empty window. */
void fv_window_clear(struct fv_window *window);
/* A landmark; its observations follow it. */
void fv_window_put_landmark(struct fv_window *window, const double point[3]);
/* Begin the first of at most `passes` passes. */
void fv_window_begin(struct fv_window *window, uint32_t passes);
/* A pose, unmoved so far; returns its index. */
uint32_t fv_window_put_pose(struct fv_window_state *state, const struct fv_map *map, uint32_t slot);
/* Take the turns between the window's keyframes, which are its first `in_window` poses, once their
 * columns are numbered. */
void fv_window_take_turns(struct fv_window *window, const struct fv_map *map, uint32_t in_window);
/* At the end of a pass: add them to the system where the poses are in work; returns their cost. */
double fv_window_add_turns(struct fv_window *window);
/* The step that led there is kept, or taken back. */
void fv_window_keep_turns(struct fv_window *window, bool accept);

#ifdef __cplusplus
}
#endif
#endif
