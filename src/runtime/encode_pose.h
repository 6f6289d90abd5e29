/* The pose messages of a frame. */
#ifndef FOVEA_RUNTIME_ENCODE_POSE_H
#define FOVEA_RUNTIME_ENCODE_POSE_H

#include "runtime/state.h"

/* Of the last published pose. Real-time safe. */
void fv_encode_poses(struct fovea *rt, const struct fovea_inputs *inputs,
                     struct fovea_outputs *outputs);

/* For a frame that came during a pause. */
void fv_encode_paused(struct fovea *rt, const struct fovea_inputs *inputs,
                      struct fovea_outputs *outputs);

/* The pose at the rate of the inertial sensor. On the thread of its samples: nothing that a step
 * writes is read. */
void fv_encode_fast_pose(struct fovea *rt, const struct fv_sense_pose *pose,
                         struct fovea_outputs *outputs);

#endif
