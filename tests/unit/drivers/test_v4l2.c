/* The V4L2 driver on a fake device: options, negotiation, controls, stamps, every pixel format. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/fake_camera.h"
#include "common/live_source.h"

static const struct fovea_source_selection everything = {.step = 1};
static const struct fovea_source_ops *const ops = &fv_source_v4l2;

/* ---- opening --------------------------------------------------------------------------------- */

static void test_wrong_options(void **state)
{
    (void)state;
    static const struct {
        const char *address, *says[3];
    } wrong[] = {
        {"", {"''", "path", "/dev/video0"}},
        {"video0", {"'video0'", "path", "/dev"}},
        {"/dev/video7", {"/dev/video7", "found no such device", "plugged in"}},
        {"/dev/video0?widht=640", {"'widht'", "did you mean 'width'", "height"}},
        {"/dev/video0?width=640", {"height", "found none", "width and height"}},
        {"/dev/video0?width=7&height=64", {"width", "'7'", "[64, 4096]"}},
        {"/dev/video0?format=YUV9", {"format", "'YUV9'", "GREY"}},
        {"/dev/video0?rate=0", {"rate", "'0'", "Hz"}},
        {"/dev/video0?shift=4", {"shift", "found 4", "Y16"}},
        {"/dev/video0?format=Y16&shift=3", {"shift", "found 3", "2, 4, 6 or 8"}},
        {"/dev/video0?exposure=5&auto_exposure=1", {"exposure", "auto_exposure=1", "one of them"}},
        {"/dev/video0?gain=5&auto_gain=1", {"gain", "auto_gain=1", "one of them"}},
        {"/dev/video0?exposure=500", {"exposure", "500", "[0.3, 204.7]"}},
        {"/dev/video0?gain=256", {"gain", "256", "[0, 255]"}},
        {"/dev/video0?buffers=2", {"buffers", "'2'", "[3, 8]"}},
        {"/dev/video0?control.brightnes=3",
         {"control", "'brightnes'", "did you mean 'brightness'"}},
        {"/dev/video0?control.brightness=3", {"control.brightness", "found 3", "steps of 4"}},
        {"/dev/video0?control.brightness=99", {"control.brightness", "found 99", "[-64, 64]"}},
        {"/dev/video0?control.brightness=x", {"control.brightness", "'x'", "a whole number"}},
        {"/dev/video0?control.auto_exposure=Sports",
         {"control.auto_exposure", "'Sports'", "row of the menu"}},
        {"/dev/video0?control.auto_exposure=2",
         {"control.auto_exposure", "'2'", "row of the menu"}},
        {"/dev/video0?control.gain", {"control.gain", "no value", "VALUE"}},
    };
    fake_plug(fake_new(), "/dev/video0");
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct fovea_source *source = NULL;
        struct fovea_error error = {.text = ""};
        const enum fovea_status status = ops->open(wrong[i].address, &everything, &source, &error);
        if (status != FOVEA_ERROR_INPUT)
            fail_msg("%s: %d %s", wrong[i].address, status, error.text);
        assert_null(source);
        for (int k = 0; k < 3; k++)
            if (strstr(error.text, wrong[i].says[k]) == NULL)
                fail_msg("%s: no \"%s\" in: %s", wrong[i].address, wrong[i].says[k], error.text);
    }
}

