/* The last stage of a step: results become LCM messages. */
#include <string.h>

#include "runtime/encode_map.h"
#include "runtime/encode_pose.h"
#include "runtime/jobs.h"
#include "runtime/state.h"

static fovea_stamp_t last_stamp(const struct fovea *rt)
{
    return rt->state->any_frame ? fv_frame_id_stamp(&rt->state->frame) : fv_message_stamp(NULL, 0);
}

static void encode_features(struct fovea *rt, uint32_t asked, struct fovea_outputs *outputs)
{
    struct fv_message_features message = {
        .stamp = last_stamp(rt),
        .reset_counter = fv_reset_counter(rt),
        .width = rt->config.rig.cameras[0].camera.width,
        .height = rt->config.rig.cameras[0].camera.height,
        .asked = asked,
    };
    message.features = fovea_features_get(rt, &message.count);
    struct fv_outbox *outbox = &rt->outbox;
    const size_t capacity = outbox->capacity[FV_MESSAGE_FEATURES];
    size_t at = 0;
    do {
        const uint32_t bytes =
            fv_message_features_encode(&message, outbox->features_scratch,
                                       outbox->buffer[FV_MESSAGE_FEATURES] + at, capacity - at);
        fv_output_add_piece(rt, FV_MESSAGE_FEATURES, at, bytes, outputs);
        message.first += fv_message_features_piece(&message);
        at += bytes;
    } while (message.first < message.count);
}

static void encode_camera_status(struct fovea *rt, const struct fovea_inputs *inputs,
                                 struct fovea_outputs *outputs)
{
    const struct fv_message_camera_status message = {
        .stamp = last_stamp(rt),
        .now_ns = inputs->now_ns,
        .state = inputs->source_state,
        .width = rt->config.rig.cameras[0].camera.width,
        .height = rt->config.rig.cameras[0].camera.height,
        .pixel_format =
            fovea_pixel_format_name((enum fovea_pixel_format)rt->state->frame.pixel_format),
        .exposure_ns = rt->state->frame.exposure_ns,
        .counts = inputs->source_counts,
    };
    fv_output_add(rt, FV_MESSAGE_CAMERA_STATUS,
                  fv_message_camera_status_encode(&message,
                                                  rt->outbox.buffer[FV_MESSAGE_CAMERA_STATUS],
                                                  rt->outbox.capacity[FV_MESSAGE_CAMERA_STATUS]),
                  outputs);
}

static void encode_statistics(struct fovea *rt, struct fovea_outputs *outputs)
{
    const char *stages[FOVEA_STAGE_COUNT], *jobs[FOVEA_JOB_COUNT];
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        stages[i] = fovea_stage_name((enum fovea_stage)i);
    for (int i = 0; i < FOVEA_JOB_COUNT; i++)
        jobs[i] = fovea_job_name((enum fovea_job)i);
    struct fovea_stats stats;
    fovea_stats_get(rt, &stats);
    const struct fv_message_statistics message = {
        .stamp = last_stamp(rt),
        .kernel_set = fovea_cpu_name(rt),
        .stats = &stats,
        .inputs = &rt->inputs,
        .work_grants = &rt->work_grants,
        .units_done = rt->units_done,
        .jobs_waiting = fv_jobs_waiting(rt),
        .memory_bytes = rt->part_bytes,
        .stage_names = stages,
        .job_names = jobs,
    };
    fv_output_add(rt, FV_MESSAGE_STATISTICS,
                  fv_message_statistics_encode(&message, rt->outbox.buffer[FV_MESSAGE_STATISTICS],
                                               rt->outbox.capacity[FV_MESSAGE_STATISTICS]),
                  outputs);
}

/* Now and then, and at once when the state becomes another. */
static void encode_imu_status(struct fovea *rt, int64_t now_ns, struct fovea_outputs *outputs)
{
    struct fovea_imu_status status;
    if (!rt->config.rig.has_imu) return;
    fovea_imu_status_get(rt, &status);
    const bool changed = (uint32_t)status.state != rt->imu.state->told;
    if (!changed && !fv_every(rt->state->steps, rt->config.statistics_every)) return;
    rt->imu.state->told = (uint32_t)status.state;
    fv_output_add(rt, FV_MESSAGE_IMU_STATUS,
                  fv_message_imu_status_encode(&status, last_stamp(rt), now_ns,
                                               rt->outbox.buffer[FV_MESSAGE_IMU_STATUS],
                                               rt->outbox.capacity[FV_MESSAGE_IMU_STATUS]),
                  outputs);
}

void fv_encode(struct fovea *rt, const struct fovea_inputs *inputs, bool processed,
               bool interrupted, struct fovea_outputs *outputs)
{
    const struct fovea_config *config = &rt->config;
    const uint64_t steps = rt->state->steps;
    const bool paused = rt->state->paused && inputs->frame != NULL && config->odometry.enabled;
    const bool pose_due =
        interrupted ? config->pose_every > 0
                    : processed && fv_every(rt->state->frames_processed - 1, config->pose_every);
    if (config->odometry.enabled && pose_due) fv_encode_poses(rt, inputs, outputs);
    if (paused && fv_every(rt->state->refused_paused - 1, config->pose_every))
        fv_encode_paused(rt, inputs, outputs);
    if (processed && fv_every(rt->state->frames_processed - 1, config->features_every)) {
        encode_features(rt, inputs->grants.features, outputs);
    }
    if (processed && config->odometry.enabled &&
        fv_every(rt->state->frames_processed - 1, config->map_every)) {
        fv_encode_map(rt, outputs);
    }
    if (fv_every(steps, config->camera_status_every)) encode_camera_status(rt, inputs, outputs);
    if (fv_every(steps, config->statistics_every)) encode_statistics(rt, outputs);
    encode_imu_status(rt, inputs->now_ns, outputs);
}
