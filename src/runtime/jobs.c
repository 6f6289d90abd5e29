#include "runtime/jobs.h"

#include "runtime/config.h"

void fv_output_add(struct fovea *rt, enum fv_message_kind kind, uint32_t bytes,
                   struct fovea_outputs *outputs)
{
    if (bytes == 0 || outputs->message_count >= FOVEA_MESSAGES_MAX) return;
    outputs->messages[outputs->message_count++] = (struct fovea_message){
        .channel = rt->outbox.channel[kind],
        .data = rt->outbox.buffer[kind],
        .bytes = bytes,
        .volatile_values = kind == FV_MESSAGE_STATISTICS,
    };
}

static bool map_waiting(const struct fovea *rt)
{
    return fv_odometry_job_waiting(&rt->odometry) || fv_scale_waiting(&rt->scale, &rt->odometry);
}

uint32_t fv_jobs_waiting(const struct fovea *rt)
{
    uint32_t waiting = fv_preview_waiting(&rt->preview) ? 1u << FOVEA_JOB_PREVIEW : 0;
    if (rt->config.odometry.enabled && map_waiting(rt)) waiting |= 1u << FOVEA_JOB_MAP;
    if (rt->config.odometry.enabled && fv_odometry_loop_waiting(&rt->odometry))
        waiting |= 1u << FOVEA_JOB_LOOP;
    if (fv_detection_waiting(&rt->detection)) waiting |= 1u << FOVEA_JOB_DETECT;
    return waiting;
}

static void send_preview(struct fovea *rt, struct fovea_outputs *outputs)
{
    const struct fv_preview *preview = &rt->preview;
    const struct fv_message_preview message = {
        .stamp = fv_frame_id_stamp(&preview->state->frame),
        .width = preview->width,
        .height = preview->height,
        .scale = (double)fv_pyramid_scale(rt->config.preview.level),
        .jpeg = preview->jpeg,
        .jpeg_bytes = (uint32_t)preview->state->jpeg.used,
    };
    fv_output_add(rt, FV_MESSAGE_PREVIEW,
                  fv_message_preview_encode(&message, rt->outbox.buffer[FV_MESSAGE_PREVIEW],
                                            rt->outbox.capacity[FV_MESSAGE_PREVIEW]),
                  outputs);
}

static uint32_t advance_preview(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    const struct fv_level *level = &rt->pyramid.level[rt->config.preview.level];
    uint32_t done = 0;
    while (done < units && fv_preview_waiting(&rt->preview)) {
        done++;
        if (fv_preview_unit(&rt->preview, level->pixels, level->stride_bytes,
                            rt->config.preview.quality)) {
            send_preview(rt, outputs);
            break; /* one message per work call: its buffer is in use until the next */
        }
    }
    return done;
}

static uint32_t advance_map(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    if (!rt->config.odometry.enabled) return 0;
    for (; done < units && map_waiting(rt); done++) {
        if (fv_scale_waiting(&rt->scale, &rt->odometry))
            fv_scale_unit(&rt->scale, &rt->odometry);
        else
            fv_odometry_unit(&rt->odometry, &rt->kernels);
    }
    outputs->map_bytes = fv_archive_take(rt->odometry.archive);
    return done;
}

/* What a look found goes to the tracker; what moves on its own is kept out of the map from now on.
 */
static void track(struct fovea *rt, struct fovea_outputs *outputs)
{
    struct fovea_detections detections;
    struct fovea_box movable[FOVEA_INPUT_BOXES_MAX];
    fv_detection_get(&rt->detection, &detections);
    fv_tracking_update(&rt->tracking, &detections);
    fv_output_add(rt, FV_MESSAGE_TRACKS,
                  fv_tracking_encode(&rt->tracking, &rt->config, &rt->detection,
                                     fv_reset_counter(rt), rt->outbox.buffer[FV_MESSAGE_TRACKS],
                                     rt->outbox.capacity[FV_MESSAGE_TRACKS]),
                  outputs);
    if (!rt->config.odometry.enabled || !fv_config_movable(&rt->config)) return;
    fv_boxes_take(&rt->boxes, detections.stamp_ns, movable,
                  fv_tracking_movable(&rt->tracking, movable));
}

/* One message per work call: its buffer is in use until the next. */
static uint32_t advance_detection(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    if (!fv_detection_advance(&rt->detection, &rt->config, &rt->kernels, units, &done)) return done;
    fv_output_add(rt, FV_MESSAGE_DETECTIONS,
                  fv_detection_encode(&rt->detection, &rt->config, fv_reset_counter(rt),
                                      rt->outbox.buffer[FV_MESSAGE_DETECTIONS],
                                      rt->outbox.capacity[FV_MESSAGE_DETECTIONS]),
                  outputs);
    if (rt->tracking.enabled) track(rt, outputs);
    return done;
}

static uint32_t advance_loop(struct fovea *rt, uint32_t units)
{
    uint32_t done = 0;
    if (!rt->config.odometry.enabled) return 0;
    for (; done < units && fv_odometry_loop_waiting(&rt->odometry); done++)
        fv_odometry_loop_unit(&rt->odometry, &rt->kernels);
    return done;
}

uint32_t fv_job_advance(struct fovea *rt, enum fovea_job job, uint32_t units,
                        struct fovea_outputs *outputs)
{
    switch (job) {
    case FOVEA_JOB_MAP:
        return advance_map(rt, units, outputs);
    case FOVEA_JOB_DETECT:
        return advance_detection(rt, units, outputs);
    case FOVEA_JOB_LOOP:
        return advance_loop(rt, units);
    case FOVEA_JOB_PREVIEW:
        return advance_preview(rt, units, outputs);
    case FOVEA_JOB_COUNT:
        break;
    }
    return 0;
}
