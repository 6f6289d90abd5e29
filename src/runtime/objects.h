/* The stage of objects in the runtime: takes the detections of an inference, with the pose of the
 * image that was given to the network, and gives one message per inference. */
#ifndef FOVEA_RUNTIME_OBJECTS_H
#define FOVEA_RUNTIME_OBJECTS_H

#include "fovea/fovea.h"
#include "message/message.h"
#include "runtime/detection.h"
#include "objects/objects.h"

/* Pose of the image that the detector was given. No addresses and no padding: copied and hashed as
 * bytes. */
struct fv_object_stage_state {
    double T_world_cam[12];
    uint64_t world; /* poses of equal `world` share a frame */
    uint32_t posed, metric;
};

struct fv_object_stage {
    bool enabled;
    struct fv_objects pool;
    struct fv_object_stage_state *state;
    void *message_scratch;
};

/* With a detector, unless the mode is off. `config` must stay where it is. */
void fv_object_stage_carve(struct fv_object_stage *stage, const struct fovea_config *config,
                           const struct fv_detection *detection, struct fv_arena *persistent,
                           struct fv_arena *frame);

/* Forget all objects. Real-time safe, as all that follows. */
void fv_object_stage_reset(struct fv_object_stage *stage);
/* The detector took the frame with this pose. */
void fv_object_stage_note(struct fv_object_stage *stage, const struct fovea_pose *pose);
/* The inference is complete. */
void fv_object_stage_update(struct fv_object_stage *stage,
                            const struct fovea_detections *detections);

/* Encode the objects as of the last inference, with the stamp of its frame, located in `odom`.
 * Returns the bytes. */
uint32_t fv_object_stage_encode(const struct fv_object_stage *stage,
                                const struct fovea_config *config,
                                const struct fv_detection *detection, uint32_t reset_counter,
                                uint8_t *buffer, size_t capacity);

/* Boxes of movable classes in the last inference; returns how many. */
uint32_t fv_object_stage_movable(const struct fv_object_stage *stage,
                                 struct fovea_box boxes[FOVEA_INPUT_BOXES_MAX]);

#endif
