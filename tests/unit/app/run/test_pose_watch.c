/* What the terminal reports about the pose, held against the runtime's own state frame by frame:
 * every change once and in order, the time in each state, pauses, the ribbon, the reasons. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/run/pose_watch.h"
#include "base/elementary.h"
#include "common/sim_rig.h"
#include "geometry/se3.h"
#include "runtime/state.h"

static struct sim_rig rig;
static struct fv_watch watch;

enum { FRAMES = 60, PERIOD_NS = 33333333 };

/* One frame of the simulated camera with these commands, noted by the watch. */
static void iterate(uint32_t commands)
{
    struct fovea_outputs outputs;
    assert_true(sim_rig_next(&rig));
    rig.inputs.commands = commands;
    const bool processed = fovea_step(rig.rt, &rig.inputs, &outputs) == FOVEA_OK;
    fv_watch_step(&watch, rig.rt, &rig.inputs, processed);
    rig.ops->requeue(rig.source, &rig.frame);
    (void)fovea_work(rig.rt, &rig.inputs.grants, &outputs);
}

static enum fv_watch_state expected_state(void)
{
    static const enum fv_watch_state states[] = {
        [FOVEA_TRACKING_STARTING] = FV_WATCH_STARTING, [FOVEA_TRACKING_OK] = FV_WATCH_TRACKING,
        [FOVEA_TRACKING_WEAK] = FV_WATCH_WEAK,         [FOVEA_TRACKING_LOST] = FV_WATCH_LOST,
        [FOVEA_TRACKING_COASTING] = FV_WATCH_COASTING,
    };
    struct fovea_pose pose;
    fovea_pose_get(rig.rt, &pose);
    return states[pose.state];
}

static int64_t total_ns(void)
{
    int64_t sum = 0;
    for (int i = 0; i < FV_WATCH_STATES; i++)
        sum += watch.total_ns[i];
    return sum;
}

static void test_each_change_is_reported_once_with_its_time(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit", 0, FRAMES);
    sim_rig_build(&rig);
    fv_watch_open(&watch, true, false);
    enum fv_watch_state before = FV_WATCH_WAITING;
    struct fv_watch_change change;
    int changes = 0;
    assert_false(fv_watch_take(&watch, &change));
    for (uint64_t frame = 1; frame <= FRAMES; frame++) {
        iterate(frame == 41 ? FOVEA_COMMAND_PAUSE : frame == 51 ? FOVEA_COMMAND_RESUME : 0);
        const enum fv_watch_state now =
            frame > 40 && frame <= 50 ? FV_WATCH_PAUSED : expected_state();
        if (now != before) {
            assert_true(fv_watch_take(&watch, &change));
            assert_int_equal(change.from, before);
            assert_int_equal(change.to, now);
            assert_int_equal(change.frame, frame);
            assert_in_range(change.at_ns, (frame - 1) * (PERIOD_NS - 10),
                            (frame - 1) * PERIOD_NS + 1000);
            before = now;
            changes++;
        }
        assert_false(fv_watch_take(&watch, &change));
        assert_int_equal(watch.ribbon.state[frame - 1], now);
    }
    assert_in_range(changes, 5, FRAMES); /* starting, weak, tracking, paused, and out of it */
    assert_int_equal(watch.ribbon.bins, FRAMES);
    fv_watch_close(&watch);
    assert_in_range(watch.total_ns[FV_WATCH_PAUSED], 9 * PERIOD_NS, 11 * PERIOD_NS);
    assert_int_equal(total_ns(), watch.last_ns - watch.first_ns);
    assert_int_equal(atomic_load(&watch.changes_lost), 0);
    sim_rig_close(&rig);
}

/* The ribbon of a run that is far longer than it has bins. */
static void test_the_ribbon_keeps_the_worst_state_of_a_bin(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=64&height=64", 0, FRAMES);
    rig.config.odometry.enabled = false;
    sim_rig_build(&rig);
    fv_watch_open(&watch, false, false);
    iterate(0);
    assert_int_equal(watch.ribbon.state[0], FV_WATCH_RUNNING);
    struct fovea_inputs inputs = rig.inputs; /* frames that the runtime does not see */
    for (int i = 1; i < 4 * FV_WATCH_BINS; i++) {
        watch.paused = i == 2000;
        fv_watch_step(&watch, rig.rt, &inputs, i != 2000);
    }
    assert_int_equal(watch.ribbon.stride, 4);
    assert_int_equal(watch.ribbon.bins, FV_WATCH_BINS);
    for (uint32_t i = 0; i < FV_WATCH_BINS; i++)
        assert_int_equal(watch.ribbon.state[i], i == 500 ? FV_WATCH_PAUSED : FV_WATCH_RUNNING);
    assert_null(fv_watch_why_no_pose(&watch, false));
    sim_rig_close(&rig);
}

