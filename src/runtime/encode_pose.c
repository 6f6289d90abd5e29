/* Pose messages: of the camera in `world`, and of the robot's base in `odom`. */
#include <string.h>

#include "geometry/sim3.h"
#include "geometry/vec.h"
#include "runtime/encode_pose.h"
#include "runtime/jobs.h"

static const int64_t pause_max_ns =
    500000000; /* between frames; over a longer one there is no velocity */

/* T_base_cam as far as it can be used: while the scale is free, its metres mean nothing beside the
 * map's units, and the base is taken to sit where the camera does. */
static struct fv_se3 base_from_camera(const struct fovea *rt)
{
    struct fv_se3 T_base_cam;
    fv_se3_from_rows(rt->config.T_base_cam, &T_base_cam);
    if (rt->scale.state->pose.scale_source == FOVEA_SCALE_FREE)
        memset(T_base_cam.t, 0, sizeof T_base_cam.t);
    return T_base_cam;
}

/* The base's frame at the start is `odom`, the first camera's is `world`: T_odom_base = B
 * T_world_cam B^-1 with B = T_base_cam. */
static struct fv_se3 base_pose(const struct fovea *rt, const struct fv_se3 *B)
{
    struct fv_se3 T, inverse;
    fv_se3_from_rows(rt->scale.state->pose.T_world_cam, &T);
    fv_se3_invert(B, &inverse);
    fv_se3_compose(B, &T, &T);
    fv_se3_compose(&T, &inverse, &T);
    return T;
}

/* Covariance of a small motion of the camera, as one of the base: by the adjoint of T_base_cam.
 * Upper triangles by rows, translation first. */
static void base_covariance(const struct fv_se3 *B, const double camera[21], double base[21])
{
    double A[36] = {0}, C[36], AC[36] = {0};
    const double *t = B->t, cross[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
    double shifted[9];
    fv_multiply33(cross, B->R, shifted);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            A[6 * r + c] = A[6 * (r + 3) + c + 3] = B->R[3 * r + c];
            A[6 * r + c + 3] = shifted[3 * r + c];
        }
    }
    for (int r = 0, k = 0; r < 6; r++)
        for (int c = r; c < 6; c++, k++)
            C[6 * r + c] = C[6 * c + r] = camera[k];
    for (int r = 0; r < 6; r++)
        for (int c = 0; c < 6; c++)
            for (int i = 0; i < 6; i++)
                AC[6 * r + c] += A[6 * r + i] * C[6 * i + c];
    for (int r = 0, k = 0; r < 6; r++) {
        for (int c = r; c < 6; c++, k++) {
            base[k] = 0;
            for (int i = 0; i < 6; i++)
                base[k] += AC[6 * r + i] * A[6 * c + i];
        }
    }
}

/* T_map_odom of the published frame: in its unit, and for the base about the base's frame at the
 * start. */
static void fill_map(const struct fovea_pose *pose, const struct fv_se3 *B, bool of_base,
                     struct fv_message_pose *message)
{
    struct fv_se3 inverse;
    struct fv_sim3 S, left, right;
    fv_se3_from_rows(pose->T_map_odom, &inverse);
    fv_sim3_from_se3(&inverse, pose->map_scale, &S);
    if (of_base) {
        fv_se3_invert(B, &inverse);
        fv_sim3_from_se3(B, 1, &left);
        fv_sim3_from_se3(&inverse, 1, &right);
        fv_sim3_compose(&left, &S, &S);
        fv_sim3_compose(&S, &right, &S);
    }
    memcpy(message->map_position, S.t, sizeof message->map_position);
    fv_so3_to_quaternion(S.R, message->map_orientation);
}

