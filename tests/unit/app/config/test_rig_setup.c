/* From the rig of a source and the settings to the rig of the configuration. */
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "app/config/setup.h"
#include "common/datasets.h"
#include "common/fake_camera.h"
#include "support/calibration.h"

enum { WIDTH = 96, HEIGHT = 64 };

static char path[] = "/tmp/fovea-rig-XXXXXX";
static struct fv_settings settings;
static struct fovea_error error;

static enum fovea_status open_with(const char *source, const char *const *sets,
                                   struct fv_setup *setup)
{
    const struct fovea_source_selection all = {.step = 1, .frames = 2};
    struct fv_setup_options options = {.source = source};
    for (; *sets != NULL; sets++)
        options.sets.values[options.sets.count++] = *sets;
    enum fovea_status status = fv_setup_settings(&options, &settings, &error);
    return status == FOVEA_OK ? fv_setup_open(&settings, &all, setup, &error) : status;
}

static void expect_refused(const char *source, const char *set, const char *text)
{
    const char *const sets[] = {set, NULL};
    struct fv_setup setup = {0};
    assert_int_equal(open_with(source, sets, &setup), FOVEA_ERROR_INPUT);
    fv_setup_close(&setup);
    if (strstr(error.text, text) == NULL) fail_msg("found \"%s\", expected %s", error.text, text);
}

static void write_mask(int width, int height)
{
    static uint8_t pixels[WIDTH * HEIGHT];
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)width,
                     .height = (png_uint_32)height,
                     .format = PNG_FORMAT_GRAY};
    for (int i = 0; i < width * height; i++)
        pixels[i] = i < 10 ? 0 : 255;
    assert_int_not_equal(png_image_write_to_file(&png, path, 0, pixels, 0, NULL), 0);
}

/* A camera that looks ahead, and is 0.3 m before the body's origin and 0.5 m above it: what lies to
 * the right of it (its x) lies to the right of the body, which is its -y. */
static void the_rig_has_the_body_of_the_settings(void **state)
{
    static const double ahead[12] = {0, 0, 1, 0.3, -1, 0, 0, 0, 0, -1, 0, 0.5};
    const char *const sets[] = {"T_body_cam=[[0, 0, 1, 0.3], [-1, 0, 0, 0], [0, -1, 0, 0.5]]",
                                NULL};
    struct fv_setup setup = {0};
    (void)state;
    if (open_with("sim:orbit?width=96&height=64&baseline=0.25&imu=200", sets, &setup) != FOVEA_OK)
        fail_msg("%s", error.text);
    const struct fovea_rig *rig = &settings.runtime.rig;
    assert_int_equal(rig->camera_count, 2);
    assert_true(rig->has_imu && rig->imu.rate_hz == 200 && rig->imu.gyro_noise > 0);
    assert_true(rig->cameras[1].calibrated && rig->cameras[1].has_T_body_cam);
    assert_int_equal(rig->cameras[1].camera.width, WIDTH);
    for (int i = 0; i < 12; i++) {
        const double second = ahead[i] - (i == 7 ? 0.25 : 0);
        assert_true(fabs(rig->cameras[0].T_body_cam[i] - ahead[i]) == 0);
        assert_true(fabs(rig->cameras[1].T_body_cam[i] - second) < 1e-12);
        assert_true(fabs(rig->imu.T_body_imu[i] - ahead[i]) < 1e-12);
    }
    fv_setup_close(&setup);
}

/* A picture with no camera.yaml beside it: detection runs, and what measures says how to calibrate.
 */
