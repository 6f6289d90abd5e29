/* Calibration files: every format read, written and read again without loss. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/calibration_case.h"
#include "common/data_folder.h"
#include "common/datasets.h"
#include "support/calibration.h"
#include "base/elementary.h"

static struct fv_calibration parse(const char *text)
{
    struct fv_calibration calibration;
    struct fovea_error error = {.text = ""};
    if (fv_calibration_parse("c.yaml", text, strlen(text), NULL, &calibration, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return calibration;
}

/* ---- formats --------------------------------------------------------------------------------- */

static void test_ros(void **state)
{
    (void)state;
    struct fv_calibration c = parse(
        "image_width: 640\nimage_height: 480\ncamera_name: head\n"
        "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [585.5, 0, 320, 0, 586, 240, 0, 0, 1]\n"
        "distortion_model: plumb_bob\n"
        "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, -0.2, 0.003, 0.004, 0.05]\n"
        "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n");
    assert_int_equal(c.format, FV_CALIBRATION_ROS);
    assert_int_equal(c.camera.width, 640);
    assert_int_equal(c.camera.height, 480);
    assert_int_equal(c.camera.lens, FOVEA_LENS_RADTAN);
    assert_true(c.camera.fx == 585.5 && c.camera.fy == 586 && c.camera.cx == 320 &&
                c.camera.cy == 240);
    assert_true(c.camera.k[0] == 0.1 && c.camera.k[2] == 0.003 && c.camera.k[4] == 0.05 &&
                c.camera.k[5] == 0);
    assert_true(c.camera.field_max_rad > 0.3);
    assert_string_equal(c.name, "head");
    c = parse(
        "height: 480\nwidth: 640\ndistortion_model: rational_polynomial\nD: [1, 2, 3e-3, 4e-3, 5, 6, 7, 8]\n"
        "K: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nbinning_x: 0\nroi: {x_offset: 0, y_offset: 0}\n");
    assert_int_equal(c.format, FV_CALIBRATION_ROS_MESSAGE);
    assert_true(c.camera.k[5] == 6 && c.camera.k[7] == 8);
    c = parse(
        "height: 480\nwidth: 640\ndistortion_model: equidistant\nd:\n- 0.1\n- 0.2\n- 0.0\n- 0.0\n"
        "k:\n- 300\n- 0\n- 320\n- 0\n- 300\n- 240\n- 0\n- 0\n- 1\n---\n");
    assert_int_equal(c.camera.lens, FOVEA_LENS_EQUIDISTANT);
    assert_true(c.camera.k[1] == 0.2);
}

static void test_opencv(void **state)
{
    (void)state;
    struct fv_calibration c = parse(
        "%YAML:1.0\n---\ncalibration_time: \"Thu 1 Jan\"\nimage_width: 640\nimage_height: 480\n"
        "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
        "   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,\n"
        "       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]\n"
        "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n"
        "   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,\n"
        "       1.7831947042852964e-03, -2.8122100441115472e-04, 2.3839153080878486e-01 ]\n");
    assert_int_equal(c.format, FV_CALIBRATION_OPENCV);
    assert_true(c.camera.fx == 535.91573396163199 && c.camera.k[4] == 0.23839153080878486);
    c = parse(
        "cameraMatrix: [[300, 0, 100], [0, 301, 101], [0, 0, 1]]\ndistCoeffs: [[0.1, 0.2, 0, 0]]\n"
        "fisheye_model: 1\n"); /* no size stated */
    assert_int_equal(c.camera.width, 0);
    assert_int_equal(c.camera.lens, FOVEA_LENS_EQUIDISTANT);
    c = parse(
        "K: [300, 0, 100, 0, 301, 101, 0, 0, 1]\nD: [0.1, 0.2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n");
    assert_true(c.camera.k[1] == 0.2);
}

