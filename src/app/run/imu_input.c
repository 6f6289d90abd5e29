#include "app/run/imu_input.h"

#include <inttypes.h>
#include <string.h>

#include "app/network/heard_imu.h"
#include "app/run/run_sense.h"
#include "drivers/clock.h"

static const int64_t far_ns =
    FV_SECOND_NS / 4; /* ahead: not waited for, the step says what it is */
static const int64_t early_ns = FV_SECOND_NS / 5;

void fv_imu_input_open(struct fv_imu_input *input, const struct fv_settings *settings,
                       struct fv_iio *iio)
{
    input->iio = iio;
    input->channel = fv_imu_lcm_channel(settings);
    input->time_offset_ns = settings->runtime.rig.imu.time_offset_ns;
    fv_ring_init(&input->ring, input->memory, sizeof input->memory);
}

/* ---- the sensor's thread, or the receiver's -------------------------------------------------- */

/* What to add to CLOCK_MONOTONIC for the frames' clock. */
static int64_t from_monotonic(enum fovea_clock clock)
{
    return fv_clock_ahead_ns(fv_clock_of(clock));
}

/* With its stamp on the frames' clock. */
static void tap(struct fv_imu_input *input, const struct fovea_imu_sample *sample)
{
    int64_t age_ns;
    const int64_t now_ns = fv_clock_ns(fv_clock_of((enum fovea_clock)atomic_load(&input->clock)));
    if (__builtin_add_overflow(sample->stamp_ns, input->time_offset_ns, &age_ns) ||
        __builtin_sub_overflow(now_ns, age_ns, &age_ns) || age_ns > far_ns || age_ns < -far_ns)
        return;
    input->tap(input->tap_context, sample);
}

static void tap_heard(struct fv_imu_input *input, const struct fv_heard_imu *heard)
{
    struct fovea_imu_sample sample = heard->sample;
    if (input->tap == NULL || !atomic_load(&input->any_frame)) return;
    if (fv_heard_imu_stamp(heard, atomic_load(&input->clock), atomic_load(&input->utc_offset_ns),
                           &sample.stamp_ns))
        tap(input, &sample);
}

static void tap_read(void *context, const struct fovea_imu_sample *sample)
{
    struct fv_imu_input *input = context;
    struct fovea_imu_sample on_clock = *sample;
    if (input->tap == NULL || !atomic_load(&input->any_frame)) return;
    const int64_t offset_ns = from_monotonic((enum fovea_clock)atomic_load(&input->clock));
    if (!__builtin_add_overflow(sample->stamp_ns, offset_ns, &on_clock.stamp_ns))
        tap(input, &on_clock);
}

void fv_imu_input_tap(struct fv_imu_input *input,
                      void (*see)(void *context, const struct fovea_imu_sample *sample),
                      void *context)
{
    input->tap = see;
    input->tap_context = context;
    if (input->iio != NULL) fv_iio_tap(input->iio, tap_read, input);
}

static void take_message(void *context, const struct fv_received *received)
{
    struct fv_imu_input *input = context;
    struct fv_heard_imu heard;
    if (!fv_heard_imu_decode(received, &heard)) return;
    tap_heard(input, &heard);
    uint8_t *room = fv_ring_reserve(&input->ring, sizeof heard);
    atomic_fetch_add_explicit(room != NULL ? &input->heard : &input->no_room, 1,
                              memory_order_relaxed);
    if (room == NULL) return;
    memcpy(room, &heard, sizeof heard);
    fv_ring_commit(&input->ring, sizeof heard);
}

bool fv_imu_input_hears(const struct fv_imu_input *input)
{
    return input->channel != NULL;
}

struct fv_receiver_channel fv_imu_input_row(struct fv_imu_input *input)
{
    enum { BYTES = 128 };
    return fv_receiver_channel_of(input->channel, "fovea.imu_t", BYTES, take_message, input);
}

/* ---- the loop -------------------------------------------------------------------------------- */

static void release(struct fv_imu_input *input)
{
    input->taken++;
    if (input->iio != NULL)
        fv_iio_release(input->iio);
    else
        fv_ring_release(&input->ring, sizeof(struct fv_heard_imu));
}

/* The next sample on the frames' clock, which stays. False: there is none. */
static bool peek(struct fv_imu_input *input, const struct fovea_inputs *inputs,
                 int64_t monotonic_ns, struct fovea_imu_sample *sample)
{
    if (input->iio != NULL) {
        const struct fovea_imu_sample *next = fv_iio_peek(input->iio);
        if (next == NULL) return false;
        *sample = *next;
        if (__builtin_add_overflow(sample->stamp_ns, monotonic_ns, &sample->stamp_ns))
            sample->stamp_ns = INT64_MAX;
        return true;
    }
    size_t bytes;
    const uint8_t *data;
    while ((data = fv_ring_peek(&input->ring, &bytes)) != NULL) {
        struct fv_heard_imu heard;
        memcpy(&heard, data, sizeof heard);
        *sample = heard.sample;
        if (fv_heard_imu_stamp(&heard, atomic_load(&input->clock), inputs->utc_offset_ns,
                               &sample->stamp_ns))
            return true;
        atomic_fetch_add_explicit(&input->no_clock, 1, memory_order_relaxed);
        release(input);
    }
    return false;
}

