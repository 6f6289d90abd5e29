/* Detections as LCM bytes. */
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_detections_t.h"

enum { FLOATS = 9 }; /* score and two boxes */

size_t fv_message_detections_size_max(uint32_t count_max, size_t name_bytes, size_t label_bytes)
{
    fovea_detections_t empty;
    memset(&empty, 0, sizeof empty);
    empty.model = (char *)"";
    const size_t each =
        sizeof(int32_t) + FLOATS * sizeof(float) + sizeof(int32_t) + label_bytes + 1;
    return (size_t)fovea_detections_t_encoded_size(&empty) + name_bytes + count_max * each;
}

size_t fv_message_detections_scratch_bytes(uint32_t count_max)
{
    return (size_t)count_max * (sizeof(char *) + sizeof(int32_t) + FLOATS * sizeof(float));
}

uint32_t fv_message_detections_encode(const struct fv_message_detections *in, void *scratch,
                                      uint8_t *buffer, size_t capacity)
{
    const uint32_t n = in->count;
    char **names = scratch;
    int32_t *class_id = (int32_t *)(void *)(names + n);
    float *column[FLOATS];
    for (int k = 0; k < FLOATS; k++)
        column[k] = (float *)(void *)(class_id + n) + (size_t)k * n;
    for (uint32_t i = 0; i < n; i++) {
        const struct fovea_detection *found = &in->detections[i];
        const float values[5] = {found->score, found->x_min_px, found->y_min_px, found->x_max_px,
                                 found->y_max_px};
        names[i] = (char *)in->names[i]; /* lcm-gen knows no const; it only reads */
        class_id[i] = found->class_id;
        for (int k = 0; k < 5; k++)
            column[k][i] = values[k];
        for (int k = 0; k < 4; k++)
            column[5 + k][i] = in->rectified_boxes[i][k];
    }
    const fovea_detections_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .model = (char *)in->model,
        .width = in->width,
        .height = in->height,
        .rectified_shape = in->rectified_shape,
        .rectified_fx = in->rectified[0],
        .rectified_fy = in->rectified[1],
        .rectified_cx = in->rectified[2],
        .rectified_cy = in->rectified[3],
        .count = (int32_t)n,
        .class_id = class_id,
        .class_name = names,
        .score = column[0],
        .x_min_px = column[1],
        .y_min_px = column[2],
        .x_max_px = column[3],
        .y_max_px = column[4],
        .rectified_x_min_px = column[5],
        .rectified_y_min_px = column[6],
        .rectified_x_max_px = column[7],
        .rectified_y_max_px = column[8],
    };
    return fv_wire_encoded(
        fovea_detections_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
