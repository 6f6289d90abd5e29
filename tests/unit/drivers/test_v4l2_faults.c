/* The V4L2 driver on a fake device that does what cameras do at their worst. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <string.h>
#include <time.h>

#include "common/fake_camera.h"
#include "common/live_source.h"

static const struct fovea_source_ops *const ops = &fv_source_v4l2;

/* ---- faults ---------------------------------------------------------------------------------- */

static void test_damaged_frames(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    camera->rate_hz = 0;
    camera->error_every = 5;
    camera->truncate_every = 7;
    camera->drop_every = 11;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0?format=YUYV");
    uint64_t last = 0;
    for (int i = 0; i < 200; i++) {
        const struct fovea_frame frame = fv_test_next_frame(source);
        assert_true(i == 0 || frame.sequence > last);
        last = frame.sequence;
    }
    /* Every number up to the last is a delivered, a damaged or a dropped frame. */
    struct fovea_source_counts counts = fv_test_counts(source);
    assert_true(counts.damaged >= 80 && counts.dropped >= 20);
    assert_true(counts.delivered + counts.damaged + counts.dropped >= last + 1);
    assert_true(counts.recovered == 0);
    assert_true(fv_test_complains_of(source, "damaged") ||
                fv_test_complains_of(source, "expected 12288"));
    fv_test_finish(source);
    /* Nothing but damaged frames: the camera is set up again and again, the loop learns it. */
    camera->error_every = 1;
    source = fv_test_start("/dev/video0");
    assert_true(fv_test_complains_of(source, "30 damaged frames in a row"));
    fake_lock();
    camera->error_every = 0;
    fake_unlock();
    fv_test_next_frame(source);
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
    fv_test_finish(source);
}

static void test_sequence_wraps(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    camera->sequence = 4294967290u;
    struct fovea_source *source = fv_test_start("/dev/video0");
    for (uint64_t i = 0; i < 20; i++)
        assert_true(fv_test_next_frame(source).sequence >= i);
    assert_true(fv_test_counts(source).dropped == 0);
    fv_test_finish(source);
}

