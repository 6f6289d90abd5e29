/* The job of the one or two networks that find objects, or whose raw outputs are sent, and the
 * tracks that follow from the detections of the first. */
#include "runtime/config.h"
#include "runtime/jobs.h"

bool fv_job_detect_waiting(const struct fovea *rt)
{
    return fv_detection_waiting(&rt->detection) || fv_detection_waiting(&rt->detection2);
}

/* The tracker takes the detections; what moves on its own is kept out of the map from now on. */
static void track(struct fovea *rt, struct fovea_outputs *outputs)
{
    struct fovea_detections detections;
    struct fovea_box movable[FOVEA_INPUT_BOXES_MAX];
    fv_detection_get(&rt->detection, &detections);
    fv_object_stage_update(&rt->objects, &detections);
    fv_output_add(rt, FV_MESSAGE_OBJECTS,
                  fv_object_stage_encode(&rt->objects, &rt->config, &rt->detection,
                                         fv_reset_counter(rt),
                                         rt->outbox.buffer[FV_MESSAGE_OBJECTS],
                                         rt->outbox.capacity[FV_MESSAGE_OBJECTS]),
                  outputs);
    if (!rt->config.odometry.enabled || !fv_config_movable(&rt->config)) return;
    fv_boxes_take(&rt->boxes, detections.stamp_ns, movable,
                  fv_object_stage_movable(&rt->objects, movable));
}

/* Whether the outputs of this work call hold a message of this kind. */
static bool is_sent(const struct fovea *rt, enum fv_message_kind kind,
                    const struct fovea_outputs *outputs)
{
    for (uint32_t i = 0; i < outputs->message_count; i++)
        if (outputs->messages[i].data == rt->outbox.buffer[kind]) return true;
    return false;
}

/* Returns the units done; `*complete`: a message went to the outputs. */
static uint32_t advance(struct fovea *rt, struct fv_detection *detection, enum fv_message_kind kind,
                        uint32_t units, bool *complete, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    *complete = false;
    if (is_sent(rt, kind, outputs)) return 0; /* a raw network may have more to send */
    *complete = fv_detection_advance(detection, &rt->config, &rt->kernels, units, &done);
    if (*complete)
        fv_output_add(rt, kind,
                      fv_detection_encode(detection, &rt->config, fv_reset_counter(rt),
                                          rt->outbox.buffer[kind], rt->outbox.capacity[kind]),
                      outputs);
    return done;
}

static uint32_t advance_first(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    bool complete;
    const uint32_t done =
        advance(rt, &rt->detection, rt->detection.raw ? FV_MESSAGE_TENSORS : FV_MESSAGE_DETECTIONS,
                units, &complete, outputs);
    if (complete && rt->objects.enabled) track(rt, outputs);
    return done;
}

/* Two networks that have work share the grant: half each, and what one leaves is for the other.
 * Each completes at most one inference per work call: its message's buffer is in use until the
 * next, and it gets its next image from the next step. */
uint32_t fv_job_detect_advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    bool complete;
    if (!fv_detection_waiting(&rt->detection2)) return advance_first(rt, units, outputs);
    uint32_t done =
        fv_detection_waiting(&rt->detection) ? advance_first(rt, units - units / 2, outputs) : 0;
    done += advance(rt, &rt->detection2,
                    rt->detection2.raw ? FV_MESSAGE_TENSORS2 : FV_MESSAGE_DETECTIONS2, units - done,
                    &complete, outputs);
    return done + advance_first(rt, units - done, outputs);
}
