#include "support/calibration_writer.h"

#include <errno.h>
#include <locale.h>
#include <stdio.h>
#include <string.h>

#include "support/calibration_reader.h"
#include "support/output.h"

static const char *const format_names[FV_CALIBRATION_FORMAT_COUNT] = {
    "ros", "ros-message", "opencv", "kalibr", "euroc", "orb-slam3", "basalt", "photonvision"};

const char *fv_calibration_format_name(enum fv_calibration_format format)
{
    return (unsigned)format < FV_CALIBRATION_FORMAT_COUNT ? format_names[format] : NULL;
}

/* ---- the formats ----------------------------------------------------------------------------- */

static const char *ros_model(const struct fovea_camera *camera)
{
    if (camera->lens == FOVEA_LENS_EQUIDISTANT) return "equidistant";
    return fv_calibration_coefficient_count(camera, 5) == 8 ? "rational_polynomial" : "plumb_bob";
}

static void write_ros(struct fv_calibration_writer *w, const struct fv_calibration *c, bool message)
{
    const struct fovea_camera *m = &c->camera;
    const double K[9] = {m->fx, 0, m->cx, 0, m->fy, m->cy, 0, 0, 1},
                 R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const double P[12] = {m->fx, 0, m->cx, 0, 0, m->fy, m->cy, 0, 0, 0, 1, 0};
    const size_t count = fv_calibration_coefficient_count(m, 5);
    if (message) {
        fv_calibration_put(w, "height: %d\nwidth: %d\ndistortion_model: %s\n", m->height, m->width,
                           ros_model(m));
        fv_calibration_put_list(w, "D", m->k, count);
        fv_calibration_put_list(w, "K", K, 9);
        fv_calibration_put_list(w, "R", R, 9);
        fv_calibration_put_list(w, "P", P, 12);
        return;
    }
    fv_calibration_put(w, "image_width: %d\nimage_height: %d\n", m->width, m->height);
    if (c->name[0] != '\0') fv_calibration_put_text(w, "camera_name", c->name);
    fv_calibration_put_matrix(w, "camera_matrix", false, 3, 3, K);
    fv_calibration_put(w, "distortion_model: %s\n", ros_model(m));
    fv_calibration_put_matrix(w, "distortion_coefficients", false, 1, (int)count, m->k);
    fv_calibration_put_matrix(w, "rectification_matrix", false, 3, 3, R);
    fv_calibration_put_matrix(w, "projection_matrix", false, 3, 4, P);
    if (c->record.program[0] != '\0') fv_calibration_put_record(w, 0, c, false);
}

static void write_opencv(struct fv_calibration_writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const double K[9] = {m->fx, 0, m->cx, 0, m->fy, m->cy, 0, 0, 1};
    fv_calibration_put(w, "%%YAML:1.0\n---\nimage_width: %d\nimage_height: %d\n", m->width,
                       m->height);
    fv_calibration_put(w, "fisheye_model: %d\n", m->lens == FOVEA_LENS_EQUIDISTANT);
    fv_calibration_put_matrix(w, "camera_matrix", true, 3, 3, K);
    fv_calibration_put_matrix(w, "distortion_coefficients", true,
                              (int)fv_calibration_coefficient_count(m, 5), 1, m->k);
    fv_calibration_put_record(w, 0, c, true);
}

/* Names that can stand as the key of a camchain: cam0, cam1, ... */
static bool is_chain_key(const char *name)
{
    return strncmp(name, "cam", 3) == 0 && name[3] != '\0' &&
           strspn(name + 3, "0123456789") == strlen(name + 3);
}

static void put_rows(struct fv_calibration_writer *w, const char *key, const double T[12])
{
    fv_calibration_put(w, "  %s:\n", key);
    for (int i = 0; i < 4; i++) {
        static const double last[4] = {0, 0, 0, 1};
        fv_calibration_put(w, "  - [");
        fv_calibration_put_numbers(w, i < 3 ? T + 4 * i : last, 4);
        fv_calibration_put(w, "]\n");
    }
}