static void test_changes_that_nobody_takes_are_counted(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=64&height=64", 0, FRAMES);
    sim_rig_build(&rig);
    fv_watch_open(&watch, true, false);
    iterate(0);
    const struct fovea_inputs inputs = rig.inputs;
    int changes = 1;
    for (; changes < 3 * FV_WATCH_CHANGES_MAX; changes++) {
        watch.paused = changes % 2 == 1;
        fv_watch_step(&watch, rig.rt, &inputs, changes % 2 == 0);
    }
    struct fv_watch_change change;
    int taken = 0;
    while (fv_watch_take(&watch, &change))
        taken++;
    assert_in_range(taken, FV_WATCH_CHANGES_MAX / 2, FV_WATCH_CHANGES_MAX);
    assert_int_equal(taken + (int)atomic_load(&watch.changes_lost), changes);
    sim_rig_close(&rig);
}

static void test_a_run_without_frames_says_so(void **state)
{
    (void)state;
    fv_watch_open(&watch, true, true);
    fv_watch_close(&watch);
    assert_string_equal(fv_watch_why_no_pose(&watch, false), "no frame was processed");
}

/* What the loop finds of the mount is noted once, in thousandths of a degree. */
static void test_a_wrong_mount_is_noted(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=320&height=240&rate=20&imu=200", 0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    sim_rig_build(&rig);
    fv_watch_open(&watch, true, false);
    iterate(0);
    assert_int_equal(atomic_load(&watch.imu_turned_mdeg), 0);
    rig.rt->inertial.clock->mount_wrong = true;
    fv_so3_exp((const double[3]){0, 0.1, 0}, rig.rt->inertial.clock->mounted.mount);
    iterate(0);
    assert_in_range(atomic_load(&watch.imu_turned_mdeg), 5700, 5760);
    assert_true(atomic_load(&watch.imu_turned_sigma_mdeg) > 0);
    fv_watch_close(&watch);
    sim_rig_close(&rig);
}

enum pictures { AS_SEEN, GREY, HALF_NOISE, NOISE };

/* The picture of this frame, or what stands in its place: other noise in each. */
static void draw(uint8_t pixels[320 * 240], enum pictures pictures, struct fv_random *random)
{
    const int from = pictures == NOISE ? 0 : pictures == HALF_NOISE ? 320 * 120 : 320 * 240;
    memcpy(pixels, rig.frame.images[0].data, 320 * 240);
    if (pictures == GREY) memset(pixels, 100, 320 * 240);
    for (int i = from; i < 320 * 240; i++)
        pixels[i] = (uint8_t)fv_random_below(random, 256);
    rig.frame.images[0].data = pixels;
}

/* The reason why 40 frames of a camera that turns on the spot have no pose, with at most `features`
 * in a picture. */
static const char *why_without_pose(uint32_t features, enum pictures pictures)
{
    static uint8_t pixels[320 * 240];
    struct fv_random random;
    fv_random_seed(&random, 1);
    sim_rig_open(&rig, "sim:rotate?width=320&height=240", 0, 40);
    rig.config.features.count_max = features;
    sim_rig_build(&rig);
    fv_watch_open(&watch, true, false);
    while (sim_rig_next(&rig)) {
        draw(pixels, pictures, &random);
        sim_rig_process(&rig);
        fv_watch_step(&watch, rig.rt, &rig.inputs, true);
        assert_false(rig.pose[rig.frames - 1].posed);
    }
    fv_watch_close(&watch);
    sim_rig_close(&rig);
    return fv_watch_why_no_pose(&watch, false);
}

/* The reason names what is missing. With few features in a picture it is enough that a quarter of
 * them is found again (odometry/initialise.c): then the motion is missing. */
static void test_the_reason_is_what_is_missing(void **state)
{
    (void)state;
    static const struct {
        uint32_t features;
        enum pictures pictures;
        const char *why;
    } cases[] = {
        {1000, GREY, "too few corners in the images"},
        {1000, NOISE, "too few corners were found again from image to image"},
        {1000, AS_SEEN, "never enough parallax"},
        {2000, HALF_NOISE, "never enough parallax"}, /* below a quarter, and enough */
        {200, AS_SEEN, "never enough parallax"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *why = why_without_pose(cases[i].features, cases[i].pictures);
        assert_non_null(why);
        assert_ptr_equal(strstr(why, cases[i].why), why);
    }
    assert_in_range(rig.pose[39].matches, 50, FOVEA_START_MATCHES_MIN - 1); /* few, of the last */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_change_is_reported_once_with_its_time),
        cmocka_unit_test(test_the_ribbon_keeps_the_worst_state_of_a_bin),
        cmocka_unit_test(test_changes_that_nobody_takes_are_counted),
        cmocka_unit_test(test_a_run_without_frames_says_so),
        cmocka_unit_test(test_a_wrong_mount_is_noted),
        cmocka_unit_test(test_the_reason_is_what_is_missing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
