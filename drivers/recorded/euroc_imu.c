#include "euroc_imu.h"

#include <string.h>
#include <strings.h>

#include "lines.h"
#include "support/calibration.h"
#include "support/text.h"
#include "support/yaml_tree.h"

/* Not of EuRoC's files, but of those of `fovea-calibrate rig`. */
static enum fovea_status read_offset(const struct fv_yaml_tree *tree, struct fovea_rig_imu *imu,
                                     struct fovea_error *error)
{
    static const int64_t most_ns = INT64_C(10000000000);
    const struct fv_yaml_node *node = fv_yaml_child(tree->root, "time_offset_ns");
    if (node == NULL) return FOVEA_OK;
    return fv_yaml_integer(tree, node, -most_ns, most_ns, &imu->time_offset_ns, error);
}

/* Each number may be so far from that of the identity, and a constant from 0: what sensors are off
 * by is less, and rows in other units or of another matrix are farther. */
static const double correction_max = 0.2;

static bool is_near_identity(const double rows[12], double constant_max)
{
    for (int i = 0; i < 12; i++) {
        const int row = i / 4, column = i % 4;
        const double most = column == 3 ? constant_max : correction_max;
        if (!(__builtin_fabs(rows[i] - (row == column ? 1 : 0)) <= most)) return false;
    }
    return true;
}

/* Rows of three numbers, or of three and a constant; where the key is not there, `rows` stay. */
static enum fovea_status read_correction(const struct fv_yaml_tree *tree, const char *key,
                                         double constant_max, const char *expected, double rows[12],
                                         struct fovea_error *error)
{
    const struct fv_yaml_node *node = fv_yaml_child(tree->root, key);
    double values[12], found[12] = {0};
    size_t count;
    if (node == NULL) return FOVEA_OK;
    const enum fovea_status status = fv_yaml_numbers(tree, node, 9, 12, values, &count, error);
    if (status != FOVEA_OK) return status;
    for (size_t r = 0; r < 3; r++)
        memcpy(found + 4 * r, values + count / 3 * r, count / 3 * sizeof *values);
    if (count % 3 != 0 || !is_near_identity(found, constant_max))
        return fv_yaml_refuse(tree, node, expected, error);
    memcpy(rows, found, sizeof found);
    return FOVEA_OK;
}

/* Likewise of no other program's files. */
static enum fovea_status read_corrections(const struct fv_yaml_tree *tree,
                                          struct fovea_rig_imu *imu, struct fovea_error *error)
{
#define ROWS "3 rows of 3 numbers that are within .2 of the identity's, or of 4, the last at most "
    const enum fovea_status status =
        read_correction(tree, "gyro_correction", 1, ROWS "1 rad/s", imu->gyro_correction, error);
    if (status != FOVEA_OK) return status;
    return read_correction(tree, "acceleration_correction", 5, ROWS "5 m/s^2",
                           imu->acceleration_correction, error);
#undef ROWS
}

static enum fovea_status read_sensor(const struct fv_yaml_tree *tree, struct fovea_rig_imu *imu,
                                     struct fovea_error *error)
{
    const struct {
        const char *key;
        double *value;
    } rows[] = {{"rate_hz", &imu->rate_hz},
                {"gyroscope_noise_density", &imu->gyro_noise},
                {"gyroscope_random_walk", &imu->gyro_walk},
                {"accelerometer_noise_density", &imu->acceleration_noise},
                {"accelerometer_random_walk", &imu->acceleration_walk}};
    const struct fv_yaml_node *node = NULL, *data = NULL;
    double T[16];
    enum fovea_status status = fv_yaml_require(tree, tree->root, "T_BS", &node, error);
    if (status == FOVEA_OK) status = fv_yaml_require(tree, node, "data", &data, error);
    if (status == FOVEA_OK) status = fv_yaml_numbers(tree, data, 16, 16, T, NULL, error);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0] && status == FOVEA_OK; i++) {
        status = fv_yaml_require(tree, tree->root, rows[i].key, &node, error);
        if (status == FOVEA_OK) status = fv_yaml_number(tree, node, 0, 1e6, rows[i].value, error);
    }
    if (status == FOVEA_OK) status = read_offset(tree, imu, error);
    if (status == FOVEA_OK) status = read_corrections(tree, imu, error);
    if (status != FOVEA_OK) return status;
    if (!fv_calibration_is_rotation(T) || T[12] != 0 || T[13] != 0 || T[14] != 0 || T[15] != 1)
        return fv_yaml_refuse(
            tree, data, "a rigid transform: rows of a rotation and a translation, then 0 0 0 1",
            error);
    memcpy(imu->T_body_imu, T, sizeof imu->T_body_imu);
    return status;
}