static void write_kalibr_lens(struct fv_calibration_writer *w, const struct fovea_camera *m)
{
    const double intrinsics[4] = {m->fx, m->fy, m->cx, m->cy};
    fv_calibration_put(w, "  camera_model: pinhole\n");
    fv_calibration_put_list(w, "  intrinsics", intrinsics, 4);
    fv_calibration_put(w, "  distortion_model: %s\n",
                       m->lens == FOVEA_LENS_EQUIDISTANT ? "equidistant" : "radtan");
    fv_calibration_put_list(w, "  distortion_coeffs", m->k, fv_calibration_coefficient_count(m, 4));
    fv_calibration_put(w, "  resolution: [%d, %d]\n", m->width, m->height);
}

static void write_kalibr_rest(struct fv_calibration_writer *w, const struct fv_calibration *c,
                              bool named)
{
    if (c->has_time_shift) {
        fv_calibration_put(w, "  timeshift_cam_imu: ");
        fv_calibration_put_numbers(w, &c->time_shift_s, 1);
        fv_calibration_put(w, "\n");
    }
    fv_calibration_put_record(w, 2, c, named);
}

static void write_kalibr(struct fv_calibration_writer *w, const struct fv_calibration *c)
{
    fv_calibration_put(w, "%s:\n", is_chain_key(c->name) ? c->name : "cam0");
    if (c->has_T_body_cam) {
        double T_cam_imu[12];
        fv_calibration_invert(c->T_body_cam, T_cam_imu);
        put_rows(w, "T_cam_imu", T_cam_imu);
    }
    write_kalibr_lens(w, &c->camera);
    write_kalibr_rest(w, c, !is_chain_key(c->name));
}

static void write_euroc(struct fv_calibration_writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const double intrinsics[4] = {m->fx, m->fy, m->cx, m->cy};
    fv_calibration_put(w, "sensor_type: camera\n");
    if (c->has_T_body_cam) {
        fv_calibration_put(w, "T_BS:\n  rows: 4\n  cols: 4\n  data: [");
        fv_calibration_put_numbers(w, c->T_body_cam, 12);
        fv_calibration_put(w, ", 0.0, 0.0, 0.0, 1.0]\n");
    }
    if (c->rate_hz > 0) {
        fv_calibration_put(w, "rate_hz: ");
        fv_calibration_put_numbers(w, &c->rate_hz, 1);
        fv_calibration_put(w, "\n");
    }
    fv_calibration_put(w, "resolution: [%d, %d]\ncamera_model: pinhole\n", m->width, m->height);
    fv_calibration_put_list(w, "intrinsics", intrinsics, 4);
    fv_calibration_put(w, "distortion_model: %s\n",
                       m->lens == FOVEA_LENS_EQUIDISTANT ? "equidistant" : "radial-tangential");
    fv_calibration_put_list(w, "distortion_coefficients", m->k, 4);
    fv_calibration_put_record(w, 0, c, true);
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
    if (camera->lens == FOVEA_LENS_EQUIDISTANT)
        return format != FV_CALIBRATION_PHOTONVISION
                   ? FOVEA_OK
                   : fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                                     "lens: found equidistant, expected radtan or rational: the "
                                     "format %s holds no other",
                                     name);
    const bool four = format == FV_CALIBRATION_KALIBR || format == FV_CALIBRATION_EUROC;
    const int held = four ? 4 : format == FV_CALIBRATION_ORBSLAM3 ? 5 : 8;
    for (int i = held; i < 8; i++)
        if (camera->k[i] != 0)
            return fovea_error_set(
                error, FOVEA_ERROR_UNSUPPORTED,
                "%s: found %.9g, expected 0: the format %s holds k1 k2 p1 p2%s and it would be lost",
                names[i - 4], camera->k[i], name, four ? "" : " k3");
    return FOVEA_OK;
}

