#include "message/message.h"

#include <math.h>
#include <string.h>

#include "message/fields.h"
#include "message/wire.h"

#include "fovea_camera_status_t.h"
#include "fovea_features_t.h"
#include "fovea_preview_t.h"
#include "fovea_statistics_t.h"

void fv_message_prepare(void)
{
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    for (int32_t i = 0; i < count; i++)
        (void)types[i].hash();
}

void fv_message_channel(const char *prefix, enum fv_message_kind kind, char *name)
{
    static const char *const suffixes[FV_MESSAGE_KIND_COUNT] = {
        [FV_MESSAGE_POSE] = "POSE",
        [FV_MESSAGE_CAMERA_POSE] = "CAMERA_POSE",
        [FV_MESSAGE_POSE_FAST] = "POSE_FAST",
        [FV_MESSAGE_FEATURES] = "FEATURES",
        [FV_MESSAGE_STATISTICS] = "STATISTICS",
        [FV_MESSAGE_PREVIEW] = "PREVIEW",
        [FV_MESSAGE_CAMERA_STATUS] = "CAMERA_STATUS",
        [FV_MESSAGE_IMU_STATUS] = "IMU_STATUS",
        [FV_MESSAGE_COMMAND] = "COMMAND",
        [FV_MESSAGE_COMMAND_RESULT] = "COMMAND_RESULT",
        [FV_MESSAGE_VELOCITY_COMMAND] = "VELOCITY_COMMAND",
        [FV_MESSAGE_PARAMETER] = "PARAMETER",
        [FV_MESSAGE_PARAMETER_RESULT] = "PARAMETER_RESULT",
        [FV_MESSAGE_RUN] = "RUN",
        [FV_MESSAGE_RECORDER] = "RECORDER",
        [FV_MESSAGE_SETTINGS] = "SETTINGS",
        [FV_MESSAGE_SETTINGS_RESULT] = "SETTINGS_RESULT",
        [FV_MESSAGE_MAP_LOAD] = "MAP_LOAD",
        [FV_MESSAGE_MAP_FILES] = "MAP_FILES",
        [FV_MESSAGE_LOADED_MAP] = "LOADED_MAP",
        [FV_MESSAGE_HEALTH] = "HEALTH",
        [FV_MESSAGE_FRAME] = "FRAME",
        [FV_MESSAGE_RECORDING] = "RECORDING",
        [FV_MESSAGE_INPUTS] = "INPUTS",
        [FV_MESSAGE_GRANTS] = "GRANTS",
        [FV_MESSAGE_DETECTIONS] = "DETECTIONS",
        [FV_MESSAGE_DETECTIONS2] = "DETECTIONS2",
        [FV_MESSAGE_MAP] = "MAP",
        [FV_MESSAGE_RECORDING_END] = "RECORDING_END",
        [FV_MESSAGE_OBJECTS] = "OBJECTS",
        [FV_MESSAGE_TENSORS] = "TENSORS",
        [FV_MESSAGE_TENSORS2] = "TENSORS2",
        [FV_MESSAGE_KEYPOINTS] = "KEYPOINTS",
        [FV_MESSAGE_KEYPOINTS2] = "KEYPOINTS2",
        [FV_MESSAGE_CLASSES] = "CLASSES",
        [FV_MESSAGE_CLASSES2] = "CLASSES2",
        [FV_MESSAGE_SEGMENTATION] = "SEGMENTATION",
        [FV_MESSAGE_SEGMENTATION2] = "SEGMENTATION2",
        [FV_MESSAGE_EDGES] = "EDGES",
        [FV_MESSAGE_CALIBRATION_WARNING] = "CALIBRATION_WARNING",
        [FV_MESSAGE_GRID] = "GRID",
        [FV_MESSAGE_SCAN] = "SCAN",
        [FV_MESSAGE_GRID_HEIGHTS] = "GRID_HEIGHTS",
        [FV_MESSAGE_LOCKSTEP] = "LOCKSTEP",
        [FV_MESSAGE_BOT_CORE_POSE] = "BOT_CORE_POSE",
    };
    const bool sampled = kind >= FV_MESSAGE_SAMPLE && kind < FV_MESSAGE_FRAME;
    const char *suffix =
        sampled ? fovea_sample_channel((enum fovea_sample_kind)(kind - FV_MESSAGE_SAMPLE))
                : suffixes[kind];
    const char *parts[3] = {prefix, prefix[0] != '\0' ? "_" : "", suffix};
    size_t used = 0;
    for (int part = 0; part < 3; part++)
        for (const char *c = parts[part]; *c != '\0' && used + 1 < FV_MESSAGE_CHANNEL_BYTES; c++)
            name[used++] = *c;
    name[used] = '\0';
}

