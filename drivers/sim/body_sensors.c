#include "sim.h"

#include <stdio.h>
#include <stdlib.h>

/* The sensors on the body beside the cameras, each at a rate of its own: whose sample is next. */

static const struct fv_sim_body_sensor *const sensors[FV_SIM_BODY_SENSOR_COUNT] = {
#define FV_SIM_BODY_SENSOR_POINTER(name) &fv_sim_##name,
    FV_SIM_BODY_SENSORS(FV_SIM_BODY_SENSOR_POINTER)
#undef FV_SIM_BODY_SENSOR_POINTER
};

static double rate_hz(const struct fv_sim_options *options, const struct fv_sim_body_sensor *sensor)
{
    return *(const double *)((const char *)options + sensor->hz);
}

/* ---- opening --------------------------------------------------------------------------------- */

static enum fovea_status too_many(double samples_hz, double frames_hz, struct fovea_error *error)
{
    char names[128];
    size_t used = 0;
    for (int i = 0; i < FV_SIM_BODY_SENSOR_COUNT && used < sizeof names; i++)
        used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i > 0 ? ", " : "",
                                 sensors[i]->name);
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "sim: %s: found %g samples per second beside %g frames, expected at most %d with each frame",
        names, samples_hz, frames_hz, FOVEA_INPUT_SAMPLES_MAX);
}

/* What cannot be taken with the frames would lag behind them without end. A sensor that was not
 * asked for (wheel odometry) refuses no run. */
static enum fovea_status check(const struct fovea_source *source, struct fovea_error *error)
{
    const struct fv_sim_options *o = &source->options;
    const double frames_hz = o->rate_hz / (double)source->selection.step;
    double samples_hz = 0;
    bool asked = false;
    for (int i = 0; i < FV_SIM_BODY_SENSOR_COUNT; i++) {
        const double hz = rate_hz(o, sensors[i]);
        if (source->selection.reverse && hz > 0 && fv_sim_option_given(o, sensors[i]->hz))
            return fovea_error_set(
                error, FOVEA_ERROR_UNSUPPORTED,
                "sim: %s: found %g Hz in reverse, expected 0: a sensor's samples do not turn round",
                sensors[i]->name, hz);
        samples_hz += hz;
        asked = asked || (hz > 0 && fv_sim_option_given(o, sensors[i]->hz));
    }
    if (!asked || source->deliverable == 1 || source->selection.reverse ||
        samples_hz <= FOVEA_INPUT_SAMPLES_MAX * frames_hz)
        return FOVEA_OK;
    return too_many(samples_hz, frames_hz, error);
}

enum fovea_status fv_sim_body_sensors_open(struct fovea_source *source, struct fovea_error *error)
{
    const enum fovea_status status = check(source, error);
    if (status != FOVEA_OK) return status;
    for (int i = 0; i < FV_SIM_BODY_SENSOR_COUNT; i++) {
        source->sensor_state[i] = calloc(1, sensors[i]->state_bytes);
        if (source->sensor_state[i] == NULL)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sim: out of memory");
        const bool there = rate_hz(&source->options, sensors[i]) > 0;
        if (there && !source->selection.reverse)
            source->info.sample_kinds |= 1u << sensors[i]->kind;
        if (there && sensors[i]->describe != NULL)
            sensors[i]->describe(&source->options, &source->info.rig);
    }
    return FOVEA_OK;
}

void fv_sim_body_sensors_close(struct fovea_source *source)
{
    for (int i = 0; i < FV_SIM_BODY_SENSOR_COUNT; i++)
        free(source->sensor_state[i]);
}

/* ---- samples --------------------------------------------------------------------------------- */

/* INT64_MAX: never. */
static int64_t stamp_of(double begin_s, uint64_t count, double hz)
{
    static const double most_ns = 9.2e18; /* that a stamp holds */
    const double stamp_ns = hz > 0 ? (begin_s + (double)count / hz) * 1e9 + 0.5 : most_ns;
    return stamp_ns < most_ns ? (int64_t)stamp_ns : INT64_MAX;
}

uint32_t fv_sim_samples(struct fovea_source *source, const struct fovea_frame *frame,
                        struct fovea_sample *samples, uint32_t count_max)
{
    const struct fv_sim_options *options = &source->options;
    const double begin_s = (double)source->selection.start / options->rate_hz;
    uint32_t count = 0;
    if (source->selection.reverse) return 0;
    count = fv_sim_commands_give(&source->commands, samples, count_max);
    for (; count < count_max; count++) {
        struct fovea_sample *sample = &samples[count];
        int64_t next_ns = INT64_MAX;
        int next = 0;
        for (int i = 0; i < FV_SIM_BODY_SENSOR_COUNT; i++) {
            const int64_t stamp_ns =
                stamp_of(begin_s, source->sample_count[i], rate_hz(options, sensors[i]));
            if (stamp_ns >= next_ns) continue;
            next_ns = stamp_ns;
            next = i;
        }
        if (next_ns > frame->stamp_ns) break;
        sample->kind = sensors[next]->kind;
        sample->any.stamp_ns = next_ns;
        sensors[next]->sample(source, source->sensor_state[next], source->sample_count[next]++,
                              begin_s, sample);
    }
    return count;
}
