#include "app/run/run_sense.h"

#include "app/run/run.h"

void fv_run_sample_add(struct fovea_sample *samples, uint32_t *count,
                       const struct fovea_sample *sample)
{
    const int64_t stamp_ns = fovea_sample_stamp(sample);
    uint32_t at = (*count)++;
    for (; at > 0 && fovea_sample_stamp(&samples[at - 1]) > stamp_ns; at--)
        samples[at] = samples[at - 1];
    samples[at] = *sample;
}

/* Put wheel odometry that the network brought among the samples, in the order of stamps: on the
 * frames' clock, while the messages' is UTC. */
static void add_heard(struct fv_run *run, struct fovea_inputs *inputs)
{
    enum { HEARD_MAX = 64 };
    struct fovea_wheel_odometry_sample heard[HEARD_MAX];
    const uint32_t room = FOVEA_INPUT_SAMPLES_MAX - inputs->sample_count,
                   count = fv_transport_wheel_odometry(run->transport, heard,
                                                       room < HEARD_MAX ? room : HEARD_MAX);
    for (uint32_t i = 0; i < count; i++) {
        heard[i].stamp_ns -= inputs->utc_offset_ns;
        fv_run_sample_add(run->samples, &inputs->sample_count,
                          &(struct fovea_sample){.kind = FOVEA_SAMPLE_WHEEL_ODOMETRY,
                                                 .wheel_odometry = heard[i]});
    }
}

/* A source that has wheel odometry alone is asked for it only where it gives the scale. */
static void take_samples(struct fv_run *run, const struct fovea_frame *given,
                         struct fovea_inputs *inputs)
{
    const uint32_t wheel_odometry = 1u << FOVEA_SAMPLE_WHEEL_ODOMETRY;
    const struct fovea_source_ops *ops = run->setup.ops;
    const uint32_t kinds = ops->info(run->setup.source)->sample_kinds;
    const bool wheels = run->settings.runtime.scale.source == FOVEA_SCALE_WHEEL_ODOMETRY;
    inputs->samples = run->samples;
    if (ops->samples != NULL && given != NULL && (kinds & (wheels ? kinds : ~wheel_odometry)) != 0)
        inputs->sample_count =
            ops->samples(run->setup.source, given, run->samples, FOVEA_INPUT_SAMPLES_MAX);
    if (wheels && (kinds & wheel_odometry) == 0) add_heard(run, inputs);
    fv_imu_input_take(&run->imu, given, run->samples, inputs);
}

static void boxes_from_truth(struct fv_run *run, struct fovea_inputs *inputs)
{
    struct fovea_truth truth;
    const struct fovea_source_ops *ops = run->setup.ops;
    if (ops->truth == NULL || ops->truth(run->setup.source, inputs->frame, &truth) != FOVEA_OK)
        return;
    inputs->has_boxes = true;
    inputs->boxes_stamp_ns = inputs->frame->stamp_ns;
    for (uint32_t i = 0; i < truth.box_count && inputs->box_count < FOVEA_INPUT_BOXES_MAX; i++) {
        const struct fovea_truth_box *b = &truth.boxes[i];
        inputs->boxes[inputs->box_count++] =
            (struct fovea_box){b->x_min_px, b->y_min_px, b->x_max_px, b->y_max_px};
    }
}

void fv_run_sense(void *context, const struct fovea_frame *given, struct fovea_inputs *inputs)
{
    struct fv_run *run = context;
    const bool saves = atomic_load(&run->keeper.stage) != FV_KEEPER_IDLE;
    fv_recordings_sense(&run->recordings, inputs, saves);
    fv_map_loads_take(&run->map_loads, inputs, saves);
    fv_parameters_take(&run->parameters, inputs);
    take_samples(run, given, inputs);
    if (run->settings.movable_boxes == FV_MOVABLE_TRUTH && inputs->frame != NULL)
        boxes_from_truth(run, inputs);
}
