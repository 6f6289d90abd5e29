#include "runtime/encode_map.h"

#include <string.h>

#include "runtime/jobs.h"

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void add_landmarks(const struct fv_map *map, struct fv_message_map *message)
{
    for (int32_t slot = message->landmark_first; slot < message->landmark_last; slot++) {
        uint32_t map_id;
        double position[3];
        if (!fv_map_landmark_at(map, (uint32_t)slot, &map_id, position)) continue;
        struct fv_message_landmark *out = &message->landmarks[message->landmark_count++];
        out->slot = slot;
        out->map_id = (int32_t)map_id;
        for (int k = 0; k < 3; k++)
            out->point[k] = (float)position[k];
    }
}

static void add_keyframes(const struct fv_map *map, struct fv_message_map *message)
{
    for (int32_t slot = message->keyframe_first; slot < message->keyframe_last; slot++) {
        struct fv_map_keyframe keyframe;
        if (!fv_map_keyframe_at(map, (uint32_t)slot, &keyframe)) continue;
        struct fv_message_keyframe *out = &message->keyframes[message->keyframe_count++];
        double q[4];
        fv_so3_to_quaternion(keyframe.T_world_cam.R, q);
        out->slot = slot;
        out->map_id = (int32_t)keyframe.map_id;
        out->parent = keyframe.parent;
        out->number = (int64_t)keyframe.number;
        out->stamp_ns = keyframe.stamp_ns;
        for (int k = 0; k < 3; k++)
            out->position[k] = (float)keyframe.T_world_cam.t[k];
        for (int k = 0; k < 4; k++)
            out->orientation[k] = (float)q[k];
    }
}

void fv_encode_map(struct fovea *rt, struct fovea_outputs *outputs)
{
    const struct fv_map *map = fv_odometry_map(&rt->odometry);
    const struct fv_map_slots slots = fv_map_slot_counts(map);
    struct fv_state *state = rt->state;
    const uint32_t landmark_last =
        least(state->map_landmark + FV_MESSAGE_MAP_LANDMARKS, slots.landmarks);
    const uint32_t keyframe_last =
        least(state->map_keyframe + FV_MESSAGE_MAP_KEYFRAMES, slots.keyframes);
    struct fv_message_map message = {
        .stamp = fv_frame_id_stamp(&state->frame),
        .map_id = (int32_t)fv_map_current_id(map),
        .landmark_slots = (int32_t)slots.landmarks,
        .landmark_first = (int32_t)state->map_landmark,
        .landmark_last = (int32_t)landmark_last,
        .keyframe_slots = (int32_t)slots.keyframes,
        .keyframe_first = (int32_t)state->map_keyframe,
        .keyframe_last = (int32_t)keyframe_last,
    };
    const struct fv_sim3 S_map_own = fv_publish_own_map(&rt->publish);
    message.own_scale = S_map_own.s;
    memcpy(message.own.position, S_map_own.t, sizeof message.own.position);
    fv_so3_to_quaternion(S_map_own.R, message.own.orientation);
    add_landmarks(map, &message);
    add_keyframes(map, &message);
    state->map_landmark = landmark_last < slots.landmarks ? landmark_last : 0;
    state->map_keyframe = keyframe_last < slots.keyframes ? keyframe_last : 0;
    fv_output_add(rt, FV_MESSAGE_MAP,
                  fv_message_map_encode(&message, rt->outbox.buffer[FV_MESSAGE_MAP],
                                        rt->outbox.capacity[FV_MESSAGE_MAP]),
                  outputs);
}