/* Faults of set-up and of streaming that the driver gets over by setting the camera up again. */
static void test_failing_calls(void **state)
{
    (void)state;
    static const struct {
        unsigned long request;
        int reason;
        bool streaming; /* comes while frames flow */
        const char *says;
    } rows[] = {
        {VIDIOC_REQBUFS, EINVAL, false, "asking for buffers"},
        {VIDIOC_QUERYBUF, EINVAL, false, "mapping a buffer"},
        {VIDIOC_QBUF, EINVAL, false, "giving back a buffer"},
        {VIDIOC_STREAMON, EINVAL, false, "starting to stream"},
        {VIDIOC_STREAMON, ENOSPC, false, "no room on the bus"},
        {VIDIOC_STREAMON, EPIPE, false, "starting to stream"},
        {VIDIOC_S_FMT, EBUSY, false, "another program"},
        {VIDIOC_G_FMT, EIO, false, "asking for its format"},
        {VIDIOC_QUERYCAP, EIO, false, "asking for it"},
        {VIDIOC_S_EXT_CTRLS, EPIPE, false, "refuses"},
        {VIDIOC_QBUF, EIO, true, "giving back a buffer"},
        {VIDIOC_DQBUF, EIO, true, "taking a frame"},
        {VIDIOC_DQBUF, EPIPE, true, "taking a frame"},
        {0, EACCES, false, "group video"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        fake_begin();
        struct fake_camera *camera = fake_new();
        fake_plug(camera, "/dev/video0");
        struct fovea_source *source = fv_test_open("/dev/video0?gain=3");
        struct fovea_error error;
        fake_lock();
        if (!rows[i].streaming) fake_fail(camera, rows[i].request, rows[i].reason, 2);
        fake_unlock();
        assert_int_equal(ops->start(source, &error), FOVEA_OK);
        if (rows[i].request == 0) { /* permission comes with udev, some time after the node */
            assert_true(fv_test_complains_of(source, rows[i].says));
            fake_lock();
            camera->failures[0].times = 0;
            fake_unlock();
        }
        fv_test_next_frame(source);
        if (rows[i].streaming) {
            fake_lock();
            fake_fail(camera, rows[i].request, rows[i].reason, 1);
            fake_unlock();
            if (rows[i].request == VIDIOC_QBUF)
                fv_test_next_frame(source); /* so that a buffer is given back */
        }
        if (rows[i].request != 0 && !fv_test_complains_of(source, rows[i].says))
            fail_msg("nothing of %s", rows[i].says);
        fv_test_next_frame(source);
        fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
        if (rows[i].streaming) assert_true(fv_test_counts(source).recovered == 1);
        fv_test_finish(source);
        fake_end();
    }
    fake_begin();
}

static void test_fatal_error_and_source_change(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0");
    fv_test_next_frame(source);
    fake_lock();
    camera->fatal = true;
    fake_unlock();
    assert_true(fv_test_complains_of(source, "taking a frame"));
    fv_test_next_frame(source);
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
    fake_lock();
    camera->source_change = true;
    fake_unlock();
    assert_true(fv_test_complains_of(source, "source has changed"));
    fv_test_next_frame(source);
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
    assert_true(fv_test_counts(source).recovered == 2);
    fv_test_finish(source);
}

static void test_silence(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    struct fovea_frame frame;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0");
    fv_test_next_frame(source);
    fake_lock();
    camera->silent = true;
    fake_unlock();
    fv_test_wait_for_state(source, FOVEA_SOURCE_LATE);
    const int64_t before_ns = fv_test_now_ns(); /* the deadline is kept */
    while (ops->dequeue(source, 0, &frame) == FOVEA_OK)
        ops->requeue(source, &frame);
    assert_int_equal(ops->dequeue(source, fv_test_now_ns() + 5000000, &frame), FOVEA_AGAIN);
    assert_true(fv_test_now_ns() - before_ns >= 5000000);
    fv_test_wait_for_state(source, FOVEA_SOURCE_STALLED);
    fv_test_wait_for_state(source, FOVEA_SOURCE_RETURNING); /* set up again */
    assert_true(fv_test_complains_of(source, "no frame for"));
    fake_lock();
    camera->silent = false;
    fake_unlock();
    fv_test_wait_for_state(source, FOVEA_SOURCE_OK);
    assert_true(fv_test_counts(source).recovered == 1);
    fv_test_finish(source);
}

/* A loop that takes nothing for longer than silence is borne is no fault of the camera. */
static void test_loop_away(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0?rate=100");
    struct fovea_error error;
    fv_test_next_frame(source);
    nanosleep(&(struct timespec){.tv_sec = 1, .tv_nsec = 500000000}, NULL);
    assert_true(ops->state(source) <= FOVEA_SOURCE_LATE); /* it looks every 100 ms */
    for (int i = 0; i < 20; i++)
        fv_test_next_frame(source);
    assert_int_equal(fv_test_counts(source).recovered, 0);
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    fv_test_finish(source);
}

static void test_unplug(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new(), *other = fake_new();
    struct fovea_frame frame;
    camera->serial = "A1";
    other->serial = "B2";
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0");
    fv_test_next_frame(source);
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    assert_int_equal(ops->dequeue(source, fv_test_now_ns() + 2000000, &frame), FOVEA_GONE);
    fake_plug(camera, "/dev/video4"); /* under another number */
    fv_test_next_frame(source);
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    fake_plug(other, "/dev/video0"); /* another of the same make in its place is not taken */
    assert_true(fv_test_complains_of(source, "/dev/video0: found 'Fake camera'"));
    assert_int_equal(ops->state(source), FOVEA_SOURCE_GONE);
    fake_plug(camera, "/dev/video1");
    fv_test_next_frame(source);
    assert_true(fv_test_counts(source).recovered == 2);
    fv_test_finish(source);
    assert_true(other->frames == 0);
}

static void test_unplug_without_serial(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new(), *twin = fake_new();
    camera->serial = twin->serial = "0001"; /* as many makers do: not a number at all */
    twin->bus_info = "usb-fake-2";
    fake_plug(camera, "/dev/video0");
    fake_plug(twin, "/dev/video1");
    struct fovea_source *source = fv_test_start("/dev/video0");
    fv_test_next_frame(source);
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
    assert_int_equal(ops->state(source), FOVEA_SOURCE_GONE);
    assert_true(twin->frames == 0);
    fake_plug(camera, "/dev/video2");
    fv_test_next_frame(source);
    fv_test_finish(source);
}

static void test_links(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new(), *other = fake_new();
    other->card = "Other camera";
    other->name = "Other camera: video";
    fake_link("/dev/v4l/by-id/usb-fake-index0", camera);
    fake_link("/dev/v4l/by-path/usb-port1-index0", camera);
    fake_plug(camera, "/dev/video3");
    const char *const names[] = {"/dev/v4l/by-id/usb-fake-index0",
                                 "/dev/v4l/by-path/usb-port1-index0"};
    for (int i = 0; i < 2; i++) {
        struct fovea_source *source = fv_test_start(names[i]);
        fv_test_next_frame(source);
        fake_unplug(camera);
        fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
        fake_plug(other, "/dev/video3");
        fake_plug(camera, "/dev/video5");
        fv_test_next_frame(source);
        fv_test_finish(source);
        fake_unplug(other);
    }
    assert_true(other->frames == 0);
}

static void test_comes_back_different(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    camera->any_size = true;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0?width=96&height=64&gain=9");
    fv_test_next_frame(source);
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    camera->width_now = 128; /* the driver changes the frame size */
    fake_plug(camera, "/dev/video0");
    assert_true(
        fv_test_complains_of(source, "found 128 x 64 pixels after it came back, expected 96 x 64"));
    fv_test_wait_for_state(source, FOVEA_SOURCE_STALLED);
    fake_lock();
    camera->width_now = 0;
    camera->controls[1].refuses =
        EPIPE; /* and now a control: frames come all the same, and it is named */
    fake_unlock();
    fv_test_next_frame(source);
    assert_true(fv_test_complains_of(source, "gain: the camera refuses 9"));
    fv_test_finish(source);
}

static void test_unplug_while_starting(void **state)
{
    (void)state;
    static const unsigned long requests[] = {VIDIOC_QUERYCAP, VIDIOC_G_FMT,       VIDIOC_S_FMT,
                                             VIDIOC_G_PARM,   VIDIOC_S_EXT_CTRLS, VIDIOC_REQBUFS,
                                             VIDIOC_QUERYBUF, VIDIOC_QBUF,        VIDIOC_STREAMON};
    for (size_t i = 0; i < sizeof requests / sizeof requests[0]; i++) {
        fake_begin();
        struct fake_camera *camera = fake_new();
        fake_plug(camera, "/dev/video0");
        struct fovea_source *source = fv_test_open("/dev/video0?gain=3");
        struct fovea_error error;
        fake_lock();
        fake_fail(camera, requests[i], ENODEV, 1);
        fake_unlock();
        assert_int_equal(ops->start(source, &error), FOVEA_OK);
        fv_test_next_frame(source);
        fv_test_finish(source);
        fake_end();
    }
    fake_begin();
    struct fake_camera *camera = fake_new();
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_open("/dev/video0");
    struct fovea_error error;
    fake_unplug(camera); /* between open and start */
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    fake_plug(camera, "/dev/video0");
    fv_test_next_frame(source);
    fv_test_finish(source);
}

/* A frame that the loop holds stays as it is while the camera is unplugged and comes back. */
static void test_held_over_unplug(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    struct fovea_frame held, more;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0");
    assert_int_equal(ops->dequeue(source, fv_test_now_ns() + 60000000000, &held), FOVEA_OK);
    fake_unplug(camera);
    fv_test_wait_for_state(source, FOVEA_SOURCE_GONE);
    fake_plug(camera, "/dev/video0");
    while (ops->dequeue(source, fv_test_now_ns() + 100000000, &more) ==
           FOVEA_OK) /* what was under way */
        ops->requeue(source, &more);
    for (size_t k = 0; k < held.images[0].size_bytes; k++)
        assert_int_equal(held.images[0].data[k], (uint8_t)(k + 37 * (size_t)held.sequence));
    ops->requeue(source, &held); /* only now is the camera set up again */
    fv_test_next_frame(source);
    assert_true(fv_test_counts(source).recovered == 1);
    fv_test_finish(source);
}

static void test_few_buffers(void **state)
{
    (void)state;
    struct fake_camera *camera = fake_new();
    struct fovea_frame held[2], more;
    camera->rate_hz = 0;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0?buffers=3");
    for (int i = 0; i < 2; i++)
        assert_int_equal(ops->dequeue(source, fv_test_now_ns() + 60000000000, &held[i]), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &more), FOVEA_AGAIN);
    nanosleep(&(struct timespec){.tv_nsec = 50000000},
              NULL); /* the driver has no buffer: no error, no spinning */
    ops->requeue(source, &held[0]);
    ops->requeue(source, &held[1]);
    for (int i = 0; i < 10; i++)
        fv_test_next_frame(source);
    assert_true(fv_test_counts(source).recovered == 0);
    fv_test_finish(source);
    camera->buffers_max = 2;
    source = fv_test_start("/dev/video0");
    assert_true(fv_test_complains_of(source, "found 2 buffers, expected at least 3"));
    fv_test_wait_for_state(source, FOVEA_SOURCE_STALLED);
    fv_test_finish(source);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, fake_set_up, fake_tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_damaged_frames),
        TEST(test_sequence_wraps),
        TEST(test_failing_calls),
        TEST(test_fatal_error_and_source_change),
        TEST(test_silence),
        TEST(test_loop_away),
        TEST(test_unplug),
        TEST(test_unplug_without_serial),
        TEST(test_links),
        TEST(test_comes_back_different),
        TEST(test_unplug_while_starting),
        TEST(test_held_over_unplug),
        TEST(test_few_buffers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