static void test_negotiation_is_reported(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    camera->rate_hz = 25;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source =
        fv_test_open("/dev/video0?width=640&height=480&rate=60&format=YUYV");
    const struct fovea_source_info *info = ops->info(source);
    assert_int_equal(info->cameras[0].width, 96);
    assert_int_equal(info->cameras[0].height, 64);
    assert_int_equal(info->format, FOVEA_PIXEL_YUYV);
    assert_true(info->rate_hz == 25.0 && info->live && !info->rig.cameras[0].calibrated);
    struct fovea_error error;
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "width: asked 640, the camera gives 96"));
    assert_non_null(strstr(error.text, "height: asked 480, the camera gives 64"));
    assert_non_null(strstr(error.text, "rate: asked 60, the camera gives 25"));
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    ops->close(source);
    source = fv_test_open(
        "/dev/video0?width=96&height=64&rate=25&format=GREY"); /* nothing differs:
                                                                  nothing is reported */
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    ops->close(source);
    memset(camera->formats, 0, sizeof camera->formats);
    camera->formats[0] = V4L2_PIX_FMT_H264;
    camera->formats[1] = V4L2_PIX_FMT_YUYV;
    fake_plug(camera, "/dev/video0");
    source = fv_test_open("/dev/video0"); /* the one that can be read */
    assert_int_equal(ops->info(source)->format, FOVEA_PIXEL_YUYV);
    ops->close(source);
    source = NULL;
    assert_int_equal(ops->open("/dev/video0?format=GREY", &everything, &source, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "expected GREY; the camera gives: H264 YUYV"));
}

static void assert_reported(const char *address, const char *says)
{
    struct fovea_error error = {.text = ""};
    struct fovea_source *source = fv_test_open(address);
    assert_int_equal(ops->complaint(source, &error), says != NULL ? FOVEA_OK : FOVEA_AGAIN);
    if (says != NULL && strstr(error.text, says) == NULL) fail_msg("%s: %s", address, error.text);
    ops->close(source);
}

/* An exposure or a gain that lies between what the camera can give, or that it makes another of. */
static void test_controls_that_differ_are_reported(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    assert_reported("/dev/video0?exposure=5&gain=40&control.brightness=-8", NULL);
    assert_reported("/dev/video0?exposure=0.56", "exposure (ms): asked 0.56, the camera gives 0.6");
    assert_reported("/dev/video0?gain=1.4", "gain: asked 1.4, the camera gives 1");
    assert_reported(
        "/dev/video0?exposure=0.56&gain=1.4&width=640&height=480",
        "width: asked 640, the camera gives 96; height: asked 480, the camera gives 64; exposure (ms): asked 0.56, the camera gives 0.6; gain: asked 1.4, the camera gives 1");
    camera->grain = 16;
    assert_reported(
        "/dev/video0?exposure=5&gain=40",
        "exposure (ms): asked 5, the camera gives 4.8; gain: asked 40, the camera gives 32");
    assert_reported("/dev/video0?control.brightness=-8",
                    "control.brightness: asked -8, the camera gives 0");
}

static void test_open_refused(void **state)
{
    (void)state;
    static const struct {
        int reason;
        const char *says;
    } rows[] = {{EBUSY, "another program"}, {EACCES, "group video"}, {ENODEV, "away"}};
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    for (size_t i = 0; i < 3; i++) {
        struct fovea_source *source = NULL;
        struct fovea_error error = {.text = ""};
        fake_fail(camera, 0, rows[i].reason, 1);
        assert_true(ops->open("/dev/video0", &everything, &source, &error) < 0);
        assert_non_null(strstr(error.text, rows[i].says));
        assert_null(source);
        camera->failures[0].times = 0;
    }
}

/* Pixel x, y of a picture of the fake camera. */
static uint8_t byte_of(uint32_t index, int32_t stride, int32_t x, int32_t y)
{
    return (uint8_t)(x + y * stride + 37 * (int32_t)index);
}

