/* Keypoints, and the classes of whole images, as LCM bytes. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_classes_t.h"
#include "fovea_keypoints_t.h"

static_assert((int)FOVEA_KEYPOINT_SETS_MAX == FOVEA_KEYPOINTS_T_COUNT_MAX &&
                  (int)FOVEA_KEYPOINTS_MAX == FOVEA_KEYPOINTS_T_POINTS_MAX,
              "the limits of keypoints_t");
static_assert((int)FV_MESSAGE_CLASSES_MAX == FOVEA_CLASSES_T_COUNT_MAX, "the limit of classes_t");

/* Sets, then rows of the points, positions, scores and names. */
size_t fv_message_keypoints_scratch_bytes(uint32_t sets, uint32_t points)
{
    return sets * (sizeof(fovea_keypoint_set_t) + FV_MESSAGE_LABEL_BYTES_MAX) +
           (size_t)sets * points * (sizeof(float *) + 3 * sizeof(float));
}

size_t fv_message_keypoints_size_max(uint32_t sets, uint32_t points)
{
    fovea_keypoints_t empty;
    fovea_keypoint_set_t one;
    memset(&empty, 0, sizeof empty);
    memset(&one, 0, sizeof one);
    empty.model = one.class_name = (char *)"";
    const size_t each = (size_t)__fovea_keypoint_set_t_encoded_array_size(&one, 1) +
                        FV_MESSAGE_LABEL_BYTES_MAX - 1 + points * 3 * sizeof(float);
    return (size_t)fovea_keypoints_t_encoded_size(&empty) + FV_MESSAGE_LABEL_BYTES_MAX - 1 +
           sets * each;
}

uint32_t fv_message_keypoints_encode(const struct fv_message_keypoints *in, void *scratch,
                                     uint8_t *buffer, size_t capacity)
{
    const size_t each = in->point_count, total = each * in->count;
    fovea_keypoint_set_t *sets = scratch;
    float **rows = (void *)(sets + in->count), (*px)[2] = (void *)(rows + total),
          *score = (void *)(px + total);
    char(*names)[FV_MESSAGE_LABEL_BYTES_MAX] = (void *)(score + total),
    model[FV_MESSAGE_LABEL_BYTES_MAX];
    fv_message_label(in->model, model);
    for (size_t i = 0; i < total; i++) {
        rows[i] = px[i];
        px[i][0] = in->points[i].x_px;
        px[i][1] = in->points[i].y_px;
        score[i] = in->points[i].score;
    }
    for (uint32_t i = 0; i < in->count; i++) {
        const struct fovea_detection *found = &in->detections[i];
        fv_message_label(in->names[i], names[i]);
        sets[i] = (fovea_keypoint_set_t){
            .class_id = found->class_id,
            .class_name = names[i],
            .score = found->score,
            .box = {found->x_min_px, found->y_min_px, found->x_max_px, found->y_max_px},
            .point_count = (int32_t)each,
            .p_px = rows + i * each,
            .point_score = score + i * each,
        };
    }
    const fovea_keypoints_t message = {.stamp = in->stamp,
                                       .model = model,
                                       .width = in->width,
                                       .height = in->height,
                                       .count = (int32_t)in->count,
                                       .sets = sets};
    return fv_wire_encoded(
        fovea_keypoints_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_classes_size_max(uint32_t count_max)
{
    fovea_classes_t empty;
    fovea_class_score_t one;
    memset(&empty, 0, sizeof empty);
    memset(&one, 0, sizeof one);
    empty.model = one.class_name = (char *)"";
    return (size_t)fovea_classes_t_encoded_size(&empty) + FV_MESSAGE_LABEL_BYTES_MAX - 1 +
           count_max * ((size_t)__fovea_class_score_t_encoded_array_size(&one, 1) +
                        FV_MESSAGE_LABEL_BYTES_MAX - 1);
}

uint32_t fv_message_classes_encode(const struct fv_message_classes *in, uint8_t *buffer,
                                   size_t capacity)
{
    fovea_class_score_t list[FV_MESSAGE_CLASSES_MAX];
    char names[FV_MESSAGE_CLASSES_MAX][FV_MESSAGE_LABEL_BYTES_MAX],
        model[FV_MESSAGE_LABEL_BYTES_MAX];
    fv_message_label(in->model, model);
    for (uint32_t i = 0; i < in->count; i++) {
        fv_message_label(in->names[i], names[i]);
        list[i] = (fovea_class_score_t){.class_id = in->detections[i].class_id,
                                        .class_name = names[i],
                                        .score = in->detections[i].score};
    }
    const fovea_classes_t message = {
        .stamp = in->stamp, .model = model, .count = (int32_t)in->count, .classes = list};
    return fv_wire_encoded(fovea_classes_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
