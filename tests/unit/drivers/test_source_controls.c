/* Exposure and gain of running cameras: what a V4L2 device is set to, what the simulated camera
 * makes of it, what goes through `fault:` and `pair:`, and who refuses. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/table.h"
#include "common/fake_camera.h"
#include "common/live_source.h"

enum { EXPOSURE = FOVEA_SOURCE_EXPOSURE, GAIN = FOVEA_SOURCE_GAIN };

static const struct fovea_source_ops *ops; /* of the source that was opened last */
static struct fovea_error said;

static struct fovea_source *open_source(const char *uri)
{
    static const struct fovea_source_selection all = {.step = 1};
    struct fovea_source *source = NULL;
    const char *address;
    assert_int_equal(fv_source_find(uri, &ops, &address, &said), FOVEA_OK);
    if (ops->open(address, &all, &source, &said) != FOVEA_OK) fail_msg("%s", said.text);
    return source;
}

static struct fovea_source *start_source(const char *uri)
{
    struct fovea_source *source = open_source(uri);
    if (ops->start(source, &said) != FOVEA_OK) fail_msg("%s", said.text);
    return source;
}

static void close_source(struct fovea_source *source)
{
    ops->stop(source);
    ops->close(source);
}

static void set_control(struct fovea_source *source, int control, double value)
{
    if (fv_source_control(ops, source, (enum fovea_source_control)control, value, &said) !=
        FOVEA_OK)
        fail_msg("%s", said.text);
}

static void assert_refused(struct fovea_source *source, int control, double value,
                           enum fovea_status status, const char *words)
{
    const enum fovea_status found =
        fv_source_control(ops, source, (enum fovea_source_control)control, value, &said);
    if (found != status || strstr(said.text, words) == NULL)
        fail_msg("found %s: %s; expected %s: %s", fovea_status_name(found), said.text,
                 fovea_status_name(status), words);
}

/* ---- the simulated camera -------------------------------------------------------------------- */

struct seen {
    double mean;
    int64_t exposure_ns;
    uint64_t hash;
};

static struct seen see(struct fovea_source *source, uint32_t camera)
{
    struct fovea_frame frame;
    struct seen seen = {.hash = 0};
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
    const struct fovea_image *image = &frame.images[camera];
    for (int32_t y = 0; y < image->height; y++)
        for (int32_t x = 0; x < image->width; x++) {
            const uint8_t value = image->data[y * image->stride_bytes + x];
            seen.mean += value;
            seen.hash = (seen.hash ^ value) * 0x100000001B3u;
        }
    seen.mean /= (double)image->width * image->height;
    seen.exposure_ns = frame.exposure_ns[camera];
    ops->requeue(source, &frame);
    return seen;
}

static void assert_near(double found, double expected, double part)
{
    if (fabs(found - expected) > part * expected)
        fail_msg("found %g, expected %g", found, expected);
}

/* It stands, so that all frames are alike but for noise. */
#define STILL "sim:still?width=96&height=64&objects=0&noise=0&light=0.5&exposure=8"

static void the_simulated_camera_gets_brighter(void **state)
{
    struct fovea_source *source = start_source(STILL);
    const struct seen before = see(source, 0);
    (void)state;
    assert_int_equal(before.exposure_ns, 8000000);
    set_control(source, EXPOSURE, 4);
    struct seen seen = see(source, 0);
    assert_int_equal(seen.exposure_ns, 4000000);
    assert_near(seen.mean, before.mean / 2, 0.02);
    set_control(source, GAIN, 2);
    assert_near(see(source, 0).mean, before.mean, 0.02);
    set_control(source, EXPOSURE, 0); /* that of the address */
    seen = see(source, 0);
    assert_int_equal(seen.exposure_ns, 8000000);
    assert_true(seen.mean > 1.6 * before.mean); /* some of it is cut off at white */
    set_control(source, GAIN, -1);
    seen = see(source, 0);
    assert_true(seen.hash == before.hash); /* bit for bit as before */
    assert_refused(source, EXPOSURE, 34, FOVEA_ERROR_INPUT,
                   "sim: exposure (ms): found 34, expected [0.05, 33.33");
    assert_refused(source, GAIN, 17, FOVEA_ERROR_INPUT,
                   "sim: gain: found 17, expected [0.0625, 16]");
    assert_true(see(source, 0).hash == before.hash);
    close_source(source);
}

static void noise_rises_with_gain(void **state)
{
    (void)state;
    struct fovea_source *source =
        start_source("sim:still?width=96&height=64&objects=0&noise=4&light=0.1");
    double before = 0, after = 0;
    for (int i = 0; i < 2; i++) {
        struct fovea_frame a, b;
        assert_int_equal(ops->dequeue(source, INT64_MAX, &a), FOVEA_OK);
        assert_int_equal(ops->dequeue(source, INT64_MAX, &b), FOVEA_OK);
        double sum = 0;
        for (int32_t k = 0; k < 96 * 64; k++) {
            const double apart = a.images[0].data[k] - b.images[0].data[k];
            sum += apart * apart;
        }
        *(i == 0 ? &before : &after) = sqrt(sum / 2 / (96 * 64));
        ops->requeue(source, &a);
        ops->requeue(source, &b);
        set_control(source, GAIN, 3);
    }
    assert_near(after / before, 3, 0.15);
    close_source(source);
}