static const char camchain[] =
    "cam0:\n  T_cam_imu:\n  - [0.0, -1.0, 0.0, 0.1]\n  - [0.0, 0.0, -1.0, 0.2]\n  - [1.0, 0.0, 0.0, 0.3]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [1]\n  camera_model: pinhole\n"
    "  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]\n  distortion_model: equidistant\n"
    "  intrinsics: [190.9, 190.8, 254.9, 256.8]\n  resolution: [512, 513]\n  rostopic: /cam0/image_raw\n"
    "cam1:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.001, 0.002]\n  distortion_model: radtan\n"
    "  intrinsics: [200, 201, 250, 251]\n  resolution: [512, 512]\n";

static void test_kalibr(void **state)
{
    (void)state;
    struct fv_calibration c = parse(camchain);
    assert_int_equal(c.format, FV_CALIBRATION_KALIBR);
    assert_string_equal(c.name, "cam0");
    assert_int_equal(c.camera.lens, FOVEA_LENS_EQUIDISTANT);
    assert_int_equal(c.camera.height, 513);
    assert_true(c.has_T_body_cam);
    /* T_body_cam takes the camera's centre to -R^T t. */
    assert_true(fabs(c.T_body_cam[3] + 0.3) < 1e-15 && fabs(c.T_body_cam[7] - 0.1) < 1e-15 &&
                fabs(c.T_body_cam[11] - 0.2) < 1e-15);
    struct fovea_error error;
    assert_int_equal(
        fv_calibration_parse("c.yaml", camchain, sizeof camchain - 1, "cam1", &c, &error),
        FOVEA_OK);
    assert_true(c.camera.fx == 200 && !c.has_T_body_cam);
    assert_int_equal(
        fv_calibration_parse("c.yaml", camchain, sizeof camchain - 1, "cam2", &c, &error),
        FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "expected 'cam2'"));
}

static void test_euroc(void **state)
{
    (void)state;
    struct fv_calibration c = parse(
        "sensor_type: camera\ncomment: VI-Sensor cam0 (MT9M034)\nT_BS:\n  cols: 4\n  rows: 4\n"
        "  data: [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,\n"
        "         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,\n"
        "        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,\n"
        "         0.0, 0.0, 0.0, 1.0]\nrate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\n"
        "intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n"
        "distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]\n");
    assert_int_equal(c.format, FV_CALIBRATION_EUROC);
    assert_true(c.rate_hz == 20 && c.camera.k[3] == 1.76187114e-05 &&
                c.T_body_cam[7] == -0.064676986768);
}

#define SIMPLE                                                                                     \
    "image_width: 640\nimage_height: 480\n"                                                        \
    "camera_matrix: {data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}\ndistortion_model: plumb_bob\n"    \
    "distortion_coefficients: {data: [0.1, -0.1, 0.001, 0.002]}\n"

/* As ORB-SLAM3's example for EuRoC states it. */
static const char orbslam3[] =
    "%YAML:1.0\n\n#---\nFile.version: \"1.0\"\nCamera.type: \"PinHole\"\n"
    "Camera1.fx: 458.654\nCamera1.fy: 457.296\nCamera1.cx: 367.215\nCamera1.cy: 248.375\n"
    "Camera1.k1: -0.28340811\nCamera1.k2: 0.07395907\nCamera1.p1: 0.00019359\n"
    "Camera1.p2: 1.76187114e-05\nCamera2.fx: 457.587\nCamera2.fy: 456.134\n"
    "Camera2.cx: 379.999\nCamera2.cy: 255.238\nCamera2.k1: -0.28368365\n"
    "Camera2.k2: 0.07451284\nCamera2.p1: -0.00010473\nCamera2.p2: -3.55590700e-05\n"
    "Camera.width: 752\nCamera.height: 480\nCamera.newWidth: 600\nCamera.fps: 20\nCamera.RGB: 1\n"
    "Stereo.T_c1_c2: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n"
    "  data: [1,0,0,0.11, 0,1,0,0, 0,0,1,0, 0,0,0,1.000]\n"
    "IMU.T_b_c1: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n"
    "   data: [0, -1, 0, -0.02, 1, 0, 0, -0.06, 0, 0, 1, 0.01, 0, 0, 0, 1]\n"
    "ORBextractor.nFeatures: 1200\n";

