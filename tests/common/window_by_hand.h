/* A window filled without a map: fv_window_clear, poses, then each landmark
 * (fv_window_put_landmark) followed by its observations, then fv_window_begin. The caller keeps to
 * the limits: FV_WINDOW_POSES_MAX poses, of which FV_WINDOW_KEYFRAMES_MAX move. Results are
 * poses[].before and landmarks[].before; there is nothing to commit. */
#ifndef FOVEA_TESTS_WINDOW_BY_HAND_H
#define FOVEA_TESTS_WINDOW_BY_HAND_H

#include <string.h>

#include "map/window.h"

/* Returns the index of the pose. */
static inline uint32_t window_put_pose(struct fv_window *w, const struct fv_se3 *T_cam_world,
                                       bool moved)
{
    struct fv_window_state *s = w->state;
    struct fv_window_pose *p = &s->poses[s->pose_count];
    p->T_cam_world = p->before = p->at_start = *T_cam_world;
    p->column = moved ? 6 * (int32_t)s->moved_count++ : -1;
    return s->pose_count++;
}

/* Seen from pose `pose`, of the landmark that was put last. */
static inline void window_put_observation(struct fv_window *w, const struct fv_keypoint *p,
                                          uint32_t pose)
{
    struct fv_window_observation *o = &w->observations[w->state->observation_count++];
    memcpy(o->bearing, p->bearing, sizeof o->bearing);
    memcpy(o->A, p->A, sizeof o->A);
    o->weight = p->weight;
    o->pose = (uint16_t)pose; /* `cross` is written by the first pass, before it is read */
    w->landmarks[w->state->landmark_count - 1].count++;
}

#endif