/* Two cameras side by side: each half is a picture of its own, without gaps. */
static void test_one_picture_of_two_cameras(void **state)
{
    (void)state;
    static const char *const formats[] = {"GREY", "YUYV"};
    struct fake_camera *camera = fake_new();
    camera->width = 160;
    camera->stride_padding = 8;
    fake_plug(camera, "/dev/video0");
    for (int f = 0; f < 2; f++) {
        const int32_t wide = f + 1, stride = 160 * wide + 8; /* bytes of a pixel, of a row */
        char address[64];
        snprintf(address, sizeof address, "/dev/video0?split=2&readout=8&format=%s", formats[f]);
        struct fovea_source *source = fv_test_start(address);
        const struct fovea_source_info *info = ops->info(source);
        assert_int_equal(info->rig.camera_count, 2);
        for (int i = 0; i < 2; i++) {
            assert_true(info->cameras[i].width == 80 && info->cameras[i].height == 64);
            assert_true(info->rig.cameras[i].readout_ns == 8000000);
            assert_false(info->rig.cameras[i].calibrated);
        }
        for (int n = 0; n < 6; n++) {
            struct fovea_frame frame = fv_test_hold_frame(source);
            const uint8_t first = frame.images[0].data[0];
            assert_int_equal(frame.image_count, 2);
            for (int i = 0; i < 2; i++) {
                const struct fovea_image *half = &frame.images[i];
                assert_int_equal(fovea_image_check(half), FOVEA_OK);
                assert_true(half->width == 80 && half->stride_bytes == 80 * wide);
                for (int32_t y = 0; y < 64; y++)
                    for (int32_t x = 0; x < 80 * wide; x++)
                        assert_int_equal(
                            half->data[y * half->stride_bytes + x],
                            (uint8_t)(first + byte_of(0, stride, x + i * 80 * wide, y)));
            }
            ops->requeue(source, &frame);
        }
        fv_test_finish(source);
    }
    static const char *const wrong[][2] = {
        {"/dev/video0?split=2&format=NV12", "split: found 2 with NV12"},
        {"/dev/video0?split=3", "split: found '3'"},
        {"/dev/video0?split=2&format=YUYV", "split: found 2 with"},
    };
    for (int i = 0; i < 3; i++) {
        struct fovea_source *source = NULL;
        struct fovea_error error = {.text = ""};
        if (i == 2) { /* half of it ends within a pair of pixels that share their colour */
            fake_lock();
            camera->width = 162;
            fake_unlock();
        }
        assert_int_equal(ops->open(wrong[i][0], &everything, &source, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, wrong[i][1]) == NULL) fail_msg("%s", error.text);
    }
    struct fovea_source *source = fv_test_start("/dev/video0?split=2&format=GREY");
    assert_int_equal(ops->info(source)->cameras[1].width, 81);
    fv_test_finish(source);
}

static int64_t value_of(const struct fake_camera *camera, uint32_t id)
{
    fake_lock();
    const int64_t value = fake_control(camera, id)->value;
    fake_unlock();
    return value;
}

