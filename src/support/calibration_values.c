#include "support/calibration_reader.h"

#include <stdio.h>
#include <string.h>

typedef const struct fv_yaml_node node;

enum fovea_status fv_calibration_unsupported(const struct fv_calibration_reader *r, node *where,
                                             const char *expected)
{
    fv_yaml_refuse(r->tree, where, expected, r->error);
    if (r->error != NULL) r->error->status = FOVEA_ERROR_UNSUPPORTED;
    return FOVEA_ERROR_UNSUPPORTED;
}

/* ---- lists and matrices ---------------------------------------------------------------------- */

/* A list of numbers, bare or as the `data` of a mapping with `rows` and `cols`, which must agree
 * with it. */
static enum fovea_status read_list(const struct fv_calibration_reader *r, node *list,
                                   size_t count_min, size_t count_max, double *values,
                                   size_t *count, node **data)
{
    *data = list;
    enum fovea_status status;
    if (list->kind == FV_YAML_MAPPING &&
        (status = fv_yaml_require(r->tree, list, "data", data, r->error)) != FOVEA_OK)
        return status;
    size_t found;
    status = fv_yaml_numbers(r->tree, *data, count_min, count_max, values, &found, r->error);
    if (status != FOVEA_OK) return status;
    *count = found;
    node *rows = fv_yaml_child(list, "rows"), *cols = fv_yaml_child(list, "cols");
    if (rows == NULL || cols == NULL) return FOVEA_OK;
    int64_t row_count, col_count;
    if ((status = fv_yaml_integer(r->tree, rows, 0, 64, &row_count, r->error)) != FOVEA_OK)
        return status;
    if ((status = fv_yaml_integer(r->tree, cols, 0, 64, &col_count, r->error)) != FOVEA_OK)
        return status;
    const long long product = row_count * col_count;
    if ((size_t)product == found) return FOVEA_OK;
    char expected[64];
    snprintf(expected, sizeof expected, "a list of rows x cols = %lld numbers", product);
    return fv_yaml_refuse(r->tree, *data, expected, r->error);
}

#define TEXT_OF(number) #number
#define TEXT(number) TEXT_OF(number)
#define FOCAL_RANGE "[" TEXT(FOVEA_CAMERA_FOCAL_MIN_PX) ", " TEXT(FOVEA_CAMERA_FOCAL_MAX_PX) "]"
#define CENTRE_RANGE "[-" TEXT(FOVEA_CAMERA_CENTRE_MAX_PX) ", " TEXT(FOVEA_CAMERA_CENTRE_MAX_PX) "]"

enum fovea_status fv_calibration_set_pinhole(const struct fv_calibration_reader *r, node *data,
                                             const double *values, const size_t index[4])
{
    for (size_t i = 0; i < 4; i++) {
        const double value = values[index[i]];
        const bool fits =
            i < 2 ? value >= FOVEA_CAMERA_FOCAL_MIN_PX && value <= FOVEA_CAMERA_FOCAL_MAX_PX
                  : value >= -FOVEA_CAMERA_CENTRE_MAX_PX && value <= FOVEA_CAMERA_CENTRE_MAX_PX;
        if (fits) continue;
        return fv_yaml_refuse(r->tree, fv_yaml_leaf(data, index[i]),
                              i < 2 ? "a focal length in " FOCAL_RANGE " pixels"
                                    : "an image centre in " CENTRE_RANGE " pixels",
                              r->error);
    }
    struct fovea_camera *camera = &r->calibration->camera;
    camera->fx = values[index[0]];
    camera->fy = values[index[1]];
    camera->cx = values[index[2]];
    camera->cy = values[index[3]];
    return FOVEA_OK;
}

/* [fx s cx; 0 fy cy; 0 0 1] with no skew. */
enum fovea_status fv_calibration_read_matrix(const struct fv_calibration_reader *r, node *matrix)
{
    static const size_t pinhole[4] = {0, 4, 2, 5};
    static const size_t fixed[5] = {1, 3, 6, 7, 8};
    static const double fixed_value[5] = {0, 0, 0, 0, 1};
    double K[9] = {0};
    size_t count;
    node *data;
    const enum fovea_status status = read_list(r, matrix, 9, 9, K, &count, &data);
    if (status != FOVEA_OK) return status;
    for (size_t i = 0; i < 5; i++)
        if (K[fixed[i]] != fixed_value[i])
            return fv_calibration_unsupported(r, fv_yaml_leaf(data, fixed[i]),
                                              i == 0   ? "0 (a camera with skew is not supported)"
                                              : i == 4 ? "1 as the last element of a camera matrix"
                                                       : "0 at this place of a camera matrix");
    return fv_calibration_set_pinhole(r, data, K, pinhole);
}

