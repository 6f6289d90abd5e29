/* Automatic gain by the V4L2 driver, on a fake camera whose pictures get brighter with its gain. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "../../../drivers/v4l2/v4l2.h"
#include "drivers/table.h"
#include "common/fake_camera.h"
#include "common/live_source.h"

static struct fake_camera *camera;
static double light; /* grey level at gain 1 */

/* A gain of 0..255 stands for a factor of 1 to 8; with the lock of the fake held. */
static size_t fill(uint32_t index, uint8_t *data, size_t capacity)
{
    const double level = light * (1 + 7 * (double)fake_control(camera, V4L2_CID_GAIN)->value / 255);
    (void)index;
    memset(data, level > 255 ? 255 : (int)level, 96 * 64 < capacity ? 96 * 64 : capacity);
    return 96 * 64;
}

static struct fake_control *find_control(uint32_t id)
{
    for (int i = 0; i < FAKE_CONTROLS_MAX; i++)
        if (camera->controls[i].id == id) return &camera->controls[i];
    fail_msg("the fake has no control %x", id);
    return NULL;
}

static int begin(void **state)
{
    (void)state;
    fake_begin();
    camera = fake_new();
    find_control(V4L2_CID_AUTOGAIN)->id = V4L2_CID_HUE; /* it does not move its gain itself */
    camera->fill = fill;
    camera->rate_hz = 0;
    fake_plug(camera, "/dev/video0");
    return 0;
}

static int end(void **state)
{
    (void)state;
    fake_end();
    return 0;
}

static int64_t gain_now(void)
{
    fake_lock();
    const int64_t value = fake_control(camera, V4L2_CID_GAIN)->value;
    fake_unlock();
    return value;
}

static int level_now(struct fovea_source *source)
{
    struct fovea_frame frame;
    const struct fovea_source_ops *ops;
    const char *address;
    assert_int_equal(fv_source_find("v4l2:/dev/video0", &ops, &address, NULL), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, fv_test_now_ns() + 60000000000, &frame), FOVEA_OK);
    const int level = frame.images[0].data[0];
    ops->requeue(source, &frame);
    return level;
}

/* From dark and from bright it comes to the target and stays; where the range ends it stays at the
 * end. */
static void test_comes_to_target(void **state)
{
    (void)state;
    static const struct {
        double light;
        int64_t begin;
        int low, high; /* levels in the end */
        int64_t end;   /* of the gain; -1: between */
    } rows[] = {{20, 0, 104, 120, -1},  {20, 255, 104, 120, -1}, {100, 255, 104, 120, -1},
                {60, 16, 104, 120, -1}, {4, 0, 32, 32, 255},     {200, 255, 200, 200, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        light = rows[i].light;
        find_control(V4L2_CID_GAIN)->value = rows[i].begin;
        struct fovea_source *source = fv_test_start("/dev/video0?auto_gain=1&format=GREY");
        for (int k = 0; k < 600; k++)
            fv_test_next_frame(source);
        for (int k = 0; k < 40; k++) {
            const int level = level_now(source);
            if (level < rows[i].low || level > rows[i].high)
                fail_msg("row %zu: found level %d, expected [%d, %d]", i, level, rows[i].low,
                         rows[i].high);
        }
        if (rows[i].end >= 0) assert_int_equal(gain_now(), rows[i].end);
        fv_test_finish(source);
    }
}

/* The gain found before the camera was unplugged is set again, whatever the camera came back with.
 */
static void test_goes_on_after_unplug(void **state)
{
    (void)state;
    light = 20;
    struct fovea_source *source = fv_test_start("/dev/video0?auto_gain=1&format=GREY");
    for (int k = 0; k < 600; k++)
        fv_test_next_frame(source);
    const int64_t gain = gain_now();
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    find_control(V4L2_CID_GAIN)->value = 0;
    fake_plug(camera, "/dev/video0");
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK); /* a frame may still wait from before */
    assert_true(llabs(gain_now() - gain) <= 16);
    fv_test_finish(source);
}

