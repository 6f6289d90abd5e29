/* A Linux IIO tree in a folder of its own: sysfs files, and a FIFO as the buffer. One at a time. */
#ifndef FOVEA_TESTS_COMMON_FAKE_IIO_H
#define FOVEA_TESTS_COMMON_FAKE_IIO_H

#include <stdbool.h>
#include <stdint.h>

/* A combined sensor "adis16448": big-endian 16 of 32 bits, as index 0 to 5, temperature beside it,
 * and a stamp; gyro 0.001 rad/s, acceleration 0.01 m/s^2 per step. FOVEA_IIO_ROOT is set to it. */
void fake_iio_make(void);
void fake_iio_remove(void);

/* Write a file below the device's folder; make its folders. NULL: remove it. */
void fake_iio_file(const char *name, const char *value);
/* What a file says now. */
bool fake_iio_says(const char *name, const char *value);
/* The same, when it has been waited for. */
bool fake_iio_comes_to_say(const char *name, const char *value);

/* The buffer: a scan with raw values. False: nobody takes it. */
bool fake_iio_scan(const int16_t raw[6], int64_t stamp_ns);
/* The same in two pieces, with a pause between. */
void fake_iio_scan_in_pieces(const int16_t raw[6], int64_t stamp_ns);

void fake_iio_unplug(void);
void fake_iio_plug(void);

#endif
