#include "runtime/objects.h"

#include <string.h>

void fv_object_stage_carve(struct fv_object_stage *stage, const struct fovea_config *config,
                           const struct fv_detection *detection, struct fv_arena *persistent,
                           struct fv_arena *frame)
{
    stage->enabled = fv_detection_sends(detection, FV_DETECTION_BOXES) &&
                     config->objects.mode != FOVEA_OBJECTS_OFF;
    if (!stage->enabled) return;
    fv_objects_carve(&stage->pool, &config->objects, &config->rig.cameras[0].camera,
                     config->rig.cameras[0].T_body_cam, persistent, frame);
    stage->state = fv_arena_take(persistent, 1, sizeof *stage->state);
    stage->message_scratch =
        fv_arena_take(frame,
                      fv_message_objects_scratch_bytes(config->objects.count_max,
                                                       fv_detection_label_bytes(detection)),
                      1);
}

void fv_object_stage_reset(struct fv_object_stage *stage)
{
    if (stage->enabled) fv_objects_reset(&stage->pool);
}

void fv_object_stage_note(struct fv_object_stage *stage, const struct fovea_pose *pose)
{
    struct fv_object_stage_state *state = stage->state;
    if (!stage->enabled) return;
    memcpy(state->T_world_cam, pose->T_world_cam, sizeof state->T_world_cam);
    state->world = (uint64_t)pose->reset_counter << 32 | pose->map_id;
    state->posed = pose->posed;
    state->metric = pose->scale_source != FOVEA_SCALE_FREE;
}

void fv_object_stage_update(struct fv_object_stage *stage,
                            const struct fovea_detections *detections)
{
    const struct fv_object_stage_state *state = stage->state;
    if (!stage->enabled) return;
    struct fv_objects_inference inference = {
        .stamp_ns = detections->stamp_ns,
        .sequence = detections->sequence,
        .detections = detections->list,
        .count = detections->count,
        .uncertain = detections->uncertain,
        .posed = state->posed != 0,
        .metric = state->metric != 0,
        .world = state->world,
    };
    memcpy(inference.T_world_cam, state->T_world_cam, sizeof inference.T_world_cam);
    fv_objects_update(&stage->pool, &inference);
}

uint32_t fv_object_stage_encode(const struct fv_object_stage *stage,
                                const struct fovea_config *config,
                                const struct fv_detection *detection, uint32_t reset_counter,
                                uint8_t *buffer, size_t capacity)
{
    const char *names[FOVEA_OBJECTS_MAX];
    struct fovea_objects objects;
    fv_objects_get(&stage->pool, &objects);
    for (uint32_t i = 0; i < objects.count; i++)
        names[i] = fv_detection_label(detection, objects.list[i].class_id);
    struct fv_message_objects message = {
        .stamp = fv_frame_id_stamp(&detection->state->found_frame),
        .reset_counter = reset_counter,
        .width = config->rig.cameras[0].camera.width,
        .height = config->rig.cameras[0].camera.height,
        .count = objects.count,
        .objects = objects.list,
        .names = names,
    };
    /* What is located in the world is so in metres, where T_body_cam holds with its lever arm. */
    memcpy(message.T_odom_world, config->rig.cameras[0].T_body_cam, sizeof message.T_odom_world);
    return fv_message_objects_encode(&message, stage->message_scratch, buffer, capacity);
}

uint32_t fv_object_stage_movable(const struct fv_object_stage *stage,
                                 struct fovea_box boxes[FOVEA_INPUT_BOXES_MAX])
{
    float found[FOVEA_INPUT_BOXES_MAX][4];
    if (!stage->enabled) return 0;
    const uint32_t count = fv_objects_movable(&stage->pool, found, FOVEA_INPUT_BOXES_MAX);
    for (uint32_t i = 0; i < count; i++)
        boxes[i] = (struct fovea_box){found[i][0], found[i][1], found[i][2], found[i][3]};
    return count;
}