static void test_refused(void **state)
{
    (void)state;
    const struct fovea_source_selection everything = {.step = 1};
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    assert_int_equal(fv_source_find("v4l2:/dev/video0?auto_gain=1", &ops, &address, NULL),
                     FOVEA_OK);
    find_control(V4L2_CID_GAIN)->refuses = EPIPE;
    assert_int_equal(ops->open(address, &everything, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "auto_gain: the camera refuses a gain"));
    find_control(V4L2_CID_GAIN)->id = V4L2_CID_SATURATION;
    assert_int_equal(ops->open(address, &everything, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "auto_gain: this camera has no gain"));
}

/* Every layout gives the grey level; pictures of the smallest size are measured within their
 * bounds. */
static void test_brightness(void **state)
{
    (void)state;
    static const struct {
        enum fovea_pixel_format format;
        int bytes, pixel[3]; /* of one pixel */
        int level;
    } rows[] = {
        {FOVEA_PIXEL_GREY8, 1, {77, 0}, 77},       {FOVEA_PIXEL_YUYV, 2, {77, 200}, 77},
        {FOVEA_PIXEL_UYVY, 2, {200, 77}, 77},      {FOVEA_PIXEL_Y10, 2, {0x35, 0x01}, 77},
        {FOVEA_PIXEL_Y12, 2, {0xd5, 0x04}, 77},    {FOVEA_PIXEL_Y14, 2, {0x55, 0x13}, 77},
        {FOVEA_PIXEL_Y16, 2, {0x55, 0x4d}, 77},    {FOVEA_PIXEL_BAYER_RGGB8, 1, {77, 0}, 77},
        {FOVEA_PIXEL_NV12, 1, {77, 0}, 77},        {FOVEA_PIXEL_RGB24, 3, {10, 77, 200}, 77},
        {FOVEA_PIXEL_BGR24, 3, {200, 77, 10}, 77},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const size_t bytes = 64 * 64 * (size_t)rows[i].bytes;
        uint8_t *data =
            test_malloc(bytes); /* a read beyond it is found by the test's own guard and by asan */
        for (size_t k = 0; k < bytes; k++)
            data[k] = (uint8_t)rows[i].pixel[k % (size_t)rows[i].bytes];
        const struct fovea_image image = {.data = data,
                                          .width = 64,
                                          .height = 64,
                                          .stride_bytes = 64 * rows[i].bytes,
                                          .format = rows[i].format};
        assert_int_equal(fv_v4l2_brightness(&image), rows[i].level);
        test_free(data);
    }
    /* The whole width counts: its right half is as bright as that of a grey picture. */
    static uint8_t colours[64 * 64 * 3];
    for (size_t k = 0; k < sizeof colours; k++)
        colours[k] = k % 192 < 96 ? 40 : 200;
    const struct fovea_image halves = {.data = colours,
                                       .width = 64,
                                       .height = 64,
                                       .stride_bytes = 192,
                                       .format = FOVEA_PIXEL_RGB24};
    assert_int_equal(fv_v4l2_brightness(&halves), 120);
    /* The four colours of a Bayer pattern count alike. */
    static uint8_t mosaic[64 * 64];
    for (int y = 0; y < 64; y++)
        for (int x = 0; x < 64; x++)
            mosaic[64 * y + x] = (uint8_t)(x % 2 == 0 && y % 2 == 0 ? 200 : 40);
    const struct fovea_image bayer = {.data = mosaic,
                                      .width = 64,
                                      .height = 64,
                                      .stride_bytes = 64,
                                      .format = FOVEA_PIXEL_BAYER_RGGB8};
    assert_int_equal(fv_v4l2_brightness(&bayer), 80);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_comes_to_target),
        TEST(test_goes_on_after_unplug),
        TEST(test_refused),
        TEST(test_brightness),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
