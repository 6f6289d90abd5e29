/* Pieces of the map as LCM bytes. */
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_map_t.h"

enum { LANDMARK_BYTES = 2 * sizeof(int32_t) + 3 * sizeof(float) };

size_t fv_message_map_size_max(void)
{
    fovea_map_t empty;
    fovea_keyframe_t keyframe;
    memset(&empty, 0, sizeof empty);
    memset(&keyframe, 0, sizeof keyframe);
    return (size_t)fovea_map_t_encoded_size(&empty) + FV_MESSAGE_MAP_LANDMARKS * LANDMARK_BYTES +
           FV_MESSAGE_MAP_KEYFRAMES * (size_t)__fovea_keyframe_t_encoded_array_size(&keyframe, 1);
}

static void fill_keyframe(fovea_keyframe_t *out, const struct fv_message_keyframe *in)
{
    *out = (fovea_keyframe_t){
        .slot = in->slot,
        .map_id = in->map_id,
        .number = in->number,
        .stamp_ns = in->stamp_ns,
        .parent = in->parent,
    };
    memcpy(out->position, in->position, sizeof out->position);
    memcpy(out->orientation, in->orientation, sizeof out->orientation);
}

uint32_t fv_message_map_encode(const struct fv_message_map *in, uint8_t *buffer, size_t capacity)
{
    int32_t slot[FV_MESSAGE_MAP_LANDMARKS], map[FV_MESSAGE_MAP_LANDMARKS];
    float *point[FV_MESSAGE_MAP_LANDMARKS];
    fovea_keyframe_t keyframes[FV_MESSAGE_MAP_KEYFRAMES];
    for (uint32_t i = 0; i < in->landmark_count; i++) {
        slot[i] = in->landmarks[i].slot;
        map[i] = in->landmarks[i].map_id;
        point[i] = (float *)in->landmarks[i].point; /* lcm-gen knows no const; it only reads */
    }
    for (uint32_t i = 0; i < in->keyframe_count; i++)
        fill_keyframe(&keyframes[i], &in->keyframes[i]);
    fovea_map_t message = {
        .stamp = in->stamp,
        .map_id = in->map_id,
        .own_scale = in->own_scale,
        .landmark_slots = in->landmark_slots,
        .landmark_first = in->landmark_first,
        .landmark_last = in->landmark_last,
        .landmark_count = (int32_t)in->landmark_count,
        .landmark_slot = slot,
        .landmark_map = map,
        .landmark_p = point,
        .keyframe_slots = in->keyframe_slots,
        .keyframe_first = in->keyframe_first,
        .keyframe_last = in->keyframe_last,
        .keyframe_count = (int32_t)in->keyframe_count,
        .keyframes = keyframes,
    };
    memcpy(message.own_position, in->own.position, sizeof message.own_position);
    memcpy(message.own_orientation, in->own.orientation, sizeof message.own_orientation);
    return fv_wire_encoded(fovea_map_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