/* Coefficients in the order of the lens model. OpenCV and ROS may append thin prism and tilt terms,
 * zero here. */
enum fovea_status fv_calibration_read_distortion(const struct fv_calibration_reader *r, node *list)
{
    struct fovea_camera *camera = &r->calibration->camera;
    const size_t held = camera->lens == FOVEA_LENS_EQUIDISTANT ? 4 : FOVEA_LENS_COEFFICIENTS;
    double k[14] = {0};
    size_t count;
    node *data;
    const enum fovea_status status = read_list(r, list, 0, 14, k, &count, &data);
    if (status != FOVEA_OK) return status;
    const bool known_count =
        camera->lens == FOVEA_LENS_EQUIDISTANT
            ? count == 0 || count >= 4
            : count == 0 || count == 4 || count == 5 || count == 8 || count == 12 || count == 14;
    if (!known_count)
        return fv_yaml_refuse(r->tree, data,
                              camera->lens == FOVEA_LENS_EQUIDISTANT
                                  ? "a list of 4 numbers: k1 k2 k3 k4"
                                  : "a list of 4, 5, 8, 12 or 14 numbers",
                              r->error);
    for (size_t i = 0; i < count; i++) {
        if (i >= held && k[i] != 0.0)
            return fv_calibration_unsupported(r, fv_yaml_leaf(data, i),
                                              "0 (this term is not in the lens model)");
        if (!(k[i] >= -1e6 && k[i] <= 1e6))
            return fv_yaml_refuse(r->tree, fv_yaml_leaf(data, i), "a number in [-1e6, 1e6]",
                                  r->error);
        if (i < held) camera->k[i] = k[i];
    }
    return FOVEA_OK;
}

/* A rigid 4x4 or 3x4 transform. */
enum fovea_status fv_calibration_read_transform(const struct fv_calibration_reader *r, node *list,
                                                double T[12])
{
    double values[16] = {0};
    size_t count;
    node *data;
    const enum fovea_status status = read_list(r, list, 12, 16, values, &count, &data);
    if (status != FOVEA_OK) return status;
    const bool rigid = count == 12 || (count == 16 && values[12] == 0 && values[13] == 0 &&
                                       values[14] == 0 && values[15] == 1);
    if (!rigid || !fv_calibration_is_rotation(values))
        return fv_yaml_refuse(
            r->tree, data, "a rigid transform: rows of a rotation and a translation, then 0 0 0 1",
            r->error);
    memcpy(T, values, 12 * sizeof T[0]);
    return FOVEA_OK;
}

void fv_calibration_invert(const double T[12], double inverse[12])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            inverse[4 * i + j] = T[4 * j + i];
        inverse[4 * i + 3] = -(T[i] * T[3] + T[4 + i] * T[7] + T[8 + i] * T[11]);
    }
}

void fv_calibration_multiply(const double a[12], const double b[12], double product[12])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 4; j++) {
            product[4 * i + j] = j == 3 ? a[4 * i + 3] : 0;
            for (int k = 0; k < 3; k++)
                product[4 * i + j] += a[4 * i + k] * b[4 * k + j];
        }
    }
}

enum fovea_status fv_calibration_read_size(const struct fv_calibration_reader *r, node *width_node,
                                           node *height_node)
{
    int64_t width, height;
    enum fovea_status status;
    if ((status = fv_yaml_integer(r->tree, width_node, 1, 65535, &width, r->error)) != FOVEA_OK)
        return status;
    if ((status = fv_yaml_integer(r->tree, height_node, 1, 65535, &height, r->error)) != FOVEA_OK)
        return status;
    r->calibration->camera.width = (int32_t)width;
    r->calibration->camera.height = (int32_t)height;
    return FOVEA_OK;
}

