/* Pieces of the map as LCM bytes. */
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_map_t.h"

size_t fv_message_map_size_max(void)
{
    fovea_map_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_map_t_encoded_size(&empty) + FV_MESSAGE_MAP_LANDMARKS * 20 +
           FV_MESSAGE_MAP_KEYFRAMES * 40;
}

uint32_t fv_message_map_encode(const struct fv_message_map *in, uint8_t *buffer, size_t capacity)
{
    int32_t slot[FV_MESSAGE_MAP_LANDMARKS], map[FV_MESSAGE_MAP_LANDMARKS];
    int32_t keyframe[3][FV_MESSAGE_MAP_KEYFRAMES];
    float point[3][FV_MESSAGE_MAP_LANDMARKS], pose[7][FV_MESSAGE_MAP_KEYFRAMES];
    for (uint32_t i = 0; i < in->landmark_count; i++) {
        slot[i] = in->landmarks[i].slot;
        map[i] = in->landmarks[i].map_id;
        for (int k = 0; k < 3; k++)
            point[k][i] = in->landmarks[i].point[k];
    }
    for (uint32_t i = 0; i < in->keyframe_count; i++) {
        keyframe[0][i] = in->keyframes[i].slot;
        keyframe[1][i] = in->keyframes[i].map_id;
        keyframe[2][i] = in->keyframes[i].parent;
        for (int k = 0; k < 7; k++)
            pose[k][i] = in->keyframes[i].pose[k];
    }
    const fovea_map_t message = {
        .stamp = in->stamp,
        .map_id = in->map_id,
        .landmark_slots = in->landmark_slots,
        .landmark_first = in->landmark_first,
        .landmark_last = in->landmark_last,
        .landmark_count = (int32_t)in->landmark_count,
        .landmark_slot = slot,
        .landmark_map = map,
        .landmark_x = point[0],
        .landmark_y = point[1],
        .landmark_z = point[2],
        .keyframe_slots = in->keyframe_slots,
        .keyframe_first = in->keyframe_first,
        .keyframe_last = in->keyframe_last,
        .keyframe_count = (int32_t)in->keyframe_count,
        .keyframe_slot = keyframe[0],
        .keyframe_map = keyframe[1],
        .keyframe_parent = keyframe[2],
        .keyframe_x = pose[0],
        .keyframe_y = pose[1],
        .keyframe_z = pose[2],
        .keyframe_qw = pose[3],
        .keyframe_qx = pose[4],
        .keyframe_qy = pose[5],
        .keyframe_qz = pose[6],
    };
    return fv_wire_encoded(fovea_map_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
