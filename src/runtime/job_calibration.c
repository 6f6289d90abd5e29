/* The job that watches the calibration: frames are measured in the step, windows in units, and its
 * message leaves when a verdict changes and now and then (runtime/calibration.h). */
#include "runtime/jobs.h"

static bool is_on(const struct fovea *rt)
{
    return rt->config.calibration.check && rt->config.odometry.enabled;
}

static bool waiting(const struct fovea *rt)
{
    return is_on(rt) && fv_calibration_waiting(&rt->calibration, &rt->odometry);
}

static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    const enum fv_message_kind kind = FV_MESSAGE_CALIBRATION_WARNING;
    uint32_t done = 0;
    while (done < units && waiting(rt)) {
        done++;
        if (!rt->calibration.state->due) {
            fv_calibration_unit(&rt->calibration, &rt->odometry);
            continue;
        }
        fv_output_add(rt, kind,
                      fv_calibration_encode(&rt->calibration, rt->outbox.buffer[kind],
                                            rt->outbox.capacity[kind]),
                      outputs);
        break; /* one message per work call: its buffer is in use until the next */
    }
    return done;
}

static void carve(struct fovea *rt, struct fv_carving *carving)
{
    if (is_on(rt))
        fv_calibration_carve(&rt->calibration, &carving->arenas[FOVEA_MEMORY_PERSISTENT],
                             &carving->arenas[FOVEA_MEMORY_JOB]);
}

static void measure(struct fovea *rt, const struct fovea_frame *frame)
{
    (void)frame;
    if (is_on(rt)) fv_calibration_frame(&rt->calibration, &rt->odometry, &rt->state->frame);
}

static void reset(struct fovea *rt)
{
    if (is_on(rt)) fv_calibration_reset(&rt->calibration);
}

/* Of a window of eight keyframes: up to 50 units. */
const struct fv_job fv_job_calibration = {.key = "calibration.check",
                                          .units_min = 2,
                                          .units_fixed = 10,
                                          .waiting = waiting,
                                          .advance = advance,
                                          .carve = carve,
                                          .frame = measure,
                                          .reset = reset};