fovea_stamp_t fv_message_stamp(const struct fovea_frame *frame, int64_t utc_offset_ns)
{
    fovea_stamp_t stamp = {.utc_offset_ns = utc_offset_ns, .sequence = -1};
    if (frame != NULL) {
        stamp.time_ns = frame->stamp_ns;
        stamp.clock = (int8_t)frame->clock;
        stamp.meaning = (int8_t)frame->stamp_meaning;
        stamp.sequence = (int64_t)frame->sequence;
    }
    return stamp;
}

void fv_message_label(const char *label, char cut[FV_MESSAGE_LABEL_BYTES_MAX])
{
    size_t length = strlen(label);
    if (length >= FV_MESSAGE_LABEL_BYTES_MAX) {
        length = FV_MESSAGE_LABEL_BYTES_MAX - 1;
        while (length > 0 && ((uint8_t)label[length] & 0xc0) == 0x80) /* within a letter */
            length--;
    }
    memcpy(cut, label, length);
    cut[length] = '\0';
}

/* ---- features -------------------------------------------------------------------------------- */

/* Of the encoded feature, and of its arrays: position, size, orientation, response, level. */
enum { FEATURE_FLOATS = 5, FEATURE_BYTES = FEATURE_FLOATS * sizeof(float) + 1 };

#define METHOD "fast"

size_t fv_message_features_size_max(uint32_t count_max)
{
    fovea_features_t empty;
    memset(&empty, 0, sizeof empty);
    empty.method = (char *)METHOD;
    const uint32_t pieces = count_max == 0 ? 1 : (count_max - 1) / FOVEA_FEATURES_T_COUNT_MAX + 1;
    return pieces * (size_t)fovea_features_t_encoded_size(&empty) +
           (size_t)count_max * FEATURE_BYTES;
}

size_t fv_message_features_scratch_bytes(uint32_t count_max)
{
    const uint32_t count =
        count_max < FOVEA_FEATURES_T_COUNT_MAX ? count_max : FOVEA_FEATURES_T_COUNT_MAX;
    return (size_t)count * (sizeof(float *) + FEATURE_BYTES);
}

uint32_t fv_message_features_piece(const struct fv_message_features *in)
{
    const uint32_t left = in->count - in->first;
    return left < FOVEA_FEATURES_T_COUNT_MAX ? left : FOVEA_FEATURES_T_COUNT_MAX;
}