static void blur_follows_the_exposure(void **state)
{
    (void)state;
    struct fovea_source *one = start_source("sim:fast?width=96&height=64&blur=1&exposure=15");
    struct fovea_source *other = start_source("sim:fast?width=96&height=64&blur=1&exposure=5");
    set_control(other, EXPOSURE, 15);
    set_control(other, GAIN, 1.0 / 3);
    for (int i = 0; i < 100; i++) {
        const struct seen a = see(one, 0), b = see(other, 0);
        assert_int_equal(a.exposure_ns, b.exposure_ns);
    }
    assert_near(see(other, 0).mean, see(one, 0).mean, 0.02);
    close_source(one);
    close_source(other);
}

/* ---- what stands before a camera ------------------------------------------------------------- */

static void faults_pass_it_on(void **state)
{
    struct fovea_source *source = start_source("fault:" STILL "?kind=black&first=1000");
    const double before = see(source, 0).mean;
    (void)state;
    set_control(source, EXPOSURE, 2);
    assert_near(see(source, 0).mean, before / 4, 0.02);
    assert_refused(source, GAIN, 99, FOVEA_ERROR_INPUT, "sim: gain: found 99");
    close_source(source);
}

static void a_pair_changes_both_or_none(void **state)
{
    struct fovea_source *source =
        start_source("pair:" STILL "&rate=10 and " STILL "&rate=100 within 1000");
    const double before = see(source, 0).mean;
    (void)state;
    set_control(source, EXPOSURE, 4);
    assert_near(see(source, 0).mean, before / 2, 0.02);
    assert_near(see(source, 1).mean, before / 2, 0.02);
    /* Longer than a frame of the second. */
    assert_refused(source, EXPOSURE, 20, FOVEA_ERROR_INPUT, "found 20, expected [0.05, 10]");
    assert_near(see(source, 0).mean, before / 2, 0.02);
    assert_near(see(source, 1).mean, before / 2, 0.02);
    close_source(source);
}

static void a_recording_refuses(void **state)
{
    struct fovea_source *source =
        open_source("sequence:sim:orbit?frames=2 then sim:orbit?frames=2");
    (void)state;
    assert_refused(source, EXPOSURE, 5, FOVEA_ERROR_UNSUPPORTED,
                   "sequence: found a recording, expected a camera whose exposure can be set");
    ops->close(source);
    source = open_source("fault:sequence:sim:orbit?frames=2 then sim:orbit?frames=2?kind=black");
    assert_refused(source, GAIN, 5, FOVEA_ERROR_UNSUPPORTED, "camera whose gain can be set");
    ops->close(source);
}

/* ---- V4L2 ------------------------------------------------------------------------------------ */

static struct fake_camera *camera;

/* The first frame says that it is set up. */
static struct fovea_source *start_camera(const char *uri)
{
    struct fovea_source *source = start_source(uri);
    fv_test_next_frame(source);
    return source;
}

static int64_t value_of(uint32_t id)
{
    fake_lock();
    const int64_t value = fake_control(camera, id)->value;
    fake_unlock();
    return value;
}

static struct fake_control *find_control(uint32_t id)
{
    for (int i = 0; i < FAKE_CONTROLS_MAX; i++)
        if (camera->controls[i].id == id) return &camera->controls[i];
    fail_msg("the fake has no control %x", id);
    return NULL;
}

static int plug(void **state)
{
    const int failed = fake_set_up(state);
    camera = fake_new();
    fake_plug(camera, "/dev/video0");
    return failed;
}

static void assert_camera(int64_t mode, int64_t exposure, int64_t automatic, int64_t gain)
{
    assert_int_equal(value_of(V4L2_CID_EXPOSURE_AUTO), mode);
    assert_int_equal(value_of(V4L2_CID_EXPOSURE_ABSOLUTE), exposure);
    assert_int_equal(value_of(V4L2_CID_AUTOGAIN), automatic);
    assert_int_equal(value_of(V4L2_CID_GAIN), gain);
}

static void a_device_is_told(void **state)
{
    (void)state;
    find_control(V4L2_CID_EXPOSURE_AUTO)->value = V4L2_EXPOSURE_APERTURE_PRIORITY;
    find_control(V4L2_CID_AUTOGAIN)->value = 1;
    const int64_t own = value_of(V4L2_CID_EXPOSURE_ABSOLUTE), gain = value_of(V4L2_CID_GAIN);
    struct fovea_source *source = start_camera("v4l2:/dev/video0?format=GREY");
    fv_test_next_frame(source);
    assert_int_equal(fv_test_next_frame(source).exposure_ns[0], 0); /* automatic: not known */
    set_control(source, EXPOSURE, 7.3);
    assert_camera(V4L2_EXPOSURE_MANUAL, 73, 1, gain);
    set_control(source, GAIN, 99);
    assert_camera(V4L2_EXPOSURE_MANUAL, 73, 0, 99);
    for (int i = 0; i < 20; i++) /* those that were filled before go by */
        fv_test_next_frame(source);
    assert_int_equal(fv_test_next_frame(source).exposure_ns[0], 7300000);
    /* Back to what it was. */
    set_control(source, EXPOSURE, 0);
    set_control(source, GAIN, -1);
    assert_camera(V4L2_EXPOSURE_APERTURE_PRIORITY, own, 1, gain);
    close_source(source);
}

