/* Objects as LCM bytes. */
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_objects_t.h"

size_t fv_message_objects_size_max(uint32_t count_max, size_t label_bytes)
{
    fovea_objects_t empty;
    fovea_object_t one;
    memset(&empty, 0, sizeof empty);
    memset(&one, 0, sizeof one);
    one.class_name = (char *)"";
    if (label_bytes >= FV_MESSAGE_LABEL_BYTES_MAX) label_bytes = FV_MESSAGE_LABEL_BYTES_MAX - 1;
    return (size_t)fovea_objects_t_encoded_size(&empty) +
           count_max * ((size_t)__fovea_object_t_encoded_array_size(&one, 1) + label_bytes);
}

size_t fv_message_objects_scratch_bytes(uint32_t count_max, size_t label_bytes)
{
    const bool cut = label_bytes >= FV_MESSAGE_LABEL_BYTES_MAX;
    return (size_t)count_max * (sizeof(fovea_object_t) + (cut ? FV_MESSAGE_LABEL_BYTES_MAX : 0));
}

/* A vector in another frame: by the rotation of T, and by its translation when `point`. */
static void move(const double T[12], bool point, const double v[3], float moved[3])
{
    for (int i = 0; i < 3; i++)
        moved[i] = (float)(T[4 * i] * v[0] + T[4 * i + 1] * v[1] + T[4 * i + 2] * v[2] +
                           (point ? T[4 * i + 3] : 0.0));
}

/* R C R' of a covariance, upper triangles by rows. */
static void move_covariance(const double T[12], const double c[6], float moved[6])
{
    const double C[3][3] = {{c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    for (int row = 0, k = 0; row < 3; row++) {
        for (int column = row; column < 3; column++, k++) {
            double sum = 0;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    sum += T[4 * row + i] * C[i][j] * T[4 * column + j];
            moved[k] = (float)sum;
        }
    }
}

/* Where the object is, in `odom` or in the camera's frame. */
static void fill_location(fovea_object_t *out, const struct fovea_object *object,
                          const double T_odom_world[12])
{
    static const double unmoved[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    static const int8_t located[] = {
        [FOVEA_OBJECT_LOCATED_NOT] = FOVEA_OBJECT_T_LOCATED_NOT,
        [FOVEA_OBJECT_LOCATED_CAMERA] = FOVEA_OBJECT_T_LOCATED_CAMERA,
        [FOVEA_OBJECT_LOCATED_WORLD] = FOVEA_OBJECT_T_LOCATED_ODOM,
    };
    const double *T = object->located == FOVEA_OBJECT_LOCATED_WORLD ? T_odom_world : unmoved;
    out->located = located[object->located];
    if (object->located == FOVEA_OBJECT_LOCATED_NOT) return;
    move(T, true, object->position_m, out->position_m);
    move_covariance(T, object->covariance_m2, out->covariance_m2);
    move(T, false, object->velocity_m_s, out->velocity_m_s);
    move_covariance(T, object->velocity_covariance_m2_s2, out->velocity_covariance_m2_s2);
}

uint32_t fv_message_objects_encode(const struct fv_message_objects *in, void *scratch,
                                   uint8_t *buffer, size_t capacity)
{
    fovea_object_t *list = scratch;
    char(*cut)[FV_MESSAGE_LABEL_BYTES_MAX] = (void *)(list + in->count);
    for (uint32_t i = 0; i < in->count; i++) {
        const struct fovea_object *object = &in->objects[i];
        const bool whole = strlen(in->names[i]) < FV_MESSAGE_LABEL_BYTES_MAX;
        if (!whole) fv_message_label(in->names[i], cut[i]);
        list[i] = (fovea_object_t){
            .id = (int64_t)object->id,
            .class_id = object->class_id,
            .class_name = whole ? (char *)in->names[i] : cut[i], /* lcm-gen only reads it */
            .state = (int8_t)object->state,
            .score = object->score,
            .box = {object->x_min_px, object->y_min_px, object->x_max_px, object->y_max_px},
            .velocity_px_s = {object->x_px_s, object->y_px_s},
            .age_ns = in->stamp.time_ns - object->first_ns,
            .unseen_ns = in->stamp.time_ns - object->seen_ns,
            .hits = (int32_t)object->hits,
        };
        fill_location(&list[i], object, in->T_odom_world);
    }
    const fovea_objects_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .width = in->width,
        .height = in->height,
        .count = (int32_t)in->count,
        .objects = list,
    };
    return fv_wire_encoded(fovea_objects_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
