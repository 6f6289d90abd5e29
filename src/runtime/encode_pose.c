/* Pose messages: of the camera in `world`, and of the robot's base in `odom`. */
#include "runtime/encode_pose.h"

#include <string.h>

#include "runtime/jobs.h"

static void encode_pose(struct fovea *rt, const struct fovea_inputs *inputs,
                        enum fv_message_kind kind, bool paused, struct fovea_outputs *outputs)
{
    const struct fovea_pose *pose = fv_publish_pose(&rt->publish);
    const bool of_base = kind == FV_MESSAGE_POSE;
    struct fv_sim3 S_map_odom;
    struct fv_se3 T;
    fv_se3_from_rows(pose->T_world_cam, &T);
    if (of_base) T = fv_publish_body_pose(&rt->publish);
    struct fv_message_pose message = {
        .stamp = paused ? fv_message_stamp(inputs->frame, inputs->utc_offset_ns)
                        : fv_frame_id_stamp(&rt->state->frame),
        .parent_frame = of_base ? "odom" : "world",
        .child_frame = of_base ? "base" : "camera",
        .pose = pose,
        .paused = paused,
        .reference_keyframe = pose->posed ? (int64_t)pose->reference_keyframe : -1,
        .latency_ns = inputs->latency_ns,
    };
    memcpy(message.position, T.t, sizeof message.position);
    fv_so3_to_quaternion(T.R, message.orientation);
    memcpy(message.covariance, pose->covariance, sizeof message.covariance);
    if (of_base) fv_publish_body_covariance(&rt->publish, message.covariance);
    fv_publish_map(&rt->publish, of_base, &S_map_odom);
    memcpy(message.map_position, S_map_odom.t, sizeof message.map_position);
    fv_so3_to_quaternion(S_map_odom.R, message.map_orientation);
    fv_output_add(
        rt, kind,
        fv_message_pose_encode(&message, rt->outbox.buffer[kind], rt->outbox.capacity[kind]),
        outputs);
}

static void encode_bot_core_pose(struct fovea *rt, struct fovea_outputs *outputs)
{
    const enum fv_message_kind kind = FV_MESSAGE_BOT_CORE_POSE;
    const struct fovea_pose *pose = fv_publish_pose(&rt->publish);
    const struct fv_rates *rates = fv_publish_body_rates(&rt->publish);
    const struct fv_se3 T_odom_body = fv_publish_body_pose(&rt->publish);
    const struct fv_frame_id *frame = &rt->state->frame;
    if (!pose->posed ||
        (pose->scale_source == FOVEA_SCALE_FREE && !rt->config.scale.allow_unscaled))
        return;
    struct fv_message_bot_core_pose message = {.utime =
                                                   (frame->stamp_ns + frame->utc_offset_ns) / 1000};
    memcpy(message.position, T_odom_body.t, sizeof message.position);
    fv_so3_to_quaternion(T_odom_body.R, message.orientation);
    memcpy(message.velocity, rates->velocity, sizeof message.velocity);
    memcpy(message.rotation_rate, rates->rotation_rate, sizeof message.rotation_rate);
    fv_output_add(rt, kind,
                  fv_message_bot_core_pose_encode(&message, rt->outbox.buffer[kind],
                                                  rt->outbox.capacity[kind]),
                  outputs);
}

void fv_encode_poses(struct fovea *rt, const struct fovea_inputs *inputs,
                     struct fovea_outputs *outputs)
{
    encode_pose(rt, inputs, FV_MESSAGE_POSE, false, outputs);
    encode_pose(rt, inputs, FV_MESSAGE_CAMERA_POSE, false, outputs);
    encode_bot_core_pose(rt, outputs);
}

void fv_encode_paused(struct fovea *rt, const struct fovea_inputs *inputs,
                      struct fovea_outputs *outputs)
{
    encode_pose(rt, inputs, FV_MESSAGE_POSE, true, outputs);
    encode_pose(rt, inputs, FV_MESSAGE_CAMERA_POSE, true, outputs);
}