/* Back to what the address says, which is not what the camera was set to. */
static void the_address_holds_again(void **state)
{
    (void)state;
    struct fovea_source *source = start_camera("v4l2:/dev/video0?exposure=5&gain=40");
    set_control(source, EXPOSURE, 9);
    set_control(source, GAIN, 50);
    assert_camera(V4L2_EXPOSURE_MANUAL, 90, 0, 50);
    set_control(source, EXPOSURE, 0);
    set_control(source, GAIN, -1);
    assert_camera(V4L2_EXPOSURE_MANUAL, 50, 0, 40);
    close_source(source);
}

static void a_refusal_leaves_it_as_it_was(void **state)
{
    (void)state;
    find_control(V4L2_CID_EXPOSURE_AUTO)->value = V4L2_EXPOSURE_APERTURE_PRIORITY;
    struct fovea_source *source = start_camera("v4l2:/dev/video0?auto_gain=1");
    const int64_t own = value_of(V4L2_CID_EXPOSURE_ABSOLUTE), gain = value_of(V4L2_CID_GAIN);
    assert_refused(source, EXPOSURE, 9999, FOVEA_ERROR_INPUT, "exposure (ms): found 9999");
    assert_refused(source, GAIN, 256, FOVEA_ERROR_INPUT, "gain: found 256, expected [0, 255]");
    assert_camera(V4L2_EXPOSURE_APERTURE_PRIORITY, own, 1, gain);
    fake_lock();
    find_control(V4L2_CID_EXPOSURE_ABSOLUTE)->refuses = EIO;
    fake_unlock();
    assert_refused(source, EXPOSURE, 5, FOVEA_ERROR_INPUT, "exposure: the camera refuses 50");
    assert_int_equal(value_of(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_APERTURE_PRIORITY);
    close_source(source);
}

/* What the camera makes of a value is said, and it holds where the camera goes and comes. */
static void it_holds_when_the_camera_comes_back(void **state)
{
    (void)state;
    camera->grain = 8;
    struct fovea_source *source = start_camera("v4l2:/dev/video0");
    set_control(source, GAIN, 77);
    assert_non_null(strstr(said.text, "gain: asked 77, the camera gives 72"));
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    assert_refused(source, GAIN, 80, FOVEA_GONE, "the camera is away");
    find_control(V4L2_CID_GAIN)->value = 0;
    fake_plug(camera, "/dev/video0");
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
    assert_int_equal(value_of(V4L2_CID_GAIN), 72);
    close_source(source);
}

/* The driver's own automatic gain ends with a gain, and begins again without one. */
static void a_gain_ends_our_automatism(void **state)
{
    (void)state;
    find_control(V4L2_CID_AUTOGAIN)->id = V4L2_CID_HUE;
    struct fovea_source *source = start_camera("v4l2:/dev/video0?auto_gain=1&format=GREY");
    set_control(source, GAIN, 200);
    for (int i = 0; i < 40; i++)
        fv_test_next_frame(source);
    assert_int_equal(value_of(V4L2_CID_GAIN), 200);
    set_control(source, GAIN, -1);
    for (int i = 0; i < 200 && value_of(V4L2_CID_GAIN) == 200; i++)
        fv_test_next_frame(source);
    assert_int_not_equal(value_of(V4L2_CID_GAIN), 200);
    close_source(source);
}

static void before_the_start(void **state)
{
    (void)state;
    struct fovea_source *source = open_source("v4l2:/dev/video0");
    set_control(source, GAIN, 33);
    assert_int_equal(value_of(V4L2_CID_GAIN), 33);
    find_control(V4L2_CID_GAIN)->value = 0;
    assert_int_equal(ops->start(source, &said), FOVEA_OK);
    fv_test_next_frame(source);
    assert_int_equal(value_of(V4L2_CID_GAIN), 33);
    close_source(source);
}

#define DEVICE(name) cmocka_unit_test_setup_teardown(name, plug, fake_tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_simulated_camera_gets_brighter),
        cmocka_unit_test(noise_rises_with_gain),
        cmocka_unit_test(blur_follows_the_exposure),
        cmocka_unit_test(faults_pass_it_on),
        cmocka_unit_test(a_pair_changes_both_or_none),
        cmocka_unit_test(a_recording_refuses),
        DEVICE(a_device_is_told),
        DEVICE(the_address_holds_again),
        DEVICE(a_refusal_leaves_it_as_it_was),
        DEVICE(it_holds_when_the_camera_comes_back),
        DEVICE(a_gain_ends_our_automatism),
        DEVICE(before_the_start),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
