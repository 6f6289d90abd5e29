/* The pose messages of a frame. */
#ifndef FOVEA_RUNTIME_ENCODE_POSE_H
#define FOVEA_RUNTIME_ENCODE_POSE_H

#include "runtime/state.h"

/* After each processed frame; `due`: the messages are to be sent, and not only the velocity to be
 * kept up. */
void fv_encode_poses(struct fovea *rt, const struct fovea_inputs *inputs, bool due,
                     struct fovea_outputs *outputs);

#endif