static void test_orbslam3(void **state)
{
    (void)state;
    struct fv_calibration c = parse(orbslam3);
    struct fovea_error error = {.text = ""};
    assert_int_equal(c.format, FV_CALIBRATION_ORBSLAM3);
    assert_true(c.camera.fx == 458.654 && c.camera.k[3] == 1.76187114e-05 && c.camera.k[4] == 0);
    assert_true(c.rate_hz == 20 && c.camera.width == 752 && c.T_body_cam[7] == -0.06);
    if (fv_calibration_parse("c.yaml", orbslam3, sizeof orbslam3 - 1, "cam1", &c, &error) !=
        FOVEA_OK)
        fail_msg("%s", error.text);
    /* 0.11 along the first camera's x, which is the body's y. */
    assert_true(c.camera.fx == 457.587 && fabs(c.T_body_cam[7] - 0.05) < 1e-15);
    c = parse("Camera.type: \"KannalaBrandt8\"\nCamera.fx: 190\nCamera.fy: 191\nCamera.cx: 254\n"
              "Camera.cy: 256\nCamera.k1: 0.1\nCamera.k2: 0.2\nCamera.k3: 0.3\nCamera.k4: 0.4\n");
    assert_true(c.camera.lens == FOVEA_LENS_EQUIDISTANT && c.camera.k[3] == 0.4);
}

static const char basalt[] =
    "{\n  \"value0\": {\n    \"T_imu_cam\": [\n"
    "      {\"px\": 0.1, \"py\": 0.2, \"pz\": 0.3, \"qx\": 0, \"qy\": 0, \"qz\": 1, \"qw\": 0},\n"
    "      {\"px\": -0.1, \"py\": 0, \"pz\": 0, \"qx\": 0.6, \"qy\": 0, \"qz\": 0, \"qw\": 0.8}],\n"
    "    \"intrinsics\": [\n"
    "      {\"camera_type\": \"kb4\", \"intrinsics\": {\"fx\": 379, \"fy\": 378, \"cx\": 505,\n"
    "        \"cy\": 509, \"k1\": 0.01, \"k2\": -0.02, \"k3\": 0.03, \"k4\": -0.004}},\n"
    "      {\"camera_type\": \"pinhole-radtan8\", \"intrinsics\": {\"fx\": 400, \"fy\": 401,\n"
    "        \"cx\": 320, \"cy\": 240, \"k1\": 1, \"k2\": 2, \"p1\": 0.003, \"p2\": 0.004,\n"
    "        \"k3\": 5, \"k4\": 6, \"k5\": 7, \"k6\": 8, \"rpmax\": 2.7}},\n"
    "      {\"camera_type\": \"ds\", \"intrinsics\": {\"fx\": 400}}],\n"
    "    \"resolution\": [[1024, 1024], [640, 480], [640, 480]],\n"
    "    \"calib_accel_bias\": [0, 0, 0], \"cam_time_offset_ns\": -2500000\n  }\n}\n";

