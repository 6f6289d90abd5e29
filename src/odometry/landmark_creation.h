/* Landmark creation: features of a new keyframe that have no landmark are matched along epipolar
 * lines in neighbouring keyframes, triangulated and checked; then the keyframe's landmarks are
 * searched for in the neighbours that do not see them yet. Part of the map's job, in units of
 * bounded work. Real-time safe. */
#ifndef FOVEA_ODOMETRY_LANDMARK_CREATION_H
#define FOVEA_ODOMETRY_LANDMARK_CREATION_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_CREATION_NEIGHBOURS_MAX = 5, FV_CREATION_PENDING_MAX = 4 };

/* Where landmark creation for a keyframe stands. */
enum fv_creation_phase {
    FV_CREATION_IDLE = 0,
    FV_CREATION_TRIANGULATE = 1,
    FV_CREATION_FUSE = 2,
    FV_CREATION_MEASURED = 3 /* first, in a metric map: features with known distances */
};

struct fv_creation_state {
    enum fv_creation_phase phase;
    uint32_t keyframe, generation;
    uint32_t neighbour_count, neighbour, next; /* in work */
    uint32_t neighbours[FV_CREATION_NEIGHBOURS_MAX],
        neighbour_generations[FV_CREATION_NEIGHBOURS_MAX];
    uint32_t pending_count;
    int32_t pending[FV_CREATION_PENDING_MAX]; /* keyframes that wait, oldest first */
};

struct fv_creator {
    float (*line)[3]; /* job part: bearings of the neighbour that is searched */
};

struct fv_odometry;

void fv_creator_carve(struct fv_creator *creator, uint32_t features_max, struct fv_arena *job);

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
