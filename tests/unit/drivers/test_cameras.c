/* The cameras that `fovea cameras` lists: stable names, modes, controls, and a URI that the driver
 * takes as it is. Of libcamera's list the lines are a script's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "../../../drivers/cameras.h"
#include "../../../drivers/libcamera/client.h"
#include "../../../drivers/table.h"
#include "common/datasets.h"
#include "common/fake_camera.h"

static struct fv_camera *cameras;

static size_t list(void)
{
    size_t count = 0;
    fv_cameras_v4l2(cameras, FV_CAMERAS_MAX, &count);
    return count;
}

static int set_up(void **state)
{
    cameras = calloc(FV_CAMERAS_MAX, sizeof *cameras);
    return cameras == NULL ? -1 : fake_set_up(state);
}

static int tear_down(void **state)
{
    free(cameras);
    return fake_tear_down(state);
}

static const struct fv_camera_mode *mode_of(const struct fv_camera *camera, const char *format,
                                            int32_t width)
{
    for (uint32_t i = 0; i < camera->mode_count; i++)
        if (strcmp(camera->modes[i].format, format) == 0 && camera->modes[i].width == width)
            return &camera->modes[i];
    fail_msg("no %s of %d columns", format, width);
    return NULL;
}

static void test_modes_and_controls(void **state)
{
    (void)state;
    struct fake_camera *fake = fake_new();
    memset(fake->formats, 0, sizeof fake->formats);
    fake->formats[0] = V4L2_PIX_FMT_H264;
    fake->formats[1] = V4L2_PIX_FMT_MJPEG;
    fake->formats[2] = V4L2_PIX_FMT_YUYV;
    fake->width = 320, fake->height = 240, fake->rate_hz = 60;
    fake_plug(fake, "/dev/video0");
    assert_int_equal(list(), 1);
    const struct fv_camera *camera = &cameras[0];
    assert_string_equal(camera->model, "Fake camera");
    assert_string_equal(camera->place, "fake, usb-fake-1");
    assert_string_equal(camera->trouble, "");
    assert_int_equal(camera->mode_count, 6);
    assert_false(mode_of(camera, "H264", 320)->read);
    const struct fv_camera_mode *mode = mode_of(camera, "YUYV", 640);
    assert_true(mode->read && mode->height == 480 && mode->rate_count == 2);
    assert_true(mode->rates_hz[0] == 30 && mode->rates_hz[1] == 15);
    /* 640 x 480 at 30 Hz; YUYV before MJPG, which must be decoded. */
    assert_string_equal(camera->uri, "v4l2:/dev/video0?width=640&height=480&format=YUYV&rate=30");
    assert_int_equal(camera->control_count, 5);
    const struct fv_camera_control *control = &camera->controls[0];
    assert_string_equal(control->name, "brightness");
    assert_true(control->minimum == -64 && control->maximum == 64 && control->step == 4);
    assert_true(control->standard == -64 && control->has_value && control->value == 0);
    for (uint32_t i = 0; i < 5; i++)
        if (strcmp(camera->controls[i].name, "auto_exposure") == 0) control = &camera->controls[i];
    assert_string_equal(control->menu, "manual_mode, aperture_priority_mode");
}

/* A size that is too slow is not proposed where another is fast enough. */
static void test_uri_prefers_rate(void **state)
{
    (void)state;
    struct fake_camera *fake = fake_new();
    fake->width = 320, fake->height = 240, fake->rate_hz = 40; /* 640 x 480 at 20 Hz */
    fake_plug(fake, "/dev/video0");
    assert_int_equal(list(), 1);
    assert_string_equal(cameras[0].uri,
                        "v4l2:/dev/video0?width=320&height=240&format=GREY&rate=40");
    fake->any_size = true; /* from 320 x 240 on */
    assert_int_equal(list(), 1);
    assert_string_equal(cameras[0].uri,
                        "v4l2:/dev/video0?width=640&height=480&format=GREY&rate=40");
    fake->no_rates = true; /* a driver that lists no sizes */
    assert_int_equal(list(), 1);
    assert_string_equal(cameras[0].uri, "v4l2:/dev/video0");
}

/* By the serial number where it is one camera's alone, by the port otherwise. */
static void test_stable_names(void **state)
{
    (void)state;
    struct fake_camera *first = fake_new(), *second = fake_new();
    first->serial = "A1", second->serial = "";
    second->bus_info = "usb-fake-2";
    fake_plug(second, "/dev/video10");
    fake_plug(first, "/dev/video2");
    fake_link("/dev/v4l/by-path/pci-1-video-index0", first);
    fake_link("/dev/v4l/by-id/usb-A1-video-index0", first);
    fake_link("/dev/v4l/by-path/pci-2-video-index0", second);
    fake_link("/dev/v4l/by-id/usb-none-video-index0", second);
    assert_int_equal(list(), 2);
    assert_string_equal(cameras[0].node, "/dev/video2"); /* by number */
    assert_string_equal(cameras[0].name, "/dev/v4l/by-id/usb-A1-video-index0");
    assert_string_equal(cameras[1].name, "/dev/v4l/by-path/pci-2-video-index0");
    second->serial = "A1"; /* both have it: a name by it may become the other's */
    assert_int_equal(list(), 2);
    assert_string_equal(cameras[0].name, "/dev/v4l/by-path/pci-1-video-index0");
}

static void test_camera_that_cannot_be_opened(void **state)
{
    (void)state;
    struct fake_camera *fake = fake_new();
    fake_plug(fake, "/dev/video0");
    fake_fail(fake, 0, EACCES, -1);
    assert_int_equal(list(), 1);
    assert_string_equal(cameras[0].trouble,
                        "cannot be opened: Permission denied: add the user to the group video");
    assert_string_equal(cameras[0].uri, "v4l2:/dev/video0");
}