static void test_basalt(void **state)
{
    (void)state;
    struct fv_calibration c = parse(basalt);
    struct fovea_error error = {.text = ""};
    assert_int_equal(c.format, FV_CALIBRATION_BASALT);
    assert_true(c.camera.lens == FOVEA_LENS_EQUIDISTANT && c.camera.k[3] == -0.004);
    assert_true(c.camera.width == 1024 && c.has_time_shift && c.time_shift_s == -0.0025);
    assert_true(c.T_body_cam[0] == -1 && c.T_body_cam[10] == 1 && c.T_body_cam[11] == 0.3);
    assert_int_equal(fv_calibration_parse("c", basalt, sizeof basalt - 1, "cam1", &c, &error),
                     FOVEA_OK);
    assert_true(c.camera.k[2] == 0.003 && c.camera.k[7] == 8 && c.camera.height == 480);
    assert_true(fabs(c.T_body_cam[5] - 0.28) < 1e-15 && fabs(c.T_body_cam[9] - 0.96) < 1e-15);
    assert_int_equal(fv_calibration_parse("c", basalt, sizeof basalt - 1, "cam2", &c, &error),
                     FOVEA_ERROR_UNSUPPORTED);
    assert_string_equal(error.text,
                        "c:12: value0.intrinsics[2].camera_type: found the text 'ds', expected "
                        "one of pinhole, pinhole-radtan8, kb4");
    assert_int_equal(fv_calibration_parse("c", basalt, sizeof basalt - 1, "cam3", &c, &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(error.text, "c:6: found 3 cameras, expected 'cam3' among cam0 to cam2");
}

#define PHOTON_REST "\"calobjectWarp\": [1e-4, -2e-5], \"observations\": []"

static void test_photonvision(void **state)
{
    (void)state;
    struct fv_calibration c =
        parse("{" PHOTON_SIZE ", " PHOTON_MATRIX ", \"distCoeffs\": {\"rows\": 1, \"cols\": 8, "
              "\"type\": 6, \"data\": [1, 2, 0.003, 0.004, 5, 6, 7, 8]}, " PHOTON_REST
              ", \"lensmodel\": \"LENSMODEL_OPENCV\"}");
    assert_int_equal(c.format, FV_CALIBRATION_PHOTONVISION);
    assert_true(c.camera.width == 1280 && c.camera.fx == 900.5 && c.camera.k[7] == 8);
    c = parse("{" PHOTON_SIZE ", " PHOTON_MATRIX
              ", \"cameraExtrinsics\": {\"rows\": 1, \"cols\": 5, "
              "\"data\": [0.1, 0.2, 0, 0, 0.3]}}"); /* as older versions wrote it */
    assert_true(c.camera.k[4] == 0.3);
}

static void give_record(struct fv_calibration *c)
{
    struct fv_calibration_record *r = &c->record;
    snprintf(r->program, sizeof r->program, "fovea-calibrate 0.2.0");
    snprintf(r->date, sizeof r->date, "2026-01-02T03:04:05Z");
    snprintf(r->verdict, sizeof r->verdict, "doubtful");
    snprintf(r->camera_id, sizeof r->camera_id, "v4l2:/dev/v4l/by-id/a \"b\"\\c\n-index0");
    snprintf(r->board, sizeof r->board, "chessboard:9x6:0.025");
    r->views = 20;
    r->corners = 1080;
    r->rms_px = 0.21;
    r->noise_px = 0.15;
    r->held_out_rms_px = 0.23;
    r->projection_stdev_px = 0.4;
    for (int i = 0; i < (c->camera.lens == FOVEA_LENS_EQUIDISTANT ? 8 : 9); i++)
        r->stdev[i] = 0.5 * (i + 1);
}

/* Date, camera, errors and deviations pass through every format that may hold further keys. */
static void test_record(void **state)
{
    (void)state;
    for (int lens = 0; lens < 2; lens++) {
        for (int format = 0; format < FV_CALIBRATION_FORMAT_COUNT; format++) {
            struct fv_calibration c = parse(SIMPLE), again;
            char text[FV_CALIBRATION_BYTES_MAX];
            struct fovea_error error = {.text = ""}, lost;
            c.camera.lens = lens == 0 ? FOVEA_LENS_RADTAN : FOVEA_LENS_EQUIDISTANT;
            snprintf(c.name, sizeof c.name, "left eye");
            give_record(&c);
            if (lens == 1 && format == FV_CALIBRATION_PHOTONVISION) continue;
            if (fv_calibration_format_text((enum fv_calibration_format)format, &c, text, &lost,
                                           &error) != FOVEA_OK)
                fail_msg("%s", error.text);
            again = parse(text);
            if (format == FV_CALIBRATION_ROS_MESSAGE) {
                assert_string_equal(lost.text, "the format ros-message has no place for: name date,"
                                               " errors and standard deviations");
                continue;
            }
            assert_string_equal(lost.text, "");
            assert_string_equal(again.name, "left eye");
            assert_memory_equal(&again.record, &c.record, sizeof c.record);
        }
    }
    refused(FOVEA_ERROR_INPUT, SIMPLE "calibration:\n  program: fovea-calibrate\n  rms_px: -1\n",
            "c.yaml:8: calibration.rms_px: found '-1', expected a number in [0, 1e+12]");
    /* The same key in the file of another program means something else. */
    assert_string_equal(parse(SIMPLE "calibration:\n  date: [1]\n").record.date, "");
}

/* The place of the camera and the shift of its clock pass through the formats of rigs with an
 * IMU. */
static void test_place_and_shift(void **state)
{
    (void)state;
    static const enum fv_calibration_format formats[] = {
        FV_CALIBRATION_KALIBR, FV_CALIBRATION_EUROC, FV_CALIBRATION_ORBSLAM3,
        FV_CALIBRATION_BASALT};
    static const double turns[4][4] = {
        {0.1, 0.2, 0.3, 0.9}, {0.9, 0.1, -0.2, 0.3}, {0.1, -0.9, 0.3, 0.2}, {0.2, 0.3, 0.9, -0.1}};
    for (int turn = 0; turn < 4; turn++) {
        for (int i = 0; i < 4; i++) {
            struct fv_calibration c = parse(SIMPLE), again;
            char text[FV_CALIBRATION_BYTES_MAX];
            struct fovea_error error = {.text = ""}, lost;
            double n = 0, q[4];
            for (int j = 0; j < 4; j++)
                n += turns[turn][j] * turns[turn][j];
            for (int j = 0; j < 4; j++)
                q[j] = turns[turn][j] / sqrt(n);
            const double x = q[0], y = q[1], z = q[2], w = q[3];
            const double T[12] = {
                1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),     1,
                2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),     2,
                2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y), 3};
            memcpy(c.T_body_cam, T, sizeof T);
            c.has_T_body_cam = c.has_time_shift = true;
            c.time_shift_s = 0.0025;
            c.rate_hz = 20;
            assert_int_equal(fv_calibration_format_text(formats[i], &c, text, &lost, &error),
                             FOVEA_OK);
            again = parse(text);
            assert_true(again.has_T_body_cam);
            for (int j = 0; j < 12; j++)
                assert_true(fabs(again.T_body_cam[j] - T[j]) < 1e-14);
            const bool shift = i == 0 || i == 3, rate = i == 1 || i == 2;
            assert_int_equal(again.has_time_shift, shift);
            assert_true(again.time_shift_s == (shift ? 0.0025 : 0));
            assert_true(again.rate_hz == (rate ? 20 : 0));
            assert_int_equal(strstr(lost.text, "time_shift_s") == NULL, shift);
            assert_int_equal(strstr(lost.text, "rate_hz") == NULL, rate);
        }
    }
}