static void test_controls(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source =
        fv_test_open("/dev/video0?exposure=5&gain=40&control.brightness=-8");
    assert_int_equal(value_of(camera, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
    assert_int_equal(value_of(camera, V4L2_CID_EXPOSURE_ABSOLUTE), 50);
    assert_int_equal(value_of(camera, V4L2_CID_AUTOGAIN), 0);
    assert_int_equal(value_of(camera, V4L2_CID_GAIN), 40);
    assert_int_equal(value_of(camera, V4L2_CID_BRIGHTNESS), -8);
    ops->close(source);
    source =
        fv_test_open("/dev/video0?auto_exposure=0&auto_gain=1&control.exposure_time_absolute=77");
    assert_int_equal(value_of(camera, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
    assert_int_equal(value_of(camera, V4L2_CID_AUTOGAIN), 1);
    assert_int_equal(value_of(camera, V4L2_CID_EXPOSURE_ABSOLUTE), 77);
    ops->close(source);
    source = fv_test_open("/dev/video0?auto_exposure=1");
    assert_int_equal(value_of(camera, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_APERTURE_PRIORITY);
    ops->close(source);
    source = fv_test_open("/dev/video0?control.auto_exposure=Manual Mode");
    assert_int_equal(value_of(camera, V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
    ops->close(source);
    camera->controls[0].refuses = EIO;
    struct fovea_error error;
    assert_int_equal(ops->open("/dev/video0?control.brightness=8", &everything, &source, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "control.brightness: the camera refuses 8"));
}

static void test_selection(void **state)
{
    (void)state;
    const struct fovea_source_selection wrong[] = {
        {.start = 3, .step = 1}, {.step = 2}, {.step = 1, .reverse = true}};
    const struct fovea_source_selection few = {.step = 1, .frames = 5};
    struct fovea_source *source = NULL;
    struct fovea_error error;
    struct fovea_frame frame;
    fake_plug(fake_new(), "/dev/video0");
    for (int i = 0; i < 3; i++)
        assert_true(ops->open("/dev/video0", &wrong[i], &source, &error) < 0);
    assert_int_equal(ops->open("/dev/video0", &few, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (int i = 0; i < 5; i++)
        fv_test_next_frame(source);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END);
    assert_int_equal(ops->state(source), FOVEA_SOURCE_ENDED);
    fv_test_finish(source);
}

/* ---- pictures -------------------------------------------------------------------------------- */

static void check_format(struct fake_camera *camera, const char *name,
                         enum fovea_pixel_format expected)
{
    char address[64];
    snprintf(address, sizeof address, "/dev/video0?format=%s", name);
    struct fovea_source *source = fv_test_start(address);
    assert_int_equal(ops->info(source)->format, expected);
    uint64_t first = UINT64_MAX;
    for (int i = 0; i < 6; i++) {
        struct fovea_frame frame;
        assert_int_equal(ops->dequeue(source, fv_test_now_ns() + 60000000000, &frame), FOVEA_OK);
        if (i == 0) first = camera->made - 1 - (camera->made - 1 - frame.sequence);
        assert_int_equal(fovea_image_check(&frame.images[0]), FOVEA_OK);
        assert_int_equal(frame.images[0].format, expected);
        assert_int_equal(frame.images[0].width, 96);
        assert_int_equal(frame.images[0].stride_bytes,
                         fovea_image_stride_min(expected, 96) + camera->stride_padding);
        const size_t bytes = fovea_image_bytes(expected, 64, frame.images[0].stride_bytes);
        for (size_t k = 0; k < bytes; k++)
            if (frame.images[0].data[k] != (uint8_t)(k + 37 * (size_t)frame.sequence))
                fail_msg("%s: frame %d differs at byte %zu", name, i, k);
        ops->requeue(source, &frame);
    }
    assert_true(first != UINT64_MAX);
    fv_test_finish(source);
}

static void test_formats(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        enum fovea_pixel_format format;
    } rows[] = {
        {"GREY", FOVEA_PIXEL_GREY8},       {"Y10", FOVEA_PIXEL_Y10},
        {"Y12", FOVEA_PIXEL_Y12},          {"Y16", FOVEA_PIXEL_Y16},
        {"Y16&shift=2", FOVEA_PIXEL_Y10},  {"Y16&shift=4", FOVEA_PIXEL_Y12},
        {"Y16&shift=6", FOVEA_PIXEL_Y14},  {"YUYV", FOVEA_PIXEL_YUYV},
        {"UYVY", FOVEA_PIXEL_UYVY},        {"NV12", FOVEA_PIXEL_NV12},
        {"YU12", FOVEA_PIXEL_YU12},        {"RGGB", FOVEA_PIXEL_BAYER_RGGB8},
        {"BGGR", FOVEA_PIXEL_BAYER_BGGR8}, {"GRBG", FOVEA_PIXEL_BAYER_GRBG8},
        {"GBRG", FOVEA_PIXEL_BAYER_GBRG8}, {"RGB3", FOVEA_PIXEL_RGB24},
        {"BGR3", FOVEA_PIXEL_BGR24},
    };
    for (int variant = 0; variant < 3;
         ++variant) { /* plain, padded rows, planes in the interface */
        for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
            fake_begin();
            struct fake_camera *camera = fake_new();
            camera->rate_hz = 0;
            camera->stride_padding = variant == 1 ? 32 : 0;
            camera->planes = variant == 2;
            fake_plug(camera, "/dev/video0");
            check_format(camera, rows[i].name, rows[i].format);
            fake_end();
        }
    }
    fake_begin();
}

static void test_stamps(void **state)
{
    (void)state;
    static const struct {
        enum fake_stamps stamps;
        const char *options;
        enum fovea_clock clock;
        enum fovea_stamp_meaning meaning;
    } rows[] = {
        {FAKE_STAMPS_MONOTONIC, "", FOVEA_CLOCK_MONOTONIC, FOVEA_STAMP_EXPOSURE_START},
        {FAKE_STAMPS_MONOTONIC, "?exposure=5", FOVEA_CLOCK_MONOTONIC, FOVEA_STAMP_EXPOSURE_MIDDLE},
        {FAKE_STAMPS_END, "?exposure=5", FOVEA_CLOCK_MONOTONIC, FOVEA_STAMP_EXPOSURE_END},
        {FAKE_STAMPS_END, "?exposure=5&readout=10", FOVEA_CLOCK_MONOTONIC,
         FOVEA_STAMP_EXPOSURE_MIDDLE},
        {FAKE_STAMPS_REALTIME, "", FOVEA_CLOCK_MONOTONIC, FOVEA_STAMP_UNKNOWN},
        {FAKE_STAMPS_STRANGE, "", FOVEA_CLOCK_MONOTONIC, FOVEA_STAMP_UNKNOWN},
    };
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char address[64];
        camera->stamps = rows[i].stamps;
        snprintf(address, sizeof address, "/dev/video0%s", rows[i].options);
        fake_lock();
        camera->controls[3].value = V4L2_EXPOSURE_APERTURE_PRIORITY;
        fake_unlock();
        struct fovea_source *source = fv_test_start(address);
        int64_t last_ns = 0;
        for (int k = 0; k < 4; k++) {
            const struct fovea_frame frame = fv_test_next_frame(source);
            assert_int_equal(frame.clock, rows[i].clock);
            assert_int_equal(frame.stamp_meaning, rows[i].meaning);
            assert_true(frame.stamp_ns > last_ns && frame.stamp_ns < fv_test_now_ns() + 20000000);
            assert_true(frame.stamp_ns > fv_test_now_ns() - 8000000000);
            last_ns = frame.stamp_ns;
            assert_int_equal(frame.exposure_ns[0],
                             strstr(rows[i].options, "exposure") != NULL ? 5000000 : 0);
        }
        if (rows[i].stamps == FAKE_STAMPS_STRANGE)
            assert_true(fv_test_complains_of(source, "time of arrival"));
        fv_test_finish(source);
    }
}

static void test_bad_stamps_are_skipped(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    for (int kind = FAKE_STAMPS_REPEATED; kind <= FAKE_STAMPS_BACKWARD; kind++) {
        camera->stamps = (enum fake_stamps)kind;
        struct fovea_source *source = fv_test_start("/dev/video0");
        int64_t last_ns = 0;
        for (int k = 0; k < 20; k++) {
            const struct fovea_frame frame = fv_test_next_frame(source);
            assert_true(frame.stamp_ns > last_ns);
            last_ns = frame.stamp_ns;
        }
        const struct fovea_source_counts counts = fv_test_counts(source);
        assert_true(counts.damaged >= 6 && counts.delivered == 20);
        assert_true(fv_test_complains_of(source, kind == FAKE_STAMPS_REPEATED ? "is that of"
                                                                              : "lies before"));
        fv_test_finish(source);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, fake_set_up, fake_tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_wrong_options),
        TEST(test_negotiation_is_reported),
        TEST(test_controls_that_differ_are_reported),
        TEST(test_open_refused),
        TEST(test_one_picture_of_two_cameras),
        TEST(test_controls),
        TEST(test_selection),
        TEST(test_formats),
        TEST(test_stamps),
        TEST(test_bad_stamps_are_skipped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