static void name_lost(enum fv_calibration_format format, const struct fv_calibration *c,
                      struct fovea_error *lost)
{
    const bool basalt = format == FV_CALIBRATION_BASALT, orb = format == FV_CALIBRATION_ORBSLAM3,
               kalibr = format == FV_CALIBRATION_KALIBR, euroc = format == FV_CALIBRATION_EUROC;
    const bool message = format == FV_CALIBRATION_ROS_MESSAGE;
    const bool transform = c->has_T_body_cam && !kalibr && !euroc && !orb && !basalt;
    const bool rate = c->rate_hz > 0 && !euroc && !(orb && fv_calibration_whole_rate(c));
    const bool shift = c->has_time_shift && c->time_shift_s != 0 && !kalibr && !basalt;
    const bool name = c->name[0] != '\0' && message;
    const bool record = c->record.program[0] != '\0' && message;
    if (lost == NULL) return;
    if (!transform && !rate && !shift && !name && !record) {
        fovea_error_set(lost, FOVEA_OK, "%s", "");
        return;
    }
    fovea_error_set(lost, FOVEA_OK, "the format %s has no place for:%s%s%s%s%s",
                    fv_calibration_format_name(format), transform ? " T_body_cam" : "",
                    rate ? " rate_hz" : "", shift ? " time_shift_s" : "", name ? " name" : "",
                    record ? " date, errors and standard deviations" : "");
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
    struct fv_calibration_writer writer = {.text = text,
                                           .json = format == FV_CALIBRATION_BASALT ||
                                                   format == FV_CALIBRATION_PHOTONVISION};
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
    case FV_CALIBRATION_ORBSLAM3:
        fv_calibration_write_orbslam3(&writer, calibration);
        break;
    case FV_CALIBRATION_BASALT:
        fv_calibration_write_basalt(&writer, calibration);
        break;
    case FV_CALIBRATION_PHOTONVISION:
        fv_calibration_write_photonvision(&writer, calibration);
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

/* T_cn_cnm1: from the camera before this one. */
static void chain_step(const struct fv_calibration *before, const struct fv_calibration *c,
                       double T[12])
{
    double T_cam_body[12];
    fv_calibration_invert(c->T_body_cam, T_cam_body);
    fv_calibration_multiply(T_cam_body, before->T_body_cam, T);
}

enum fovea_status fv_calibration_chain_text(const struct fv_calibration *cameras, size_t count,
                                            bool of_imu, bool kalibr,
                                            char text[FV_CALIBRATION_CHAIN_BYTES_MAX],
                                            struct fovea_error *error)
{
    size_t used = 0;
    for (size_t i = 0; i < count; i++) {
        const struct fv_calibration *c = &cameras[i];
        const enum fovea_status status =
            refuse_lossy(kalibr ? FV_CALIBRATION_KALIBR : FV_CALIBRATION_ROS, &c->camera, error);
        if (status != FOVEA_OK) return status;
    }
    const locale_t c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (c_locale == (locale_t)0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "locale \"C\": %s", strerror(errno));
    const locale_t before = uselocale(c_locale);
    for (size_t i = 0; i < count; i++) {
        const struct fv_calibration *c = &cameras[i];
        struct fv_calibration_writer w = {.text = text + used};
        double T[12];
        fv_calibration_put(&w, "cam%zu:\n", i);
        if (of_imu) {
            fv_calibration_invert(c->T_body_cam, T);
            put_rows(&w, "T_cam_imu", T);
        }
        if (i > 0) {
            chain_step(&cameras[i - 1], c, T);
            put_rows(&w, "T_cn_cnm1", T);
        }
        write_kalibr_lens(&w, &c->camera);
        write_kalibr_rest(&w, c, true);
        used += w.used;
    }
    uselocale(before);
    freelocale(c_locale);
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