uint32_t fv_message_features_encode(const struct fv_message_features *in, void *scratch,
                                    uint8_t *buffer, size_t capacity)
{
    const uint32_t count = fv_message_features_piece(in);
    float **p_px = scratch, *position = (float *)(void *)(p_px + count),
          *size_px = position + 2 * (size_t)count, *orientation = size_px + count,
          *response = orientation + count;
    uint8_t *level = (uint8_t *)(response + count);
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_feature *feature = &in->features[in->first + i];
        p_px[i] = position + 2 * (size_t)i;
        p_px[i][0] = feature->x_px;
        p_px[i][1] = feature->y_px;
        size_px[i] = feature->size_px;
        orientation[i] = NAN;
        response[i] = feature->score;
        level[i] = feature->level;
    }
    const fovea_features_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .width = in->width,
        .height = in->height,
        .asked = (int32_t)in->asked,
        .method = (char *)METHOD, /* lcm-gen knows no const; it only reads */
        .total = (int32_t)in->count,
        .first = (int32_t)in->first,
        .count = (int32_t)count,
        .p_px = p_px,
        .size_px = size_px,
        .orientation = orientation,
        .response = response,
        .level = level,
    };
    return fv_wire_encoded(
        fovea_features_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

/* ---- statistics ------------------------------------------------------------------------------ */

size_t fv_message_statistics_size_max(void)
{
    /* The longest names that fit the documented limit. */
    char name[FV_MESSAGE_NAME_BYTES_MAX];
    fovea_stage_t stages[FOVEA_STAGE_COUNT];
    fovea_job_t jobs[FOVEA_JOB_COUNT];
    memset(name, 'x', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        stages[i] = (fovea_stage_t){.name = name};
    for (int i = 0; i < FOVEA_JOB_COUNT; i++)
        jobs[i] = (fovea_job_t){.name = name};
    fovea_statistics_t message;
    memset(&message, 0, sizeof message);
    message.version = name;
    message.kernel_set = name;
    message.stage_count = FOVEA_STAGE_COUNT;
    message.stages = stages;
    message.job_count = FOVEA_JOB_COUNT;
    message.jobs = jobs;
    return (size_t)fovea_statistics_t_encoded_size(&message);
}

static void fill_counters(fovea_statistics_t *message, const struct fovea_stats *stats,
                          const struct fovea_inputs *inputs)
{
    message->reset_counter = (int32_t)stats->reset_counter;
    message->frames_in = (int64_t)stats->frames_in;
    message->frames_processed = (int64_t)stats->frames_processed;
    message->frames_refused = (int64_t)stats->frames_refused;
    message->refused_stamp = (int64_t)stats->refused_stamp;
    message->refused_format = (int64_t)stats->refused_format;
    message->refused_paused = (int64_t)stats->refused_paused;
    message->steps_without_frame = (int64_t)stats->steps_without_frame;
    message->frames_late = (int64_t)inputs->frames_late;
    message->source_missing = (int64_t)inputs->source_counts.missing;
    message->source_damaged = (int64_t)inputs->source_counts.damaged;
    message->source_dropped = (int64_t)inputs->source_counts.dropped;
    message->source_recovered = (int64_t)inputs->source_counts.recovered;
    message->features = (int32_t)stats->features;
    message->features_granted = (int32_t)inputs->grants.features;
    message->latency_ns = inputs->latency_ns;
    message->resident_bytes = (int64_t)inputs->resident_bytes;
    message->temperature_c = inputs->temperature_c;
}

uint32_t fv_message_statistics_encode(const struct fv_message_statistics *in, uint8_t *buffer,
                                      size_t capacity)
{
    fovea_stage_t stages[FOVEA_STAGE_COUNT];
    fovea_job_t jobs[FOVEA_JOB_COUNT];
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        stages[i] = (fovea_stage_t){
            .name = (char *)in->stage_names[i], /* lcm-gen knows no const; it only reads */
            .cpu_ns = in->stats->stage_cpu_ns[i],
            .wall_ns = in->stats->stage_wall_ns[i],
        };
    for (int i = 0; i < FOVEA_JOB_COUNT; i++)
        jobs[i] = (fovea_job_t){
            .name = (char *)in->job_names[i],
            .units_granted = (int32_t)in->work_grants->units[i],
            .units_done = (int32_t)in->units_done[i],
            .waiting = (int8_t)((in->jobs_waiting >> i) & 1),
        };
    fovea_statistics_t message = {
        .stamp = in->stamp,
        .version = (char *)FOVEA_VERSION,
        .kernel_set = (char *)in->kernel_set,
        .stage_count = FOVEA_STAGE_COUNT,
        .stages = stages,
        .job_count = FOVEA_JOB_COUNT,
        .jobs = jobs,
        .memory_persistent_bytes = (int64_t)in->memory_bytes[FOVEA_MEMORY_PERSISTENT],
        .memory_job_bytes = (int64_t)in->memory_bytes[FOVEA_MEMORY_JOB],
        .memory_frame_bytes = (int64_t)in->memory_bytes[FOVEA_MEMORY_FRAME],
    };
    fill_counters(&message, in->stats, in->inputs);
    return fv_wire_encoded(
        fovea_statistics_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

/* ---- camera status and preview --------------------------------------------------------------- */

size_t fv_message_camera_status_size_max(void)
{
    fovea_camera_status_t empty;
    memset(&empty, 0, sizeof empty);
    empty.pixel_format = (char *)"";
    return (size_t)fovea_camera_status_t_encoded_size(&empty) + FV_MESSAGE_NAME_BYTES_MAX;
}

uint32_t fv_message_camera_status_encode(const struct fv_message_camera_status *in, uint8_t *buffer,
                                         size_t capacity)
{
    fovea_camera_status_t message = {
        .stamp = in->stamp,
        .now_ns = in->now_ns,
        .state = (int8_t)in->state,
        .width = in->width,
        .height = in->height,
        .pixel_format = (char *)in->pixel_format,
        .exposure_ns = in->exposure_ns,
        .delivered = (int64_t)in->counts.delivered,
        .missing = (int64_t)in->counts.missing,
        .damaged = (int64_t)in->counts.damaged,
        .dropped = (int64_t)in->counts.dropped,
        .recovered = (int64_t)in->counts.recovered,
    };
    return fv_wire_encoded(
        fovea_camera_status_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_preview_size_max(size_t jpeg_bytes_max)
{
    fovea_preview_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_preview_t_encoded_size(&empty) + jpeg_bytes_max;
}

uint32_t fv_message_preview_encode(const struct fv_message_preview *in, uint8_t *buffer,
                                   size_t capacity)
{
    fovea_preview_t message = {
        .stamp = in->stamp,
        .camera = (int8_t)in->camera,
        .width = in->width,
        .height = in->height,
        .scale = in->scale,
        .size_bytes = (int32_t)in->jpeg_bytes,
        .jpeg = (uint8_t *)in->jpeg, /* lcm-gen knows no const; it only reads */
    };
    return fv_wire_encoded(fovea_preview_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
