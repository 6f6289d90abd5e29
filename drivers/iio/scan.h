/* Scans of a Linux IIO buffer: where its elements lie, and what they mean.
 *
 * A scan holds the enabled elements in the order of their indices, each aligned to its own size,
 * and is padded to the largest of them (Documentation/ABI/testing/sysfs-bus-iio,
 * Documentation/driver-api/iio/buffers.rst). An element's type reads "le:s16/16>>0": byte order,
 * sign, bits that count, bits that are stored, and shift. A value is (raw + offset) times scale, in
 * m/s^2 or rad/s; the mount matrix turns it into the frame of the device. Any thread. */
#ifndef FOVEA_DRIVERS_IIO_SCAN_H
#define FOVEA_DRIVERS_IIO_SCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/sensor.h"

struct fv_iio_type {
    bool big_endian, is_signed;
    uint32_t bits, stored_bits, shift; /* stored: 8, 16, 32 or 64 */
};

/* False: not such a type, or one of several values ("X2"). */
bool fv_iio_type_parse(const char *text, struct fv_iio_type *type);

/* "1, 0, 0; 0, 1, 0; 0, 0, 1", a rotation to a thousandth, row by row. False: not one. */
bool fv_iio_matrix_parse(const char *text, double matrix[9]);

enum { FV_IIO_GYRO = 0, FV_IIO_ACCELERATION = 3, FV_IIO_STAMP = 6, FV_IIO_ELEMENTS = 7 };

struct fv_iio_element {
    struct fv_iio_type type;
    uint32_t index;      /* in the scan */
    uint32_t offset;     /* bytes; by fv_iio_scan_lay */
    double scale, shift; /* value = (raw + shift) * scale */
};

/* gyro x y z, acceleration x y z, stamp */
struct fv_iio_scan {
    struct fv_iio_element elements[FV_IIO_ELEMENTS];
    double gyro_mount[9], acceleration_mount[9];
    uint32_t bytes; /* by fv_iio_scan_lay */
};

/* Find offsets and size. False: two elements have one index, or the stamp has no 64 bits. */
bool fv_iio_scan_lay(struct fv_iio_scan *scan);

/* The sample in `bytes` bytes of a scan, its stamp as the kernel gave it. */
void fv_iio_scan_read(const struct fv_iio_scan *scan, const uint8_t *data,
                      struct fovea_imu_sample *sample);

/* The largest value that an axis of a sort can report; 0: not known. */
double fv_iio_scan_range(const struct fv_iio_scan *scan, int first);

#endif
