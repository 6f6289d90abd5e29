/* An inertial sensor of Linux IIO: a thread of its own reads its buffer and hands samples to the
 * loop through a wait-free ring, so that neither a sensor that hangs nor one that was unplugged
 * holds up the loop. It is searched for until it is back, by its name (live/recovery.h).
 *
 * Stamps are the kernel's, on CLOCK_MONOTONIC; those of another clock are converted as they come.
 * Samples are in rad/s and m/s^2, in the frame of the device: scale, offset and mount matrix are
 * read from it. FOVEA_IIO_ROOT in the environment stands before /sys and /dev, for tests. */
#ifndef FOVEA_DRIVERS_IIO_IIO_H
#define FOVEA_DRIVERS_IIO_IIO_H

#include <stdint.h>

#include "fovea/sensor.h"
#include "fovea/status.h"

struct fv_iio; /* an open sensor */

struct fv_iio_info {
    double rate_hz; /* as the device states it; 0: not known */
    /* rad/s, m/s^2: the most that the bits of a value hold by its scale; 0: not known */
    double gyro_range, acceleration_range;
};

struct fv_iio_counts {
    uint64_t samples; /* handed over */
    uint64_t dropped; /* since the loop took none */
    uint64_t returns; /* times that samples came back, after it was away or started anew */
};

/* Find the sensor and try it. `rate_hz`: asked for; 0: as it is. FOVEA_ERROR_INPUT: there is none
 * of the name. FOVEA_ERROR_UNSUPPORTED or FOVEA_ERROR_SYSTEM: it lacks something, or the rights.
 * Init-only. */
enum fovea_status fv_iio_open(const char *name, double rate_hz, struct fv_iio **iio,
                              struct fovea_error *error);
const struct fv_iio_info *fv_iio_info(const struct fv_iio *iio);
/* `see` gets each sample as it comes, on the thread of the sensor, also while the loop takes none.
 * Before fv_iio_start. */
void fv_iio_tap(struct fv_iio *iio,
                void (*see)(void *context, const struct fovea_imu_sample *sample), void *context);
enum fovea_status fv_iio_start(struct fv_iio *iio, struct fovea_error *error);

/* The oldest sample that has come, which stays until fv_iio_release; NULL: there is none. Loop
 * thread, wait-free. */
const struct fovea_imu_sample *fv_iio_peek(struct fv_iio *iio);
void fv_iio_release(struct fv_iio *iio);

void fv_iio_counts(const struct fv_iio *iio, struct fv_iio_counts *counts);
/* As fovea_source_ops.complaint. */
enum fovea_status fv_iio_complaint(struct fv_iio *iio, struct fovea_error *line);
void fv_iio_close(struct fv_iio *iio);

#endif