static void encode_pose(struct fovea *rt, const struct fovea_inputs *inputs,
                        enum fv_message_kind kind, struct fovea_outputs *outputs)
{
    const struct fovea_pose *pose = &rt->scale.state->pose;
    const bool of_base = kind == FV_MESSAGE_POSE;
    const struct fv_se3 B = base_from_camera(rt);
    struct fv_se3 T;
    fv_se3_from_rows(pose->T_world_cam, &T);
    if (of_base) T = base_pose(rt, &B);
    struct fv_message_pose message = {
        .stamp = fv_frame_id_stamp(&rt->state->frame),
        .parent_frame = of_base ? "odom" : "world",
        .child_frame = of_base ? "base" : "camera",
        .pose = pose,
        .reference_keyframe = pose->posed ? (int64_t)pose->reference_keyframe : -1,
        .latency_ns = inputs->latency_ns,
    };
    memcpy(message.position, T.t, sizeof message.position);
    memcpy(message.covariance, pose->covariance, sizeof message.covariance);
    fill_map(pose, &B, of_base, &message);
    if (of_base) base_covariance(&B, pose->covariance, message.covariance);
    fv_so3_to_quaternion(T.R, message.orientation);
    fv_output_add(
        rt, kind,
        fv_message_pose_encode(&message, rt->outbox.buffer[kind], rt->outbox.capacity[kind]),
        outputs);
}

/* Rates from the last two frames, 0 where there are no two of the same world and unit. */
static void fill_rates(const struct fv_state *state, const struct fv_se3 *T,
                       struct fv_message_bot_core_pose *message)
{
    const int64_t step_ns = state->frame.stamp_ns - state->base_ns;
    if (!state->base_known || step_ns <= 0 || step_ns > pause_max_ns) return;
    struct fv_se3 before, inverse, turn;
    fv_se3_from_rows(state->base, &before);
    fv_se3_invert(&before, &inverse);
    fv_se3_compose(&inverse, T, &turn);
    fv_so3_log(turn.R, message->rotation_rate);
    for (int i = 0; i < 3; i++) {
        message->rotation_rate[i] *= 1e9 / (double)step_ns;
        message->velocity[i] = (T->t[i] - before.t[i]) * 1e9 / (double)step_ns;
    }
}

static void encode_bot_core_pose(struct fovea *rt, bool due, struct fovea_outputs *outputs)
{
    const enum fv_message_kind kind = FV_MESSAGE_BOT_CORE_POSE;
    const struct fovea_pose *pose = &rt->scale.state->pose;
    struct fv_state *state = rt->state;
    const uint32_t world = 4 * pose->map_id + (uint32_t)pose->scale_source;
    if (state->base_world != world) state->base_known = 0;
    if (!pose->posed) {
        state->base_known = 0;
        return;
    }
    const struct fv_se3 B = base_from_camera(rt), T = base_pose(rt, &B);
    struct fv_message_bot_core_pose message = {
        .utime = (state->frame.stamp_ns + state->frame.utc_offset_ns) / 1000};
    memcpy(message.position, T.t, sizeof message.position);
    fv_so3_to_quaternion(T.R, message.orientation);
    fill_rates(state, &T, &message);
    fv_se3_to_rows(&T, state->base);
    state->base_ns = state->frame.stamp_ns;
    state->base_known = 1;
    state->base_world = world;
    if (!due || (pose->scale_source == FOVEA_SCALE_FREE && !rt->config.scale.allow_unscaled))
        return;
    fv_output_add(rt, kind,
                  fv_message_bot_core_pose_encode(&message, rt->outbox.buffer[kind],
                                                  rt->outbox.capacity[kind]),
                  outputs);
}

void fv_encode_poses(struct fovea *rt, const struct fovea_inputs *inputs, bool due,
                     struct fovea_outputs *outputs)
{
    if (due) {
        encode_pose(rt, inputs, FV_MESSAGE_POSE, outputs);
        encode_pose(rt, inputs, FV_MESSAGE_CAMERA_POSE, outputs);
    }
    encode_bot_core_pose(rt, due, outputs);
}
