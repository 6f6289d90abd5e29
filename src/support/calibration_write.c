#include "support/calibration.h"

#include <errno.h>
#include <locale.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "support/output.h"

static const char *const format_names[FV_CALIBRATION_FORMAT_COUNT] = {"ros", "ros-message",
                                                                      "opencv", "kalibr", "euroc"};

const char *fv_calibration_format_name(enum fv_calibration_format format)
{
    return (unsigned)format < FV_CALIBRATION_FORMAT_COUNT ? format_names[format] : NULL;
}

/* ---- text ------------------------------------------------------------------------------------ */

struct writer {
    char *text;
    size_t used;
};

__attribute__((format(printf, 2, 3))) static void put(struct writer *w, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length =
        vsnprintf(w->text + w->used, FV_CALIBRATION_BYTES_MAX - w->used, format, arguments);
    va_end(arguments);
    w->used += (size_t)length;
    if (w->used >= FV_CALIBRATION_BYTES_MAX)
        w->used = FV_CALIBRATION_BYTES_MAX - 1; /* cannot be: sizes are fixed */
}

/* "1, 2, 3" with all bits of each number, and always with a point so that no reader takes it for an
 * integer.
 */
static void put_numbers(struct writer *w, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        char number[40];
        snprintf(number, sizeof number, "%.17g", values[i]);
        put(w, "%s%s%s", i > 0 ? ", " : "", number, strpbrk(number, ".e") == NULL ? ".0" : "");
    }
}

/* A string in double quotes, in which everything may stand. */
static void put_text(struct writer *w, const char *key, const char *text)
{
    put(w, "%s: \"", key);
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c < 32 || c == 127)
            put(w, "\\x%02X", c);
        else
            put(w, "%s%c", c == '"' || c == '\\' ? "\\" : "", c);
    }
    put(w, "\"\n");
}

static void put_matrix(struct writer *w, const char *key, bool opencv, int rows, int cols,
                       const double *values)
{
    put(w,
        opencv ? "%s: !!opencv-matrix\n   rows: %d\n   cols: %d\n   dt: d\n   data: ["
               : "%s:\n  rows: %d\n  cols: %d\n  data: [",
        key, rows, cols);
    put_numbers(w, values, (size_t)rows * (size_t)cols);
    put(w, "]\n");
}

static void put_list(struct writer *w, const char *key, const double *values, size_t count)
{
    put(w, "%s: [", key);
    put_numbers(w, values, count);
    put(w, "]\n");
}

/* ---- the formats ----------------------------------------------------------------------------- */

/* Coefficients that the file lists: 4 for equidistant, 4, 5 or 8 for radial-tangential, as few as
 * say everything. */
static size_t coefficient_count(const struct fovea_camera *camera, size_t least)
{
    if (camera->lens == FOVEA_LENS_EQUIDISTANT) return 4;
    if (camera->k[5] != 0 || camera->k[6] != 0 || camera->k[7] != 0) return 8;
    return camera->k[4] != 0 || least == 5 ? 5 : 4;
}

static const char *ros_model(const struct fovea_camera *camera)
{
    if (camera->lens == FOVEA_LENS_EQUIDISTANT) return "equidistant";
    return coefficient_count(camera, 5) == 8 ? "rational_polynomial" : "plumb_bob";
}

static void write_ros(struct writer *w, const struct fv_calibration *c, bool message)
{
    const struct fovea_camera *m = &c->camera;
    const double K[9] = {m->fx, 0, m->cx, 0, m->fy, m->cy, 0, 0, 1},
                 R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const double P[12] = {m->fx, 0, m->cx, 0, 0, m->fy, m->cy, 0, 0, 0, 1, 0};
    const size_t count = coefficient_count(m, 5);
    if (message) {
        put(w, "height: %d\nwidth: %d\ndistortion_model: %s\n", m->height, m->width, ros_model(m));
        put_list(w, "D", m->k, count);
        put_list(w, "K", K, 9);
        put_list(w, "R", R, 9);
        put_list(w, "P", P, 12);
        return;
    }
    put(w, "image_width: %d\nimage_height: %d\n", m->width, m->height);
    if (c->name[0] != '\0') put_text(w, "camera_name", c->name);
    put_matrix(w, "camera_matrix", false, 3, 3, K);
    put(w, "distortion_model: %s\n", ros_model(m));
    put_matrix(w, "distortion_coefficients", false, 1, (int)count, m->k);
    put_matrix(w, "rectification_matrix", false, 3, 3, R);
    put_matrix(w, "projection_matrix", false, 3, 4, P);
}

