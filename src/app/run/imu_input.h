/* Samples of an inertial sensor beside the source (the key `imu`), on their way to the step: from
 * LCM, as fovea.imu_t, or from Linux IIO.
 *
 * They wait in a ring until the time of the frame that they belong to, and are then put on the
 * frames' clock and among the step's other samples, in the order of their stamps. A stamp by LCM
 * counts as it is where it states the frames' own clock, from this host; else by its UTC. What the
 * values are worth is the runtime's to judge (fovea_imu_status). */
#ifndef FOVEA_APP_RUN_IMU_INPUT_H
#define FOVEA_APP_RUN_IMU_INPUT_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>

#include "app/config/imu.h"
#include "app/network/receiver.h"
#include "base/ring.h"
#include "drivers/iio/iio.h"
#include "fovea/fovea.h"

enum {
    FV_IMU_INPUT_BYTES = 1 << 17, /* of the ring: 1.6 s at 1 kHz */
    FV_IMU_INPUT_KEPT = 512,      /* samples that wait for the first frame, the last ones */
};

struct fv_imu_input {
    struct fv_iio *iio;     /* the setup's; NULL: none */
    const char *channel;    /* of LCM; NULL: none */
    int64_t time_offset_ns; /* to add to a stamp for the frames' clock */
    /* by LCM */
    struct fv_ring ring;
    _Alignas(8) uint8_t memory[FV_IMU_INPUT_BYTES];
    atomic_uint_fast64_t heard, no_room, no_clock;
    /* the loop's */
    uint64_t taken; /* samples that wait no more */
    atomic_bool any_frame;
    atomic_uint_fast64_t lost_early; /* before the first frame */
    /* Written by the loop: of the frames, whose first one has come when any_frame is set. */
    atomic_int clock;
    atomic_int_fast64_t utc_offset_ns;
    void (*tap)(void *context, const struct fovea_imu_sample *sample);
    void *tap_context;
};

/* Zeroed memory; settings that fv_imu_join has seen. */
void fv_imu_input_open(struct fv_imu_input *input, const struct fv_settings *settings,
                       struct fv_iio *iio);
/* `see` gets each sample as it comes, on the thread that brings it, from the first frame on: its
 * stamp is on the frames' clock. Those more than a quarter of a second from the time of that clock
 * are left out, so that one forged message in the future does not keep back those that follow.
 * After fv_imu_input_open and before the sensor or the receiver starts. */
void fv_imu_input_tap(struct fv_imu_input *input,
                      void (*see)(void *context, const struct fovea_imu_sample *sample),
                      void *context);
/* Whether it hears a channel, and the row of the receiver's table for it. */
bool fv_imu_input_hears(const struct fv_imu_input *input);
struct fv_receiver_channel fv_imu_input_row(struct fv_imu_input *input);

/* Add to `samples`, of which inputs->sample_count are there, those that have come up to the stamp
 * of what the source gave (`given`; NULL: up to inputs->now_ns). What finds no room waits. Loop
 * thread, wait-free. */
void fv_imu_input_take(struct fv_imu_input *input, const struct fovea_frame *given,
                       struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX],
                       struct fovea_inputs *inputs);

/* As fovea_source_ops.complaint. */
enum fovea_status fv_imu_input_complaint(struct fv_imu_input *input, struct fovea_error *line);
/* A line of what came and what was lost on the way; nothing without such a sensor. */
void fv_imu_input_tell(FILE *out, const struct fv_imu_input *input);

#endif