static void only_what_measures_needs_a_calibration(void **state)
{
    static const char *const measuring[] = {"odometry.enabled=true", "objects.ground=true",
                                            "objects.heights=person:1.7"};
    char source[128];
    (void)state;
    write_mask(WIDTH, HEIGHT);
    snprintf(source, sizeof source, "images:%s", path);
    for (size_t i = 0; i < sizeof measuring / sizeof *measuring; i++) {
        const char *const sets[] = {"odometry.enabled=false", measuring[i], NULL};
        struct fv_setup setup = {0};
        assert_int_equal(open_with(source, sets, &setup), FOVEA_ERROR_INPUT);
        fv_setup_close(&setup);
        if (strstr(error.text, "'fovea-calibrate camera --source images:") == NULL)
            fail_msg("found \"%s\", expected the command that calibrates", error.text);
    }
    const char *const sets[] = {"odometry.enabled=false", NULL};
    struct fv_setup setup = {0};
    if (open_with(source, sets, &setup) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fovea_camera *camera = &settings.runtime.rig.cameras[0].camera;
    assert_int_equal(camera->width, WIDTH);
    assert_true(camera->field_max_rad > 0.5);
    fv_setup_close(&setup);
    const char *const rough[] = {"camera_fov=90", NULL};
    if (open_with(source, rough, &setup) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(fabs(camera->fx - 0.5 * WIDTH) < 1e-9);
    fv_setup_close(&setup);
    expect_refused("sim:orbit", "camera_fov=90", "expected 0 beside the calibration built in");
}

static void masks_go_to_their_cameras(void **state)
{
    char set[64];
    const char *const sets[] = {set, NULL};
    struct fv_setup setup = {0};
    (void)state;
    snprintf(set, sizeof set, "mask2=%s", path);
    write_mask(WIDTH, HEIGHT);
    if (open_with("sim:orbit?width=96&height=64&baseline=0.25", sets, &setup) != FOVEA_OK)
        fail_msg("%s", error.text);
    const struct fovea_rig *rig = &settings.runtime.rig;
    assert_null(rig->cameras[0].mask);
    assert_non_null(rig->cameras[1].mask);
    assert_true(rig->cameras[1].mask[9] == 0 && rig->cameras[1].mask[10] == 255);
    fv_setup_close(&setup);
}

static void wrong_masks_are_refused(void **state)
{
    char set[64];
    (void)state;
    write_mask(WIDTH, HEIGHT);
    snprintf(set, sizeof set, "mask2=%s", path);
    expect_refused("sim:orbit?width=96&height=64", set, "expected none: the source has 1 camera");
    snprintf(set, sizeof set, "mask3=%s", path);
    expect_refused("sim:orbit?width=96&height=64&baseline=0.25", set,
                   "expected none: the source has 2 cameras");
    write_mask(WIDTH, HEIGHT - 1);
    snprintf(set, sizeof set, "mask2=%s", path);
    expect_refused("sim:orbit?width=96&height=64&baseline=0.25", set,
                   "mask: found 96 x 63 pixels, expected 96 x 64 as the frames");
    expect_refused("sim:orbit?width=96&height=64&baseline=0.25", "mask2=/nowhere.png",
                   "/nowhere.png");
}

/* The second camera's images are 64 x 80; its calibration is of `width` x `height`. */
static const char *make_euroc(int width, int height)
{
    enum { W2 = 64, H2 = 80 };
    static const struct fv_test_png form = {.width = W2, .height = H2, .channels = 1, .depth = 8};
    static char top[FV_TEST_PATH_BYTES];
    static uint8_t pixels[W2 * H2];
    char text[512];
    snprintf(top, sizeof top, "%s", fv_test_euroc(fv_test_place));
    fv_test_make_folder(fv_test_path(top, "mav0/cam1"));
    fv_test_make_folder(fv_test_path(top, "mav0/cam1/data"));
    fv_test_write_text(fv_test_path(top, "mav0/cam1/data.csv"), "1403638538577829376,1.png\n");
    fv_test_write_png(fv_test_path(top, "mav0/cam1/data/1.png"), &form, pixels);
    snprintf(text, sizeof text,
             "sensor_type: camera\nresolution: [%d, %d]\ncamera_model: pinhole\n"
             "intrinsics: [80, 80, 31.5, 39.5]\ndistortion_model: radial-tangential\n"
             "distortion_coefficients: [-0.2, 0.05, 0.001, -0.001]\n",
             width, height);
    fv_test_write_text(fv_test_path(top, "mav0/cam1/sensor.yaml"), text);
    return top;
}

static void each_calibration_is_fitted_to_its_cameras_images(void **state)
{
    char uri[FV_TEST_PATH_BYTES + 32];
    const char *const none[] = {NULL}, *const scaled[] = {"camera_scale=true", NULL};
    struct fv_setup setup = {0};
    (void)state;
    const char *top = make_euroc(32, 40);
    snprintf(uri, sizeof uri, "euroc:%s?cameras=2", top);
    assert_int_equal(open_with(uri, none, &setup), FOVEA_ERROR_INPUT);
    fv_setup_close(&setup);
    assert_non_null(strstr(error.text, "mav0/cam1/sensor.yaml: image size: found 32 x 40, "
                                       "expected 64 x 80 as the frames have"));
    if (open_with(uri, scaled, &setup) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fovea_rig *rig = &settings.runtime.rig;
    assert_true(rig->cameras[0].camera.width == WIDTH && rig->cameras[0].camera.fx == 80);
    assert_true(rig->cameras[1].camera.width == 64 && rig->cameras[1].camera.height == 80);
    assert_true(rig->cameras[1].camera.fx == 160 && rig->cameras[1].camera.cx == 63.5);
    assert_int_equal(fv_setup_frame_bytes(&setup), 64 * ((WIDTH + 63) / 64 * HEIGHT + 80));
    fv_setup_close(&setup);
    fv_test_folder_remove(top);
}

/* `fovea config` reads all files but opens no camera, whatever stands before it. */
static void no_camera_is_opened_for_a_check(void **state)
{
    static const char *const rows[][2] = {
        {"fault:v4l2:/dev/none?kind=black", NULL},
        {"pair:v4l2:/dev/none and v4l2:/dev/nobody", NULL},
        {"fault:images:/none?kind=black", "/none"},
        {"pair:sim:orbit and images:/none", "/none"},
        {"fault:sim:orbit?kind=blacker", "'blacker'"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct fv_setup_options options = {.source = rows[i][0]};
        assert_int_equal(fv_setup_settings(&options, &settings, &error), FOVEA_OK);
        if (fv_setup_check_files(&settings, &error) !=
            (rows[i][1] == NULL ? FOVEA_OK : FOVEA_ERROR_INPUT))
            fail_msg("%s: %s", rows[i][0], error.text);
        if (rows[i][1] != NULL) assert_non_null(strstr(error.text, rows[i][1]));
    }
}

static int make_file(void **state)
{
    const int file = mkstemp(path);
    if (fv_test_place_set_up(state) != 0) return -1;
    return file < 0 || close(file) != 0 ? -1 : 0;
}

static int remove_file(void **state)
{
    const int place = fv_test_place_tear_down(state);
    return unlink(path) != 0 ? -1 : place;
}

#define CAM0                                                                                       \
    "cam0:\n  camera_model: pinhole\n  intrinsics: [80.0, 80.0, 48.0, 32.0]\n"                     \
    "  distortion_model: radtan\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n"                      \
    "  resolution: [96, 64]\n"
static const char pair_of_cameras[] =
    "pair:v4l2:/dev/video0?format=GREY and v4l2:/dev/video1?format=GREY";

static void two_cameras_plug(void)
{
    fake_plug(fake_new(), "/dev/video0");
    fake_plug(fake_new(), "/dev/video1");
}

/* Two cameras whose source has no calibration of them: from the camchain at `camera`, each to its
 * own size, the second placed by the first. */
static void a_camchain_calibrates_two_live_cameras(void **state)
{
    static const char *const chain =
        CAM0 "cam1:\n  camera_model: pinhole\n  intrinsics: [70.0, 71.0, 47.0, 31.0]\n"
             "  distortion_model: radtan\n  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n"
             "  resolution: [96, 64]\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.12]\n"
             "  - [0.0, 1.0, 0.0, 0.0]\n  - [0.0, 0.0, 1.0, 0.0]\n  - [0.0, 0.0, 0.0, 1.0]\n";
    char set[64];
    const char *const sets[] = {set, "T_body_cam=[[0, 0, 1, 0.3], [-1, 0, 0, 0], [0, -1, 0, 0.5]]",
                                NULL};
    struct fv_setup setup = {0};
    (void)state;
    two_cameras_plug();
    fv_test_write_text(path, chain);
    snprintf(set, sizeof set, "camera=%s", path);
    if (open_with(pair_of_cameras, sets, &setup) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fovea_rig *rig = &settings.runtime.rig;
    assert_int_equal(rig->camera_count, 2);
    assert_true(rig->cameras[0].camera.fx == 80 && rig->cameras[1].camera.fy == 71);
    assert_true(rig->cameras[1].calibrated && rig->cameras[1].has_T_body_cam);
    assert_true(fabs(rig->cameras[1].T_body_cam[7] + 0.12) < 1e-12); /* to the right: -y */
    assert_true(fabs(rig->cameras[1].T_body_cam[3] - 0.3) < 1e-12);
    fv_setup_close(&setup);
    const struct fovea_camera one = {
        .width = 96, .height = 64, .fx = 80, .fy = 80, .cx = 48, .cy = 32};
    struct fv_calibration alone = {.camera = one};
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_ROS, &alone, NULL, &error),
                     FOVEA_OK);
    setup = (struct fv_setup){0};
    if (open_with(pair_of_cameras, sets, &setup) != FOVEA_OK) fail_msg("%s", error.text);
    assert_false(settings.runtime.rig.cameras[1].calibrated);
    fv_setup_close(&setup);
}

/* A second camera that the file has but that is wrong is no reason to go on with one. */
static void a_malformed_second_camera_is_refused(void **state)
{
    static const char *const wrong[][2] = {
        {CAM0 "cam1:\n  camera_model: pinhole\n  intrinsics: [70.0, 71.0, 47.0]\n",
         ":9: cam1.intrinsics: found"},
        {CAM0 "cam1:\n  camera_model: omni\n", ":8: cam1.camera_model: found 'omni'"},
        {CAM0 "cam1:\n", ":7: cam1: found"},
        {"%YAML:1.0\n---\nCamera.type: \"PinHole\"\nCamera1.fx: 80.0\nCamera1.fy: 80.0\n"
         "Camera1.cx: 48.0\nCamera1.cy: 32.0\nCamera2.fx: 80.0\nCamera2.fy: 80.0\n"
         "Camera2.cx: 48.0\nCamera.width: 96\nCamera.height: 64\n",
         "expected 'Camera2.cy'"},
    };
    char set[64];
    (void)state;
    two_cameras_plug();
    snprintf(set, sizeof set, "camera=%s", path);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const char *const sets[] = {set, NULL};
        struct fv_setup setup = {0};
        fv_test_write_text(path, wrong[i][0]);
        const enum fovea_status status = open_with(pair_of_cameras, sets, &setup);
        fv_setup_close(&setup);
        if ((status != FOVEA_ERROR_INPUT && status != FOVEA_ERROR_UNSUPPORTED) ||
            strstr(error.text, path) == NULL || strstr(error.text, wrong[i][1]) == NULL)
            fail_msg("%zu: found %d, \"%s\", expected %s", i, (int)status,
                     status != FOVEA_OK ? error.text : "", wrong[i][1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_camera_is_opened_for_a_check),
        cmocka_unit_test(the_rig_has_the_body_of_the_settings),
        cmocka_unit_test(only_what_measures_needs_a_calibration),
        cmocka_unit_test_setup_teardown(a_camchain_calibrates_two_live_cameras, fake_set_up,
                                        fake_tear_down),
        cmocka_unit_test_setup_teardown(a_malformed_second_camera_is_refused, fake_set_up,
                                        fake_tear_down),
        cmocka_unit_test(masks_go_to_their_cameras),
        cmocka_unit_test(wrong_masks_are_refused),
        cmocka_unit_test(each_calibration_is_fitted_to_its_cameras_images),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
