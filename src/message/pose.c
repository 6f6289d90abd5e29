/* The pose messages: our own, and bot_core's. */
#include <math.h>
#include <string.h>

#include "bot_core_pose_t.h"
#include "fovea_pose_t.h"
#include "message/message.h"
#include "message/wire.h"

size_t fv_message_pose_size_max(void)
{
    fovea_pose_t message;
    char name[FV_MESSAGE_NAME_BYTES_MAX];
    memset(&message, 0, sizeof message);
    memset(name, 'x', sizeof name);
    name[sizeof name - 1] = 0;
    message.parent_frame = message.child_frame = name;
    return (size_t)fovea_pose_t_encoded_size(&message);
}

/* Frame names are constants of the runtime; lcm-gen's struct lacks the const. */
static char *name_of(const char *name)
{
    return (char *)(uintptr_t)name;
}

uint32_t fv_message_pose_encode(const struct fv_message_pose *in, uint8_t *buffer, size_t capacity)
{
    const struct fovea_pose *pose = in->pose;
    const bool posed = pose->posed && !in->paused;
    fovea_pose_t message;
    memset(&message, 0, sizeof message);
    message.stamp = in->stamp;
    message.state = in->paused ? FOVEA_POSE_T_STATE_PAUSED : (int8_t)pose->state;
    message.reset_counter = (int32_t)pose->reset_counter;
    message.parent_frame = name_of(in->parent_frame);
    message.child_frame = name_of(in->child_frame);
    for (int i = 0; i < 3; i++)
        message.position[i] = posed ? in->position[i] : (double)NAN;
    for (int i = 0; i < 4; i++)
        message.orientation[i] = posed ? in->orientation[i] : (double)NAN;
    for (int i = 0; i < 21; i++)
        message.covariance[i] = posed ? in->covariance[i] : (double)NAN;
    message.reference_keyframe = posed ? in->reference_keyframe : -1;
    message.quality = in->paused ? 0 : pose->quality;
    message.inliers = in->paused ? 0 : (int32_t)pose->inliers;
    message.scale = pose->scale;
    message.scale_sigma = pose->scale_source == FOVEA_SCALE_FREE ? (double)NAN : pose->scale_sigma;
    message.scale_source = (int8_t)pose->scale_source;
    for (int i = 0; i < 3; i++)
        message.map_position[i] = posed ? in->map_position[i] : (double)NAN;
    for (int i = 0; i < 4; i++)
        message.map_orientation[i] = posed ? in->map_orientation[i] : (double)NAN;
    message.map_scale = posed ? pose->map_scale : (double)NAN;
    message.latency_ns = in->latency_ns;
    return fv_wire_encoded(fovea_pose_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_bot_core_pose_size(void)
{
    const bot_core_pose_t message = {0};
    return (size_t)bot_core_pose_t_encoded_size(&message);
}

uint32_t fv_message_bot_core_pose_encode(const struct fv_message_bot_core_pose *in, uint8_t *buffer,
                                         size_t capacity)
{
    bot_core_pose_t message = {.utime = in->utime};
    memcpy(message.pos, in->position, sizeof message.pos);
    memcpy(message.vel, in->velocity, sizeof message.vel);
    memcpy(message.orientation, in->orientation, sizeof message.orientation);
    memcpy(message.rotation_rate, in->rotation_rate, sizeof message.rotation_rate);
    return fv_wire_encoded(bot_core_pose_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