/* ---- round trip ------------------------------------------------------------------------------ */

static void random_camera(struct fv_random *random, enum fovea_lens lens, int coefficients,
                          struct fv_calibration *c)
{
    memset(c, 0, sizeof *c);
    struct fovea_camera *m = &c->camera;
    m->width = 752;
    m->height = 480;
    m->lens = lens;
    m->fx = 400 + 100 * fv_random_unit(random);
    m->fy = 400 + 100 * fv_random_unit(random);
    m->cx = 370 + 10 * fv_random_unit(random);
    m->cy = 235 + 10 * fv_random_unit(random);
    for (int i = 0; i < coefficients; i++)
        m->k[i] = (fv_random_unit(random) - 0.5) * (i == 2 || i == 3 ? 0.01 : 0.2);
    snprintf(c->name, sizeof c->name, "cam0");
    struct fovea_error error = {.text = ""};
    if (fovea_camera_prepare(m, &error) != FOVEA_OK) fail_msg("%s", error.text);
}

static double worst_projection(const struct fovea_camera *a, const struct fovea_camera *b)
{
    double worst = 0.0;
    for (int y = -5; y <= 5; y++) {
        for (int x = -5; x <= 5; x++) {
            const double point[3] = {0.15 * x, 0.1 * y, 1.0};
            double p[2], q[2];
            const enum fovea_status one = fovea_camera_project(a, point, p, NULL);
            assert_int_equal(one, fovea_camera_project(b, point, q, NULL));
            if (one != FOVEA_OK) continue;
            for (int i = 0; i < 2; i++)
                worst = fmax(worst, fabs(p[i] - q[i]));
        }
    }
    return worst;
}

