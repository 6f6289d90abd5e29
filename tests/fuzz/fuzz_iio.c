/* What a Linux IIO device states of itself, and its buffer: any lines as the types of its seven
 * elements and its mount matrix, any bytes as a scan. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "../../drivers/iio/scan.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The next line, cut to fit; moves behind it. */
static void line_of(const uint8_t **data, size_t *size, char line[64])
{
    const uint8_t *end = memchr(*data, '\n', *size);
    const size_t length = end != NULL ? (size_t)(end - *data) : *size,
                 kept = length < 63 ? length : 63, used = end != NULL ? length + 1 : length;
    memcpy(line, *data, kept);
    line[kept] = '\0';
    *data += used;
    *size -= used;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fv_iio_scan scan;
    struct fovea_imu_sample sample;
    uint8_t bytes[64] = {0};
    char line[64];
    memset(&scan, 0, sizeof scan);
    for (int i = 0; i < FV_IIO_ELEMENTS; i++) {
        line_of(&data, &size, line);
        if (!fv_iio_type_parse(line, &scan.elements[i].type)) return 0;
        scan.elements[i].index = (uint32_t)i * 3 % 8;
        scan.elements[i].scale = 0.5;
    }
    line_of(&data, &size, line);
    if (!fv_iio_matrix_parse(line, scan.gyro_mount)) return 0;
    if (!fv_iio_scan_lay(&scan)) return 0;
    if (scan.bytes > sizeof bytes) abort(); /* seven of 8 bytes */
    for (int i = 0; i < FV_IIO_ELEMENTS; i++)
        if (scan.elements[i].offset + scan.elements[i].type.stored_bits / 8 > scan.bytes) abort();
    memcpy(bytes, data, size < scan.bytes ? size : scan.bytes);
    fv_iio_scan_read(&scan, bytes, &sample);
    if (!(fv_iio_scan_range(&scan, FV_IIO_GYRO) >= 0)) abort();
    return 0;
}
