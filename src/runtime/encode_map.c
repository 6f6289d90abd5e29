#include "runtime/encode_map.h"

#include "runtime/jobs.h"

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void add_landmarks(const struct fv_map *map, struct fv_message_map *message)
{
    for (int32_t slot = message->landmark_first; slot < message->landmark_last; slot++) {
        const struct fv_landmark *l = &map->landmarks[slot];
        if (!l->used || l->observer_count == 0) continue;
        struct fv_message_landmark *out = &message->landmarks[message->landmark_count++];
        out->slot = slot;
        out->map_id = (int32_t)map->keyframes[l->observers[0].keyframe].map_id;
        for (int k = 0; k < 3; k++)
            out->point[k] = (float)l->point[k];
    }
}

static void add_keyframes(const struct fv_map *map, struct fv_message_map *message)
{
    for (int32_t slot = message->keyframe_first; slot < message->keyframe_last; slot++) {
        const struct fv_keyframe *keyframe = &map->keyframes[slot];
        if (!keyframe->used) continue;
        struct fv_message_keyframe *out = &message->keyframes[message->keyframe_count++];
        struct fv_se3 T;
        double q[4];
        fv_se3_invert(&keyframe->T_cam_world, &T);
        fv_so3_to_quaternion(T.R, q);
        out->slot = slot;
        out->map_id = (int32_t)keyframe->map_id;
        out->parent = keyframe->parent;
        for (int k = 0; k < 3; k++)
            out->pose[k] = (float)T.t[k];
        for (int k = 0; k < 4; k++)
            out->pose[3 + k] = (float)q[k];
    }
}

void fv_encode_map(struct fovea *rt, struct fovea_outputs *outputs)
{
    const struct fv_map *map = &rt->odometry.map;
    struct fv_state *state = rt->state;
    const uint32_t landmark_last =
        least(state->map_landmark + FV_MESSAGE_MAP_LANDMARKS, map->limits.landmarks);
    const uint32_t keyframe_last =
        least(state->map_keyframe + FV_MESSAGE_MAP_KEYFRAMES, map->limits.keyframes);
    struct fv_message_map message = {
        .stamp = fv_frame_id_stamp(&state->frame),
        .map_id = (int32_t)map->state->map_id,
        .landmark_slots = (int32_t)map->limits.landmarks,
        .landmark_first = (int32_t)state->map_landmark,
        .landmark_last = (int32_t)landmark_last,
        .keyframe_slots = (int32_t)map->limits.keyframes,
        .keyframe_first = (int32_t)state->map_keyframe,
        .keyframe_last = (int32_t)keyframe_last,
    };
    add_landmarks(map, &message);
    add_keyframes(map, &message);
    state->map_landmark = landmark_last < map->limits.landmarks ? landmark_last : 0;
    state->map_keyframe = keyframe_last < map->limits.keyframes ? keyframe_last : 0;
    fv_output_add(rt, FV_MESSAGE_MAP,
                  fv_message_map_encode(&message, rt->outbox.buffer[FV_MESSAGE_MAP],
                                        rt->outbox.capacity[FV_MESSAGE_MAP]),
                  outputs);
}