/* What is printed can be given to --source. */
static void test_uri_opens(void **state)
{
    (void)state;
    struct fake_camera *fake = fake_new();
    fake->rate_hz = 30;
    fake_plug(fake, "/dev/video0");
    fake_link("/dev/v4l/by-path/pci-1-video-index0", fake);
    assert_int_equal(list(), 1);
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    static const struct fovea_source_selection everything = {.step = 1};
    assert_int_equal(fv_source_find(cameras[0].uri, &ops, &address, &error), FOVEA_OK);
    if (ops->open(address, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(ops->info(source)->cameras[0].width, 96);
    ops->close(source);
}

/* ---- libcamera ------------------------------------------------------------------------------- */

static enum fovea_status list_by(const char *script, size_t *count, struct fovea_error *error)
{
    char folder[FV_TEST_PATH_BYTES];
    fv_test_folder(folder);
    const char *path = fv_test_path(folder, FV_LIBCAMERA_PROGRAM);
    fv_test_write_text(path, script);
    assert_int_equal(chmod(path, 0700), 0);
    setenv("FOVEA_PLUGINS", folder, 1);
    *count = 0;
    const enum fovea_status status = fv_cameras_libcamera(cameras, FV_CAMERAS_MAX, count, error);
    fv_test_folder_remove(folder);
    return status;
}

static void test_libcamera(void **state)
{
    (void)state;
    struct fovea_error error = {.text = ""};
    size_t count;
    const enum fovea_status status = list_by(
        "#!/bin/sh\n[ \"$1\" = --list ] || exit 3\n"
        "printf 'camera\\t/base/i2c@1/imx219@10\\timx219\\nformat\\tYUV420\\t640\\t480\\t206.65\\t0.0996\\n'\n"
        "printf 'format\\tYUV420\\t1640\\t1232\\t41.85\\t41.85\\nformat\\tXYZ\\t640\\t480\\n'\n"
        "printf 'control\\tBrightness\\t-1.000000\\t1.000000\\t0.000000\\n'\n"
        "printf 'control\\tAeEnable\\tfalse\\ttrue\\tfalse\\n'\n"
        "printf 'camera\\tother\\t\\ntrouble\\tit takes no video\\nformat\\tshort\\n'\n",
        &count, &error);
    if (status != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(count, 2);
    assert_string_equal(cameras[0].uri,
                        "libcamera:/base/i2c@1/imx219@10?width=640&height=480&format=YU12&rate=30");
    assert_int_equal(cameras[0].mode_count, 3);
    assert_true(cameras[0].modes[0].any_rate && cameras[0].modes[0].rate_count == 2);
    assert_true(cameras[0].modes[0].rates_hz[0] == 206.65);
    assert_false(cameras[0].modes[1].any_rate);
    assert_true(cameras[0].modes[1].rate_count == 1 && cameras[0].modes[1].rates_hz[0] == 41.85);
    assert_int_equal(cameras[0].modes[2].rate_count, 0);
    assert_string_equal(cameras[0].modes[2].format, "XYZ");
    assert_false(cameras[0].modes[2].read);
    assert_true(cameras[0].controls[0].minimum == -1 && cameras[0].controls[0].maximum == 1);
    assert_false(cameras[0].controls[1].has_range);
    assert_string_equal(cameras[1].uri, "libcamera:other");
    assert_string_equal(cameras[1].trouble, "it takes no video");
    assert_int_equal(cameras[1].mode_count, 0);
}

/* The rate that is proposed is 30 Hz, or the nearest one. */
static void test_libcamera_rates(void **state)
{
    (void)state;
    struct fovea_error error = {.text = ""};
    size_t count;
    const enum fovea_status status =
        list_by("#!/bin/sh\n"
                "printf 'camera\\tfast\\t\\nformat\\tYUV420\\t640\\t480\\t120\\t50\\n'\n"
                "printf 'camera\\tslow\\t\\nformat\\tYUV420\\t640\\t480\\t20\\t1\\n'\n"
                "printf 'camera\\tone\\t\\nformat\\tYUV420\\t640\\t480\\t41.85\\t41.85\\n'\n",
                &count, &error);
    if (status != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(count, 3);
    static const char *const rates[] = {"&rate=50", "&rate=20", "&rate=41.85"};
    for (size_t i = 0; i < count; i++)
        if (strstr(cameras[i].uri, rates[i]) == NULL) fail_msg("%s", cameras[i].uri);
}

static void test_libcamera_that_fails(void **state)
{
    (void)state;
    struct fovea_error error = {.text = ""};
    size_t count;
    assert_int_equal(list_by("#!/bin/sh\nkill -ABRT $$\n", &count, &error), FOVEA_ERROR_SYSTEM);
    assert_string_equal(error.text, "libcamera: its process failed (signal 6)");
    const int64_t usual_ns = fv_libcamera_answer_ns;
    fv_libcamera_answer_ns = 50000000;
    assert_int_equal(list_by("#!/bin/sh\nexec sleep 1000\n", &count, &error), FOVEA_ERROR_SYSTEM);
    fv_libcamera_answer_ns = usual_ns;
    assert_string_equal(error.text, "libcamera: it does not answer: its process was killed");
    assert_int_equal(count, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_modes_and_controls, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_uri_prefers_rate, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_stable_names, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_camera_that_cannot_be_opened, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_uri_opens, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_libcamera, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_libcamera_rates, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_libcamera_that_fails, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