enum fovea_status fv_euroc_imu_sensor(const char *path, struct fovea_rig_imu *imu,
                                      struct fovea_error *error)
{
    struct fv_yaml_tree *tree;
    enum fovea_status status = fv_yaml_read(path, &tree, error);
    if (status != FOVEA_OK) return status;
    *imu = (struct fovea_rig_imu){.rate_hz = 0};
    status = read_sensor(tree, imu, error);
    fv_yaml_free(tree);
    return status;
}

/* What programs print of a number that is none, or too large: nan, inf, infinity. */
static bool is_not_finite(const char *text, double *value)
{
    const bool negative = *text == '-';
    if (negative || *text == '+') text++;
    if (strcasecmp(text, "nan") == 0)
        *value = __builtin_nan("");
    else if (strcasecmp(text, "inf") == 0 || strcasecmp(text, "infinity") == 0)
        *value = negative ? -__builtin_inf() : __builtin_inf();
    else
        return false;
    return true;
}

/* "stamp_ns,wx,wy,wz,ax,ay,az" in rad/s and m/s^2. */
static enum fovea_status read_sample(const struct fv_lines *lines, struct fovea_sample *sample,
                                     struct fovea_error *error)
{
    enum { FIELDS = 7 };
    double values[FIELDS - 1];
    int64_t stamp_ns;
    if (!fv_text_integer(lines->fields[0], &stamp_ns))
        return fv_lines_refuse(lines, "timestamp", lines->fields[0], "whole nanoseconds", error);
    if (lines->field_count != FIELDS)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s:%u: angular rate and acceleration: found %zu numbers, expected %d", lines->file,
            lines->line, lines->field_count - 1, FIELDS - 1);
    for (size_t i = 1; i < FIELDS; i++)
        if (!fv_text_number(lines->fields[i], &values[i - 1]) &&
            !is_not_finite(lines->fields[i], &values[i - 1]))
            return fv_lines_refuse(lines, "angular rate and acceleration", lines->fields[i],
                                   "a number", error);
    *sample = (struct fovea_sample){.kind = FOVEA_SAMPLE_IMU, .imu.stamp_ns = stamp_ns};
    memcpy(sample->imu.gyro, values, sizeof sample->imu.gyro);
    memcpy(sample->imu.acceleration, values + 3, sizeof sample->imu.acceleration);
    return FOVEA_OK;
}

enum fovea_status fv_euroc_imu_samples(const char *path, struct fv_samples *samples,
                                       struct fovea_error *error)
{
    struct fv_lines lines;
    struct fovea_sample sample;
    enum fovea_status status = fv_lines_open(&lines, path, error);
    if (status != FOVEA_OK) return status;
    while ((status = fv_lines_next(&lines, ",", error)) == FOVEA_OK) {
        status = read_sample(&lines, &sample, error);
        if (status == FOVEA_OK) status = fv_samples_add(samples, &sample, path, error);
        if (status != FOVEA_OK) break;
    }
    fv_lines_close(&lines);
    if (status != FOVEA_END) return status;
    if (samples->count > 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found no samples, expected at least one",
                           path);
}