static void test_round_trip(void **state)
{
    (void)state;
    static const int counts[] = {0, 2, 4, 5, 8};
    struct fv_random random;
    fv_random_seed(&random, 5);
    double worst = 0.0;
    int written = 0, unsupported = 0;
    setlocale(LC_ALL, "de_DE.UTF-8"); /* where installed: a comma must not get in */
    for (int round = 0; round < 40; round++) {
        for (int format = 0; format < FV_CALIBRATION_FORMAT_COUNT; format++) {
            struct fv_calibration c, again;
            char text[FV_CALIBRATION_BYTES_MAX];
            struct fovea_error error = {.text = ""}, lost;
            const bool fisheye = round % 2 == 1;
            random_camera(&random, fisheye ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN,
                          fisheye ? 4 : counts[round / 2 % 5], &c);
            const bool four = format == FV_CALIBRATION_KALIBR || format == FV_CALIBRATION_EUROC;
            const bool refuses =
                fisheye ? format == FV_CALIBRATION_PHOTONVISION
                        : (four && c.camera.k[4] != 0) ||
                              (format == FV_CALIBRATION_ORBSLAM3 && c.camera.k[5] != 0);
            const enum fovea_status status = fv_calibration_format_text(
                (enum fv_calibration_format)format, &c, text, &lost, &error);
            if (refuses) { /* it says what would be lost */
                assert_int_equal(status, FOVEA_ERROR_UNSUPPORTED);
                assert_memory_equal(error.text,
                                    fisheye ? "lens: found "
                                    : four  ? "k3: found "
                                            : "k4: found ",
                                    10);
                ++unsupported;
                continue;
            }
            assert_int_equal(status, FOVEA_OK);
            again = parse(text);
            assert_int_equal(again.format, format);
            assert_int_equal(again.camera.width, 752);
            assert_int_equal(again.camera.height, 480);
            assert_int_equal(again.camera.lens, c.camera.lens);
            worst = fmax(worst, worst_projection(&c.camera, &again.camera));
            assert_memory_equal(again.camera.k, c.camera.k, sizeof c.camera.k);
            ++written;
        }
    }
    setlocale(LC_ALL, "C");
    assert_true(worst == 0.0); /* all bits are kept: better than the 1e-9 px asked for */
    assert_true(written > 270 && unsupported >= 40);
}