static void write_opencv(struct writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const double K[9] = {m->fx, 0, m->cx, 0, m->fy, m->cy, 0, 0, 1};
    put(w, "%%YAML:1.0\n---\nimage_width: %d\nimage_height: %d\n", m->width, m->height);
    put(w, "fisheye_model: %d\n", m->lens == FOVEA_LENS_EQUIDISTANT);
    put_matrix(w, "camera_matrix", true, 3, 3, K);
    put_matrix(w, "distortion_coefficients", true, (int)coefficient_count(m, 5), 1, m->k);
}

/* Names that can stand as the key of a camchain: cam0, cam1, ... */
static bool is_chain_key(const char *name)
{
    return strncmp(name, "cam", 3) == 0 && name[3] != '\0' &&
           strspn(name + 3, "0123456789") == strlen(name + 3);
}

static void write_kalibr(struct writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const double intrinsics[4] = {m->fx, m->fy, m->cx, m->cy};
    put(w, "%s:\n", is_chain_key(c->name) ? c->name : "cam0");
    if (c->has_T_body_cam) {
        const double *T = c->T_body_cam;
        put(w, "  T_cam_imu:\n");
        for (int i = 0; i < 3; i++) {
            const double row[4] = {T[i], T[4 + i], T[8 + i],
                                   -(T[i] * T[3] + T[4 + i] * T[7] + T[8 + i] * T[11])};
            put(w, "  - [");
            put_numbers(w, row, 4);
            put(w, "]\n");
        }
    }
    put(w, "  camera_model: pinhole\n");
    put_list(w, "  intrinsics", intrinsics, 4);
    put(w, "  distortion_model: %s\n",
        m->lens == FOVEA_LENS_EQUIDISTANT ? "equidistant" : "radtan");
    put_list(w, "  distortion_coeffs", m->k, 4);
    put(w, "  resolution: [%d, %d]\n", m->width, m->height);
}

static void write_euroc(struct writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const double intrinsics[4] = {m->fx, m->fy, m->cx, m->cy};
    put(w, "sensor_type: camera\n");
    if (c->has_T_body_cam) {
        put(w, "T_BS:\n  rows: 4\n  cols: 4\n  data: [");
        put_numbers(w, c->T_body_cam, 12);
        put(w, ", 0.0, 0.0, 0.0, 1.0]\n");
    }
    if (c->rate_hz > 0) {
        put(w, "rate_hz: ");
        put_numbers(w, &c->rate_hz, 1);
        put(w, "\n");
    }
    put(w, "resolution: [%d, %d]\ncamera_model: pinhole\n", m->width, m->height);
    put_list(w, "intrinsics", intrinsics, 4);
    put(w, "distortion_model: %s\n",
        m->lens == FOVEA_LENS_EQUIDISTANT ? "equidistant" : "radial-tangential");
    put_list(w, "distortion_coefficients", m->k, 4);
}

/* ---- what a format cannot hold --------------------------------------------------------------- */

