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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_change_is_reported_once_with_its_time),
        cmocka_unit_test(test_the_ribbon_keeps_the_worst_state_of_a_bin),
        cmocka_unit_test(test_changes_that_nobody_takes_are_counted),
        cmocka_unit_test(test_a_run_without_frames_says_so),
        cmocka_unit_test(test_a_wrong_mount_is_noted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