static void test_write_file_and_lost(void **state)
{
    (void)state;
    char folder[FV_TEST_PATH_BYTES];
    struct fv_calibration c = parse(camchain), again;
    struct fovea_error lost = {.text = "?"}, error = {.text = ""};
    fv_test_folder(folder);
    const char *path = fv_test_path(folder, "c.yaml");
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_KALIBR, &c, &lost, &error),
                     FOVEA_OK);
    assert_string_equal(lost.text, "");
    assert_int_equal(fv_calibration_read(path, NULL, &again, &error), FOVEA_OK);
    for (int i = 0; i < 12; i++)
        assert_true(fabs(again.T_body_cam[i] - c.T_body_cam[i]) < 1e-15);
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_OPENCV, &c, &lost, &error),
                     FOVEA_OK);
    assert_string_equal(lost.text, "the format opencv has no place for: T_body_cam");
    c.camera.width = 0;
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_ROS, &c, &lost, &error),
                     FOVEA_ERROR_UNSUPPORTED);
    assert_int_equal(fv_calibration_read(path, NULL, &again, &error),
                     FOVEA_OK); /* the old file stands */
    assert_int_equal(again.format, FV_CALIBRATION_OPENCV);
    c.camera.width = 512;
    snprintf(c.name, sizeof c.name, "it's \"odd\": \\ # \n");
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_ROS, &c, &lost, &error), FOVEA_OK);
    assert_int_equal(fv_calibration_read(path, NULL, &again, &error), FOVEA_OK);
    assert_string_equal(again.name, c.name);
    assert_int_equal(fv_calibration_write(fv_test_path(folder, "no/such/c.yaml"),
                                          FV_CALIBRATION_ROS, &c, &lost, &error),
                     FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "cannot be written"));
    /* A device takes the text and stays what it is; here by a link, which stays as well. */
    struct stat there;
    const char *device = fv_test_path(folder, "device.yaml");
    assert_int_equal(symlink("/dev/full", device), 0);
    assert_int_equal(fv_calibration_write(device, FV_CALIBRATION_ROS, &c, &lost, &error),
                     FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "device.yaml: cannot be written: No space left"));
    assert_true(lstat(device, &there) == 0 && S_ISLNK(there.st_mode));
    fv_test_folder_remove(folder);
}

/* ---- fitting --------------------------------------------------------------------------------- */

static void test_fit(void **state)
{
    (void)state;
    struct fv_calibration c =
        parse("cameraMatrix: [300, 0, 319.5, 0, 300, 239.5, 0, 0, 1]\ndistCoeffs: []\n");
    struct fovea_error error = {.text = ""};
    struct fovea_camera camera = c.camera;
    assert_int_equal(fv_calibration_fit(&camera, 640, 480, false, "c.yaml", &error), FOVEA_OK);
    assert_int_equal(camera.width, 640);
    assert_int_equal(fv_calibration_fit(&camera, 640, 480, false, "c.yaml", &error), FOVEA_OK);
    assert_int_equal(fv_calibration_fit(&camera, 320, 240, false, "c.yaml", &error),
                     FOVEA_ERROR_INPUT);
    assert_string_equal(
        error.text, "c.yaml: image size: found 640 x 480, expected 320 x 240 as the frames have");
    assert_int_equal(camera.width, 640);
    assert_int_equal(fv_calibration_fit(&camera, 320, 240, true, "c.yaml", &error), FOVEA_OK);
    /* The centre of the image stays its centre, with pixel centres at whole numbers. */
    assert_true(camera.fx == 150 && camera.cx == 159.5 && camera.cy == 119.5);
    assert_int_equal(fv_calibration_fit(&camera, 320, 200, true, "c.yaml", &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "expected the shape of the frames"));
}

/* ---- published files ----------------------------------------------------------------------------
 */

static void test_published_files(void **state)
{
    (void)state;
    static const struct {
        const char *file;
        double fx;
    } files[] = {{"euroc_mh05_a/mav0/cam0/sensor.yaml", 458.654},
                 {"handheld_7scenes_a/camera.yaml", 585.0},
                 {"calib_stereo_pinhole/left_intrinsics_published.yml", 535.91573396163199}};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        const char *path = fv_test_path(fv_data_folder(), files[i].file);
        struct fv_calibration calibration;
        struct fovea_error error;
        if (access(path, R_OK) != 0) {
            print_message("SKIPPED %s: not there\n", files[i].file);
            continue;
        }
        if (fv_calibration_read(path, NULL, &calibration, &error) != FOVEA_OK)
            fail_msg("%s", error.text);
        assert_true(calibration.camera.fx == files[i].fx);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ros),
        cmocka_unit_test(test_opencv),
        cmocka_unit_test(test_kalibr),
        cmocka_unit_test(test_euroc),
        cmocka_unit_test(test_orbslam3),
        cmocka_unit_test(test_basalt),
        cmocka_unit_test(test_photonvision),
        cmocka_unit_test(test_record),
        cmocka_unit_test(test_place_and_shift),
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_write_file_and_lost),
        cmocka_unit_test(test_fit),
        cmocka_unit_test(test_published_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