static enum fovea_status refuse_lossy(enum fv_calibration_format format,
                                      const struct fovea_camera *camera, struct fovea_error *error)
{
    static const char *const names[] = {"k3", "k4", "k5", "k6"};
    const char *name = fv_calibration_format_name(format);
    if (name == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "calibration format: found %d, expected 0 to %d", (int)format,
                               FV_CALIBRATION_FORMAT_COUNT - 1);
    if (camera->width <= 0 || camera->height <= 0)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "image size: found none in the calibration, expected one to write the format %s", name);
    if (camera->lens == FOVEA_LENS_EQUIDISTANT ||
        (format != FV_CALIBRATION_KALIBR && format != FV_CALIBRATION_EUROC))
        return FOVEA_OK;
    for (int i = 0; i < 4; i++)
        if (camera->k[4 + i] != 0)
            return fovea_error_set(
                error, FOVEA_ERROR_UNSUPPORTED,
                "%s: found %.9g, expected 0: the format %s holds k1 k2 p1 p2 and it would be lost",
                names[i], camera->k[4 + i], name);
    return FOVEA_OK;
}

static void name_lost(enum fv_calibration_format format, const struct fv_calibration *c,
                      struct fovea_error *lost)
{
    const bool transform =
        c->has_T_body_cam && format != FV_CALIBRATION_KALIBR && format != FV_CALIBRATION_EUROC;
    const bool rate = c->rate_hz > 0 && format != FV_CALIBRATION_EUROC;
    const bool name = c->name[0] != '\0' && format != FV_CALIBRATION_ROS &&
                      !(format == FV_CALIBRATION_KALIBR && is_chain_key(c->name));
    if (lost == NULL) return;
    if (!transform && !rate && !name) {
        fovea_error_set(lost, FOVEA_OK, "%s", "");
        return;
    }
    fovea_error_set(lost, FOVEA_OK, "the format %s has no place for:%s%s%s",
                    fv_calibration_format_name(format), transform ? " T_body_cam" : "",
                    rate ? " rate_hz" : "", name ? " name" : "");
}

/* ---- writing --------------------------------------------------------------------------------- */

enum fovea_status fv_calibration_format_text(enum fv_calibration_format format,
                                             const struct fv_calibration *calibration,
                                             char text[FV_CALIBRATION_BYTES_MAX],
                                             struct fovea_error *lost, struct fovea_error *error)
{
    const enum fovea_status status = refuse_lossy(format, &calibration->camera, error);
    if (status != FOVEA_OK) return status;
    const locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (c == (locale_t)0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "locale \"C\": %s", strerror(errno));
    const locale_t before = uselocale(c);
    struct writer writer = {.text = text};
    switch (format) {
    case FV_CALIBRATION_ROS:
        write_ros(&writer, calibration, false);
        break;
    case FV_CALIBRATION_ROS_MESSAGE:
        write_ros(&writer, calibration, true);
        break;
    case FV_CALIBRATION_OPENCV:
        write_opencv(&writer, calibration);
        break;
    case FV_CALIBRATION_KALIBR:
        write_kalibr(&writer, calibration);
        break;
    default:
        write_euroc(&writer, calibration);
        break;
    }
    uselocale(before);
    freelocale(c);
    name_lost(format, calibration, lost);
    return FOVEA_OK;
}

enum fovea_status fv_calibration_write(const char *path, enum fv_calibration_format format,
                                       const struct fv_calibration *calibration,
                                       struct fovea_error *lost, struct fovea_error *error)
{
    char text[FV_CALIBRATION_BYTES_MAX];
    struct fv_output output;
    enum fovea_status status = fv_calibration_format_text(format, calibration, text, lost, error);
    if (status != FOVEA_OK) return status;
    status = fv_output_open(&output, path, FV_OUTPUT_WHOLE, error);
    if (status != FOVEA_OK)
        return strlen(path) < FV_OUTPUT_PATH_BYTES ? FOVEA_ERROR_SYSTEM : status;
    FILE *stream = fv_output_stream(&output);
    if (stream != NULL) (void)fputs(text, stream); /* a failure shows when it is closed */
    if (stream != NULL) return fv_output_close(&output, error);
    fv_output_discard(&output);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: cannot be written: out of memory",
                           path);
}
