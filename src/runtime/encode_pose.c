/* Pose messages: of the robot's body and of its first camera, in `odom`. */
#include "runtime/encode_pose.h"

#include <string.h>

#include "runtime/jobs.h"

static struct fv_message_transform transform_of(const struct fv_se3 *T)
{
    struct fv_message_transform out;
    memcpy(out.position, T->t, sizeof out.position);
    fv_so3_to_quaternion(T->R, out.orientation);
    return out;
}

static void fill_change(const struct fv_publish *publish, struct fv_message_pose *message)
{
    const struct fv_publish_change change = fv_publish_last_change(publish);
    message->change_count = change.count;
    message->change_scale = change.S_new_old.s;
    memcpy(message->change.position, change.S_new_old.t, sizeof message->change.position);
    fv_so3_to_quaternion(change.S_new_old.R, message->change.orientation);
}

static void fill_inertial(const struct fovea *rt, struct fv_message_pose *message)
{
    const struct fv_inertial_known *known = fv_inertial_stage_known(&rt->inertial);
    struct fv_map_gravity kept;
    struct fv_imu_biases biases;
    double gravity[3];
    message->biased = fv_inertial_stage_biases(&rt->inertial, &biases, message->bias_covariance);
    memcpy(message->gyro_bias, biases.gyro, sizeof message->gyro_bias);
    memcpy(message->acceleration_bias, biases.acceleration, sizeof message->acceleration_bias);
    if (known != NULL) {
        fv_publish_turn(&rt->publish, known->gravity, message->gravity);
        message->gravity_sigma = known->gravity_sigma;
    } else if (fv_odometry_gravity(&rt->odometry, &kept)) { /* the map that was entered has it */
        for (int i = 0; i < 3; i++)
            gravity[i] = rt->config.odometry.gravity_m_s2 * kept.down[i];
        fv_publish_turn(&rt->publish, gravity, message->gravity);
        message->gravity_sigma = kept.sigma;
    }
}

static void encode_pose(struct fovea *rt, const struct fovea_inputs *inputs,
                        enum fv_message_kind kind, bool paused, struct fovea_outputs *outputs)
{
    const struct fv_publish *publish = &rt->publish;
    const enum fv_publish_child child =
        kind == FV_MESSAGE_POSE ? FV_PUBLISH_BODY : FV_PUBLISH_CAMERA;
    const struct fv_rates *rates = fv_publish_rates(publish, child);
    const struct fv_se3 T_odom_child = fv_publish_child_pose(publish, child),
                        T_keyframe_child = fv_publish_keyframe_pose(publish, child);
    const struct fv_sim3 S_map_odom = fv_publish_map(publish);
    struct fv_message_pose message = {
        .stamp = paused ? fv_message_stamp(inputs->frame, inputs->utc_offset_ns)
                        : fv_frame_id_stamp(&rt->state->frame),
        .parent_frame = "odom",
        .child_frame = child == FV_PUBLISH_BODY ? "body" : "cam0",
        .pose = fv_publish_pose(publish),
        .paused = paused,
        .uncalibrated = rt->config.camera_fov_deg > 0,
        .scale_configured = rt->config.scale.source != FOVEA_SCALE_FREE || rt->inertial.enabled,
        .T_parent_child = transform_of(&T_odom_child),
        .moving = rates->known,
        .T_keyframe_child = transform_of(&T_keyframe_child),
        .latency_ns = inputs->latency_ns,
    };
    message.velocity_sigma = rates->velocity_sigma;
    message.angular_rate_sigma = rates->rotation_rate_sigma;
    memcpy(message.velocity, rates->velocity, sizeof message.velocity);
    memcpy(message.angular_rate, rates->rotation_rate, sizeof message.angular_rate);
    memcpy(message.T_map_parent.position, S_map_odom.t, sizeof message.T_map_parent.position);
    fv_so3_to_quaternion(S_map_odom.R, message.T_map_parent.orientation);
    fv_publish_covariance(publish, child, message.covariance);
    fill_change(publish, &message);
    fill_inertial(rt, &message);
    fv_output_add(
        rt, kind,
        fv_message_pose_encode(&message, rt->outbox.buffer[kind], rt->outbox.capacity[kind]),
        outputs);
}

static void encode_bot_core_pose(struct fovea *rt, struct fovea_outputs *outputs)
{
    const enum fv_message_kind kind = FV_MESSAGE_BOT_CORE_POSE;
    const struct fovea_pose *pose = fv_publish_pose(&rt->publish);
    const struct fv_rates *rates = fv_publish_rates(&rt->publish, FV_PUBLISH_BODY);
    const struct fv_se3 T_odom_body = fv_publish_child_pose(&rt->publish, FV_PUBLISH_BODY);
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

void fv_encode_fast_pose(struct fovea *rt, const struct fv_sense_pose *pose,
                         struct fovea_outputs *outputs)
{
    const struct fv_sense_anchor *from = &rt->sense->anchor;
    struct fv_message_fast_pose message = {
        .stamp = fv_frame_id_stamp(&from->frame),
        .since_ns = pose->since_ns,
        .reset_counter = from->reset_counter,
        .map_id = from->map_id,
        .change_count = from->change_count,
        .T_odom_body = transform_of(&pose->T_odom_body),
    };
    message.stamp.time_ns = pose->stamp_ns;
    memcpy(message.velocity, pose->velocity, sizeof message.velocity);
    memcpy(message.angular_rate, pose->angular_rate, sizeof message.angular_rate);
    fv_output_add(rt, FV_MESSAGE_POSE_FAST,
                  fv_message_fast_pose_encode(&message, rt->outbox.buffer[FV_MESSAGE_POSE_FAST],
                                              rt->outbox.capacity[FV_MESSAGE_POSE_FAST]),
                  outputs);
}
