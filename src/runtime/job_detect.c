/* The detector's job, and the tracks that follow from what it finds. */
#include "runtime/config.h"
#include "runtime/jobs.h"

bool fv_job_detect_waiting(const struct fovea *rt)
{
    return fv_detection_waiting(&rt->detection);
}

/* What a look found goes to the tracker; what moves on its own is kept out of the map from now on.
 */
static void track(struct fovea *rt, struct fovea_outputs *outputs)
{
    struct fovea_detections detections;
    struct fovea_box movable[FOVEA_INPUT_BOXES_MAX];
    fv_detection_get(&rt->detection, &detections);
    fv_tracking_update(&rt->tracking, &detections);
    fv_output_add(rt, FV_MESSAGE_OBJECTS,
                  fv_tracking_encode(&rt->tracking, &rt->config, &rt->detection,
                                     fv_reset_counter(rt), rt->outbox.buffer[FV_MESSAGE_OBJECTS],
                                     rt->outbox.capacity[FV_MESSAGE_OBJECTS]),
                  outputs);
    if (!rt->config.odometry.enabled || !fv_config_movable(&rt->config)) return;
    fv_boxes_take(&rt->boxes, detections.stamp_ns, movable,
                  fv_tracking_movable(&rt->tracking, movable));
}

/* One message per work call: its buffer is in use until the next. */
uint32_t fv_job_detect_advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
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