/* ---- the record ------------------------------------------------------------------------------ */

const char *fv_calibration_parameter_name(enum fovea_lens lens, int index)
{
    static const char *const radtan[] = {"fx", "fy", "cx", "cy", "k1", "k2",
                                         "p1", "p2", "k3", "k4", "k5", "k6"};
    static const char *const equidistant[] = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
    if (lens == FOVEA_LENS_EQUIDISTANT) return (unsigned)index < 8 ? equidistant[index] : NULL;
    return (unsigned)index < 12 ? radtan[index] : NULL;
}

static enum fovea_status read_text(const struct fv_calibration_reader *r, node *parent,
                                   const char *key, char *text, size_t bytes)
{
    node *child = fv_yaml_child(parent, key);
    const char *found = "";
    if (child == NULL || (child->kind == FV_YAML_SCALAR && child->value[0] == '\0'))
        return FOVEA_OK;
    const enum fovea_status status = fv_yaml_string(r->tree, child, bytes - 1, &found, r->error);
    if (status == FOVEA_OK) snprintf(text, bytes, "%s", found);
    return status;
}

static enum fovea_status read_record_numbers(const struct fv_calibration_reader *r, node *section)
{
    struct fv_calibration_record *record = &r->calibration->record;
    const struct {
        const char *key;
        double *value;
    } numbers[] = {{"rms_px", &record->rms_px},
                   {"noise_px", &record->noise_px},
                   {"held_out_rms_px", &record->held_out_rms_px},
                   {"projection_stdev_px", &record->projection_stdev_px},
                   {"time_shift_stdev_s", &record->time_shift_stdev_s}};
    const struct {
        const char *key;
        int32_t *value;
    } counts[] = {{"views", &record->views}, {"corners", &record->corners}};
    enum fovea_status status;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        node *child = fv_yaml_child(section, numbers[i].key);
        if (child != NULL && (status = fv_yaml_number(r->tree, child, 0, 1e12, numbers[i].value,
                                                      r->error)) != FOVEA_OK)
            return status;
    }
    for (size_t i = 0; i < 2; i++) {
        node *child = fv_yaml_child(section, counts[i].key);
        int64_t count = 0;
        if (child != NULL &&
            (status = fv_yaml_integer(r->tree, child, 0, INT32_MAX, &count, r->error)) != FOVEA_OK)
            return status;
        *counts[i].value = (int32_t)count;
    }
    node *place = fv_yaml_child(section, "place_stdev");
    if (place != NULL && (status = fv_yaml_numbers(r->tree, place, 6, 6, record->place_stdev, NULL,
                                                   r->error)) != FOVEA_OK)
        return status;
    node *deviations = fv_yaml_child(section, "stdev");
    for (int i = 0; deviations != NULL; i++) {
        const char *key = fv_calibration_parameter_name(r->calibration->camera.lens, i);
        if (key == NULL) break;
        node *child = fv_yaml_child(deviations, key);
        if (child != NULL && (status = fv_yaml_number(r->tree, child, 0, 1e300, &record->stdev[i],
                                                      r->error)) != FOVEA_OK)
            return status;
    }
    return FOVEA_OK;
}

enum fovea_status fv_calibration_read_record(const struct fv_calibration_reader *r, node *parent)
{
    node *section = fv_yaml_child(parent, "calibration"),
         *program = fv_yaml_child(section, "program");
    struct fv_calibration *c = r->calibration;
    struct fv_calibration_record *record = &c->record;
    static const char ours[] = "fovea-calibrate";
    if (program == NULL || strncmp(program->value, ours, sizeof ours - 1) != 0) return FOVEA_OK;
    const struct {
        const char *key;
        char *text;
        size_t bytes;
    } texts[] = {{"program", record->program, sizeof record->program},
                 {"date", record->date, sizeof record->date},
                 {"verdict", record->verdict, sizeof record->verdict},
                 {"camera_id", record->camera_id, sizeof record->camera_id},
                 {"board", record->board, sizeof record->board},
                 {"name", c->name, sizeof c->name}};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        const enum fovea_status status =
            read_text(r, section, texts[i].key, texts[i].text, texts[i].bytes);
        if (status != FOVEA_OK) return status;
    }
    return read_record_numbers(r, section);
}