/* Whether a stamp is still to come at `now_ns`, and worth to be waited for. */
static bool waits(const struct fv_imu_input *input, int64_t stamp_ns, int64_t now_ns)
{
    int64_t ahead_ns;
    if (__builtin_add_overflow(stamp_ns, input->time_offset_ns, &ahead_ns) ||
        __builtin_sub_overflow(ahead_ns, now_ns, &ahead_ns))
        return false;
    return ahead_ns > 0 && ahead_ns < far_ns;
}

struct counts {
    uint64_t came, lost;
};

static struct counts counts_of(const struct fv_imu_input *input)
{
    struct fv_iio_counts iio;
    if (input->iio == NULL)
        return (struct counts){atomic_load_explicit(&input->heard, memory_order_relaxed),
                               atomic_load_explicit(&input->no_room, memory_order_relaxed)};
    fv_iio_counts(input->iio, &iio);
    return (struct counts){iio.samples, iio.dropped};
}

/* While there is no frame the oldest make room, so that those just before the first one are not
 * lost. */
static void keep_few(struct fv_imu_input *input)
{
    const uint64_t came = counts_of(input).came;
    size_t bytes;
    while (came > input->taken + FV_IMU_INPUT_KEPT &&
           (input->iio != NULL || fv_ring_peek(&input->ring, &bytes) != NULL))
        release(input);
}

/* What came long before the first frame is of no use to it. */
static void leave_early(struct fv_imu_input *input, const struct fovea_inputs *inputs,
                        int64_t monotonic_ns, int64_t now_ns)
{
    struct fovea_imu_sample sample;
    int64_t age_ns;
    while (peek(input, inputs, monotonic_ns, &sample) &&
           !__builtin_sub_overflow(now_ns, sample.stamp_ns, &age_ns) && age_ns > early_ns)
        release(input);
}

void fv_imu_input_take(struct fv_imu_input *input, const struct fovea_frame *given,
                       struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX],
                       struct fovea_inputs *inputs)
{
    const int64_t now_ns = given != NULL ? given->stamp_ns : inputs->now_ns;
    struct fovea_imu_sample sample;
    if (input->iio == NULL && input->channel == NULL) return;
    if (given != NULL) atomic_store(&input->clock, (int)given->clock);
    atomic_store(&input->utc_offset_ns, inputs->utc_offset_ns);
    if (!input->any_frame) keep_few(input);
    if (given == NULL && !input->any_frame) return; /* the clock is not known yet */
    const int64_t monotonic_ns = from_monotonic((enum fovea_clock)atomic_load(&input->clock));
    if (!input->any_frame) leave_early(input, inputs, monotonic_ns, now_ns);
    if (!input->any_frame) atomic_store(&input->lost_early, counts_of(input).lost);
    input->any_frame = true;
    while (inputs->sample_count < FOVEA_INPUT_SAMPLES_MAX &&
           peek(input, inputs, monotonic_ns, &sample)) {
        if (waits(input, sample.stamp_ns, now_ns)) break;
        release(input);
        fv_run_sample_add(samples, &inputs->sample_count,
                          &(struct fovea_sample){.kind = FOVEA_SAMPLE_IMU, .imu = sample});
    }
}

/* ---- off the loop ---------------------------------------------------------------------------- */

enum fovea_status fv_imu_input_complaint(struct fv_imu_input *input, struct fovea_error *line)
{
    return input->iio != NULL ? fv_iio_complaint(input->iio, line) : FOVEA_AGAIN;
}

/* What found no room: until the first frame nobody took any. */
static void tell_lost(FILE *out, const struct fv_imu_input *input)
{
    const uint64_t lost = counts_of(input).lost,
                   early = input->any_frame ? atomic_load(&input->lost_early) : lost;
    if (early > 0) fprintf(out, ", %" PRIu64 " lost before the first frame", early);
    if (lost > early) fprintf(out, ", %" PRIu64 " lost: the loop was busy", lost - early);
}

void fv_imu_input_tell(FILE *out, const struct fv_imu_input *input)
{
    if (input->iio != NULL) {
        struct fv_iio_counts counts;
        fv_iio_counts(input->iio, &counts);
        fprintf(out, "  imu: %" PRIu64 " samples read", counts.samples);
        tell_lost(out, input);
        if (counts.returns > 0)
            fprintf(out, "; the sensor came back %" PRIu64 " times", counts.returns);
        fprintf(out, "\n");
    }
    if (input->channel == NULL) return;
    const uint64_t no_clock = atomic_load(&input->no_clock);
    fprintf(out, "  imu: %" PRIu64 " samples heard on %s", (uint64_t)atomic_load(&input->heard),
            input->channel);
    tell_lost(out, input);
    if (no_clock > 0)
        fprintf(out, ", %" PRIu64 " refused: neither the frames' clock nor UTC", no_clock);
    fprintf(out, "\n");
}
