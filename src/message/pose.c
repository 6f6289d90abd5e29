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

/* Copy numbers, or say that they are not known. */
static void fill(double *out, const double *values, int count, bool known)
{
    for (int i = 0; i < count; i++)
        out[i] = known ? values[i] : (double)NAN;
}

static void fill_transform(double position[3], double orientation[4],
                           const struct fv_message_transform *T, bool known)
{
    fill(position, T->position, 3, known);
    fill(orientation, T->orientation, 4, known);
}

static void fill_motion(fovea_pose_t *out, const struct fv_message_pose *in, bool posed)
{
    const bool moving = posed && in->moving;
    fill(out->velocity, in->velocity, 3, moving);
    fill(out->angular_rate, in->angular_rate, 3, moving);
    double covariance[21] = {0};
    for (int r = 0, k = 0; r < 6; k += 6 - r, r++)
        covariance[k] = r < 3 ? in->velocity_sigma * in->velocity_sigma
                              : in->angular_rate_sigma * in->angular_rate_sigma;
    fill(out->velocity_covariance, covariance, 21, moving && in->velocity_sigma > 0);
    fill(out->gyro_bias, in->gyro_bias, 3, posed && in->biased);
    fill(out->acceleration_bias, in->acceleration_bias, 3, posed && in->biased);
    fill(out->bias_covariance, in->bias_covariance, 21, posed && in->biased);
    fill(out->gravity, in->gravity, 3, posed && in->gravity_sigma > 0);
    fill(&out->gravity_sigma, &in->gravity_sigma, 1, posed && in->gravity_sigma > 0);
}

static void fill_scale(fovea_pose_t *out, const struct fv_message_pose *in)
{
    const struct fovea_pose *pose = in->pose;
    const bool metric = pose->scale_source != FOVEA_SCALE_FREE;
    out->scale_state = metric                 ? FOVEA_POSE_T_SCALE_METRIC
                       : in->scale_configured ? FOVEA_POSE_T_SCALE_INITIALISING
                                              : FOVEA_POSE_T_SCALE_FREE;
    out->scale_source = (int8_t)pose->scale_source; /* the numbers of SOURCE_* are the same */
    out->scale = pose->scale;
    out->scale_sigma = metric ? pose->scale_sigma : (double)NAN;
    out->change_count = (int32_t)in->change_count;
    out->change_scale = in->change_scale;
    fill_transform(out->change_position, out->change_orientation, &in->change, true);
}

uint32_t fv_message_pose_encode(const struct fv_message_pose *in, uint8_t *buffer, size_t capacity)
{
    const struct fovea_pose *pose = in->pose;
    const bool posed = pose->posed && !in->paused;
    fovea_pose_t message;
    memset(&message, 0, sizeof message);
    message.stamp = in->stamp;
    message.state = in->paused ? FOVEA_POSE_T_STATE_PAUSED : (int8_t)pose->state;
    message.uncalibrated = in->uncalibrated;
    message.reset_counter = (int32_t)pose->reset_counter;
    message.map_id = posed ? (int32_t)pose->map_id : -1;
    message.parent_frame = name_of(in->parent_frame);
    message.child_frame = name_of(in->child_frame);
    fill_transform(message.position, message.orientation, &in->T_parent_child, posed);
    fill(message.covariance, in->covariance, 21, posed);
    message.quality = in->paused ? 0 : pose->quality;
    message.inliers = in->paused ? 0 : (int32_t)pose->inliers;
    fill_motion(&message, in, posed);
    message.reference_keyframe = posed ? (int64_t)pose->reference_keyframe : -1;
    message.keyframe_stamp_ns = posed ? pose->keyframe_stamp_ns : 0;
    fill_transform(message.keyframe_position, message.keyframe_orientation, &in->T_keyframe_child,
                   posed);
    fill_scale(&message, in);
    message.map_scale = posed ? pose->map_scale : (double)NAN;
    fill_transform(message.map_position, message.map_orientation, &in->T_map_parent, posed);
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
