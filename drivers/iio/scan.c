#include "scan.h"

#include <stdlib.h>
#include <string.h>

/* ---- texts ----------------------------------------------------------------------------------- */

/* A whole number of at most three digits; moves behind it. */
static bool number(const char **at, uint32_t *value)
{
    int digits = 0;
    *value = 0;
    for (; **at >= '0' && **at <= '9' && digits < 3; (*at)++, digits++)
        *value = *value * 10 + (uint32_t)(**at - '0');
    return digits > 0;
}

static bool skip(const char **at, const char *text)
{
    const size_t length = strlen(text);
    if (strncmp(*at, text, length) != 0) return false;
    *at += length;
    return true;
}

bool fv_iio_type_parse(const char *text, struct fv_iio_type *type)
{
    const char *at = text;
    struct fv_iio_type t = {.big_endian = text[0] == 'b'};
    if (!skip(&at, t.big_endian ? "be:" : "le:")) return false;
    t.is_signed = *at == 's';
    if (*at != 's' && *at != 'u') return false;
    at++;
    if (!number(&at, &t.bits) || !skip(&at, "/") || !number(&at, &t.stored_bits) ||
        !skip(&at, ">>") || !number(&at, &t.shift) || *at != '\0')
        return false;
    const bool size =
        t.stored_bits == 8 || t.stored_bits == 16 || t.stored_bits == 32 || t.stored_bits == 64;
    if (!size || t.bits == 0 || t.bits > t.stored_bits || t.shift > t.stored_bits - t.bits)
        return false;
    *type = t;
    return true;
}

bool fv_iio_matrix_parse(const char *text, double matrix[9])
{
    static const double tolerance = 1e-3;
    double m[9];
    const char *at = text;
    for (int i = 0; i < 9; i++) { /* strtod goes over the spaces before a number */
        char *end;
        m[i] = strtod(at, &end);
        if (end == at) return false;
        at = end + strspn(end, " ");
        if (!skip(&at, i == 8 ? "" : i % 3 == 2 ? ";" : ",")) return false;
    }
    if (*at != '\0') return false;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double dot = i == k ? -1 : 0;
            for (int c = 0; c < 3; c++)
                dot += m[3 * i + c] * m[3 * k + c];
            if (!(dot < tolerance && dot > -tolerance)) return false;
        }
    memcpy(matrix, m, sizeof m);
    return true;
}

/* ---- layout ---------------------------------------------------------------------------------- */

bool fv_iio_scan_lay(struct fv_iio_scan *scan)
{
    bool laid[FV_IIO_ELEMENTS] = {false};
    uint32_t at = 0, widest = 1;
    if (scan->elements[FV_IIO_STAMP].type.stored_bits != 64) return false;
    for (int n = 0; n < FV_IIO_ELEMENTS; n++) {
        int next = -1;
        for (int i = 0; i < FV_IIO_ELEMENTS; i++) {
            if (laid[i]) continue;
            if (next >= 0 && scan->elements[i].index == scan->elements[next].index) return false;
            if (next < 0 || scan->elements[i].index < scan->elements[next].index) next = i;
        }
        const uint32_t size = scan->elements[next].type.stored_bits / 8;
        at = (at + size - 1) / size * size;
        scan->elements[next].offset = at;
        at += size;
        if (size > widest) widest = size;
        laid[next] = true;
    }
    scan->bytes = (at + widest - 1) / widest * widest;
    return true;
}

static int64_t raw(const struct fv_iio_element *element, const uint8_t *data)
{
    const struct fv_iio_type *type = &element->type;
    const uint32_t size = type->stored_bits / 8;
    uint64_t value = 0;
    for (uint32_t i = 0; i < size; i++) {
        const uint32_t from = type->big_endian ? i : size - 1 - i;
        value = value << 8 | data[element->offset + from];
    }
    value >>= type->shift;
    if (type->bits < 64) value &= (UINT64_C(1) << type->bits) - 1;
    const uint64_t sign = UINT64_C(1) << (type->bits - 1);
    if (type->is_signed) value = (value ^ sign) - sign;
    return (int64_t)value;
}

/* Three axes as the sensor has them, turned into the frame of the device. */
static void axes(const struct fv_iio_element *elements, const double mount[9], const uint8_t *data,
                 double out[3])
{
    double v[3];
    for (int i = 0; i < 3; i++)
        v[i] = ((double)raw(&elements[i], data) + elements[i].shift) * elements[i].scale;
    for (int i = 0; i < 3; i++)
        out[i] = mount[3 * i] * v[0] + mount[3 * i + 1] * v[1] + mount[3 * i + 2] * v[2];
}

void fv_iio_scan_read(const struct fv_iio_scan *scan, const uint8_t *data,
                      struct fovea_imu_sample *sample)
{
    sample->stamp_ns = raw(&scan->elements[FV_IIO_STAMP], data);
    axes(&scan->elements[FV_IIO_GYRO], scan->gyro_mount, data, sample->gyro);
    axes(&scan->elements[FV_IIO_ACCELERATION], scan->acceleration_mount, data,
         sample->acceleration);
}

double fv_iio_scan_range(const struct fv_iio_scan *scan, int first)
{
    double least = 0;
    for (int i = 0; i < 3; i++) {
        const struct fv_iio_element *e = &scan->elements[first + i];
        if (!e->type.is_signed || e->type.bits > 32) return 0;
        const double most = (double)(UINT64_C(1) << (e->type.bits - 1)) - 1;
        const double end = most * (e->scale < 0 ? -e->scale : e->scale);
        if (i == 0 || end < least) least = end;
    }
    return least;
}
