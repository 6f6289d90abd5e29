/* A device of Linux IIO (Industrial I/O) in sysfs: an inertial sensor whose gyroscope and
 * accelerometer share one buffer. All calls may wait for the driver: never on the loop thread. */
#ifndef FOVEA_DRIVERS_IIO_DEVICE_H
#define FOVEA_DRIVERS_IIO_DEVICE_H

#include <time.h>

#include "fovea/status.h"
#include "scan.h"

enum { FV_IIO_NAME_BYTES = 64, FV_IIO_PATH_BYTES = 512 };

struct fv_iio_device {
    char root[256];               /* before /sys and /dev; "": those of the host */
    char name[FV_IIO_NAME_BYTES]; /* asked for: its name or label, or "iio:deviceN" */
    double asked_hz;              /* 0: leave the rate as it is */

    /* While it is set up. */
    char folder[FV_IIO_PATH_BYTES]; /* in sysfs */
    int fd;                         /* of the buffer; -1: not open */
    struct fv_iio_scan scan;
    double rate_hz;  /* 0: not known */
    clockid_t clock; /* of the stamps */
};

/* Find the device by its name, choose elements, rate and clock, and open the buffer. FOVEA_OK: it
 * streams; `error` may then hold a notice all the same, else its text is empty. FOVEA_GONE: it is
 * away, and `error` lists those that there are. FOVEA_ERROR_UNSUPPORTED:
 * it lacks something, FOVEA_ERROR_SYSTEM: a file refused; `error` names it. */
enum fovea_status fv_iio_device_set_up(struct fv_iio_device *device, struct fovea_error *error);

void fv_iio_device_tear_down(struct fv_iio_device *device);

#endif
