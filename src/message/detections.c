/* Detections as LCM bytes. */
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_detections_t.h"

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

size_t fv_message_detections_size_max(uint32_t count_max, size_t label_bytes)
{
    fovea_detections_t empty;
    fovea_detection_t one;
    memset(&empty, 0, sizeof empty);
    memset(&one, 0, sizeof one);
    empty.model = one.class_name = (char *)"";
    const size_t each = (size_t)__fovea_detection_t_encoded_array_size(&one, 1) +
                        least(label_bytes, FV_MESSAGE_LABEL_BYTES_MAX - 1);
    return (size_t)fovea_detections_t_encoded_size(&empty) + FV_MESSAGE_LABEL_BYTES_MAX - 1 +
           count_max * each;
}

/* Labels that fit are read where they are; longer ones are cut in the scratch. */
static bool labels_fit(size_t label_bytes)
{
    return label_bytes < FV_MESSAGE_LABEL_BYTES_MAX;
}

size_t fv_message_detections_scratch_bytes(uint32_t count_max, size_t label_bytes)
{
    return (size_t)count_max *
           (sizeof(fovea_detection_t) + (labels_fit(label_bytes) ? 0 : FV_MESSAGE_LABEL_BYTES_MAX));
}

uint32_t fv_message_detections_encode(const struct fv_message_detections *in, void *scratch,
                                      uint8_t *buffer, size_t capacity)
{
    fovea_detection_t *list = scratch;
    char(*cut)[FV_MESSAGE_LABEL_BYTES_MAX] = (void *)(list + in->count);
    char model[FV_MESSAGE_LABEL_BYTES_MAX];
    fv_message_label(in->model, model);
    for (uint32_t i = 0; i < in->count; i++) {
        const struct fovea_detection *found = &in->detections[i];
        const float *rectified = in->rectified_boxes[i];
        const bool whole = labels_fit(strlen(in->names[i]));
        if (!whole) fv_message_label(in->names[i], cut[i]);
        list[i] = (fovea_detection_t){
            .class_id = found->class_id,
            .class_name = whole ? (char *)in->names[i] : cut[i], /* lcm-gen only reads it */
            .score = found->score,
            .box = {found->x_min_px, found->y_min_px, found->x_max_px, found->y_max_px},
            .angle = found->angle,
            .rectified_box = {rectified[0], rectified[1], rectified[2], rectified[3]},
        };
    }
    const fovea_detections_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .model = model,
        .width = in->width,
        .height = in->height,
        .rectified_shape = in->rectified_shape,
        .rectified_fx = in->rectified[0],
        .rectified_fy = in->rectified[1],
        .rectified_cx = in->rectified[2],
        .rectified_cy = in->rectified[3],
        .count = (int32_t)in->count,
        .detections = list,
    };
    return fv_wire_encoded(
        fovea_detections_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
