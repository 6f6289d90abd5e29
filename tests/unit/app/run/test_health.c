/* The health of a run: what the machine states in a sysfs of files, how much work it is then given,
 * the word and the reason of each part, and the self-test. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "app/run/health.h"
#include "app/run/run.h"
#include "app/run/self_test.h"
#include "common/fresh_root.h"
#include "drivers/clock.h"
#include "support/lcmlog.h"

#define ZONE "/sys/class/thermal/thermal_zone"

static void test_host_is_read(void **state)
{
    (void)state;
    struct fv_host host;
    fv_host_read(root, 0, &host);
    assert_true(isnan(host.temperature_c) && isnan(host.trip_c) && host.throttled == 0);
    put(ZONE "0/temp", "91000\n");
    put(ZONE "0/type", "battery\n");
    fv_host_read(root, 0, &host);
    assert_true(host.temperature_c == 91 && isnan(host.trip_c));
    /* A zone of the processor counts before hotter ones of other things. */
    put(ZONE "2/temp", "61500\n");
    put(ZONE "2/type", "cpu-thermal\n");
    put(ZONE "2/trip_point_0_type", "active\n");
    put(ZONE "2/trip_point_0_temp", "40000\n");
    put(ZONE "2/trip_point_1_type", "critical\n");
    put(ZONE "2/trip_point_1_temp", "110000\n");
    put(ZONE "2/trip_point_2_type", "passive\n");
    put(ZONE "2/trip_point_2_temp", "75000\n");
    put("/sys/devices/platform/soc@107c000000/soc@107c000000:firmware/get_throttled", "50005\n");
    fv_host_read(root, 0, &host);
    assert_true(host.temperature_c == 61.5f && host.trip_c == 75);
    assert_int_equal(host.throttled, FV_HOST_UNDER_VOLTAGE | FV_HOST_THROTTLED);
    assert_true(fv_host_limit_c(&host, 0) == 75 && fv_host_limit_c(&host, 70) == 70);
}

/* What no sensor can mean counts as no zone at all. */
static void test_odd_temperatures(void **state)
{
    (void)state;
    static const char *const odd[] = {"nonsense\n",
                                      "",
                                      "255000\n",
                                      "-274000\n",
                                      "9223372036854775807\n",
                                      "99999999999999999999\n",
                                      "61500 or so\n"};
    struct fv_host host;
    put(ZONE "0/type", "cpu-thermal\n");
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        put(ZONE "0/temp", odd[i]);
        fv_host_read(root, 0, &host);
        assert_true(isnan(host.temperature_c));
        assert_int_equal(fv_host_share(&host, 0, 100), 100);
    }
    put(ZONE "0/temp", "-12000");
    put(ZONE "0/trip_point_0_type", "passive\n");
    put(ZONE "0/trip_point_0_temp", "nonsense\n");
    fv_host_read(root, 0, &host);
    assert_true(host.temperature_c == -12 && isnan(host.trip_c));
}

/* At a critical trip point the machine is switched off: less work is granted well before. */
static void test_critical_alone(void **state)
{
    (void)state;
    static const struct {
        const char *critical;
        float limit_c;
    } zones[] = {{"115000\n", 80}, {"90000\n", 80}, {"85000\n", 75}};
    struct fv_host host;
    put(ZONE "0/type", "cpu-thermal\n");
    put(ZONE "0/temp", "79000\n");
    put(ZONE "0/trip_point_0_type", "critical\n");
    for (size_t i = 0; i < sizeof zones / sizeof *zones; i++) {
        put(ZONE "0/trip_point_0_temp", zones[i].critical);
        fv_host_read(root, 0, &host);
        assert_true(fv_host_limit_c(&host, 0) == zones[i].limit_c);
        assert_int_equal(fv_host_share(&host, 0, 100), 50);
    }
    put(ZONE "0/trip_point_1_type", "hot\n");
    put(ZONE "0/trip_point_1_temp", "95000\n");
    fv_host_read(root, 0, &host);
    assert_true(host.trip_c == 95);
}

/* Not the hottest zone of the processor counts, but the one that is nearest to its limit. */
static void test_nearest_zone(void **state)
{
    (void)state;
    struct fv_host host;
    for (int zone = 0; zone < 2; zone++) {
        char path[96];
        snprintf(path, sizeof path, ZONE "%d/type", zone);
        put(path, zone == 0 ? "bigcore0-thermal\n" : "Package-thermal\n");
        snprintf(path, sizeof path, ZONE "%d/temp", zone);
        put(path, zone == 0 ? "75000\n" : "74000\n");
        snprintf(path, sizeof path, ZONE "%d/trip_point_0_type", zone);
        put(path, "passive\n");
        snprintf(path, sizeof path, ZONE "%d/trip_point_0_temp", zone);
        put(path, zone == 0 ? "105000\n" : "75000\n");
    }
    fv_host_read(root, 0, &host);
    assert_true(host.temperature_c == 74 && host.trip_c == 75 && !host.other);
    assert_int_equal(fv_host_share(&host, 0, 100), 50);
    fv_host_read(root, 84, &host); /* one limit for all */
    assert_true(host.temperature_c == 75);
}

/* A hot battery or radio is shown, and takes no work away. */
static void test_other_zones(void **state)
{
    (void)state;
    struct fv_host host;
    put(ZONE "0/type", "wifi\n");
    put(ZONE "0/temp", "60000\n");
    put(ZONE "1/type", "battery\n");
    put(ZONE "1/temp", "91000\n");
    put(ZONE "1/trip_point_0_type", "passive\n");
    put(ZONE "1/trip_point_0_temp", "50000\n");
    fv_host_read(root, 0, &host);
    assert_true(host.temperature_c == 91 && host.other);
    assert_int_equal(fv_host_share(&host, 0, 100), 100);
    assert_int_equal(fv_host_share(&host, 60, 100), 100);
    put(ZONE "2/type", "soc-thermal\n");
    put(ZONE "2/temp", "79000\n");
    fv_host_read(root, 0, &host);
    assert_true(host.temperature_c == 79 && !host.other);
    assert_int_equal(fv_host_share(&host, 0, 100), 50);
}

static uint32_t share_at(float celsius, uint32_t throttled, uint32_t before)
{
    const struct fv_host host = {.temperature_c = celsius, .trip_c = NAN, .throttled = throttled};
    return fv_host_share(&host, 0, before);
}

static void test_heat_takes_work_away(void **state)
{
    (void)state;
    assert_int_equal(share_at(NAN, 0, 100), 100);
    assert_int_equal(share_at(70, 0, 100), 100); /* without a trip point the limit is 80 */
    assert_int_equal(share_at(74, 0, 100), 75);
    assert_int_equal(share_at(78, 0, 100), 50);
    assert_int_equal(share_at(95, 0, 100), 50);
    assert_int_equal(share_at(40, FV_HOST_THROTTLED, 100), 50);
    assert_int_equal(share_at(40, FV_HOST_SOFT_LIMIT, 100), 50);
    assert_int_equal(share_at(40, FV_HOST_UNDER_VOLTAGE, 100), 100);
    assert_int_equal(share_at(40, 0, 50), 51); /* slowly up */
    for (float c = 60; c < 90; c += 0.25f)
        assert_true(share_at(c + 0.25f, 0, 100) <= share_at(c, 0, 100));
}

static struct fv_health_facts well(void)
{
    return (struct fv_health_facts){.self_test = "",
                                    .silence_ns = 1000000000,
                                    .imu_state = FOVEA_IMU_OK,
                                    .pose = FV_WATCH_TRACKING,
                                    .has_network = true,
                                    .publishes = true,
                                    .sends = true,
                                    .records = true,
                                    .unlocked = "",
                                    .host = {.temperature_c = 50, .trip_c = NAN},
                                    .share = 100};
}

/* One part is of this state, with this reason; all others are well. */
static void expect(const struct fv_health_facts *facts, const char *name,
                   enum fv_health_state state, const char *reason)
{
    struct fv_health health;
    bool found = false;
    fv_health_judge(facts, &health);
    assert_int_equal(fv_health_worst(&health), state);
    for (uint32_t i = 0; i < health.count; i++) {
        const bool it = strcmp(health.parts[i].name, name) == 0;
        found |= it;
        assert_int_equal(health.parts[i].state, it ? state : FV_HEALTH_OK);
        assert_string_equal(health.parts[i].reason, it ? reason : "");
    }
    assert_true(found);
}

static void test_parts(void **state)
{
    (void)state;
    struct fv_health_facts facts = well();
    struct fv_health health;
    fv_health_judge(&facts, &health);
    assert_int_equal(health.count, FV_HEALTH_PARTS_MAX);
    assert_int_equal(fv_health_worst(&health), FV_HEALTH_OK);
    facts.self_test = "wrong bits";
    expect(&facts, "self_test", FV_HEALTH_FAILED, "wrong bits");
    facts = well();
    facts.silent_ns = 1000000001;
    expect(&facts, "source", FV_HEALTH_FAILED, "no frame for 1.0 s");
    facts.source_state = FOVEA_SOURCE_GONE;
    expect(&facts, "source", FV_HEALTH_FAILED, "the camera is gone, for 1.0 s");
    facts.silent_ns = 300000000;
    facts.source_state = FOVEA_SOURCE_STALLED;
    expect(&facts, "source", FV_HEALTH_DEGRADED, "the camera gives no frames");
    facts = well();
    facts.imu_state = FOVEA_IMU_NONE + 2;
    expect(&facts, "imu", FV_HEALTH_DEGRADED, fovea_imu_state_name(FOVEA_IMU_NONE + 2));
    facts = well();
    facts.pose = FV_WATCH_LOST;
    expect(&facts, "odometry", FV_HEALTH_DEGRADED, "lost for 0.0 s");
    facts.pose_ns = 2500000000;
    expect(&facts, "odometry", FV_HEALTH_FAILED, "lost for 2.5 s");
    facts.pose = FV_WATCH_STARTING;
    facts.pose_ns = 12000000000;
    expect(&facts, "odometry", FV_HEALTH_DEGRADED, "no map after 12.0 s");
    facts = well();
    facts.calibration = FOVEA_CALIBRATION_WRONG;
    expect(&facts, "odometry", FV_HEALTH_DEGRADED, "the calibration does not fit the pictures");
    facts = well();
    facts.inferences = 4;
    facts.inference_ns = 6000000000;
    expect(&facts, "network", FV_HEALTH_DEGRADED, "no inference for 6.0 s");
    facts = well();
    facts.late = 3;
    expect(&facts, "loop", FV_HEALTH_DEGRADED, "3 frames came too late and were dropped");
    facts.stood_ns = 1000000001;
    expect(&facts, "loop", FV_HEALTH_FAILED, "no step has ended for 1.0 s");
    facts = well();
    facts.unsent = 7;
    expect(&facts, "publisher", FV_HEALTH_DEGRADED, "7 messages were not sent");
    facts.sent_ns = facts.silence_ns + 1;
    expect(&facts, "publisher", FV_HEALTH_FAILED, "no message has left for 1.0 s");
    facts.unsent = 0; /* none was to be sent */
    expect(&facts, "publisher", FV_HEALTH_OK, "");
    facts.sends = false;
    expect(&facts, "publisher", FV_HEALTH_FAILED, "no message can be sent");
    facts = well();
    facts.recording_ended = true;
    expect(&facts, "recorder", FV_HEALTH_FAILED, "the recording has ended, the run goes on");
    facts = well();
    facts.unlocked = "not allowed";
    expect(&facts, "memory", FV_HEALTH_DEGRADED, "not allowed");
    facts = well();
    facts.share = 75;
    facts.host.temperature_c = 74;
    expect(&facts, "host", FV_HEALTH_DEGRADED,
           "74.0 degrees, the limit is 80.0; work is kept to 75 % of the period");
    facts.host.throttled = FV_HOST_THROTTLED;
    expect(&facts, "host", FV_HEALTH_DEGRADED,
           "the system throttles the processor; work is kept to 75 % of the period");
}

static void test_absent_parts(void **state)
{
    (void)state;
    struct fv_health_facts facts = well();
    struct fv_health health;
    facts.imu_state = FOVEA_IMU_NONE;
    facts.pose = FV_WATCH_RUNNING;
    facts.has_network = facts.publishes = facts.records = false;
    fv_health_judge(&facts, &health);
    assert_int_equal(health.count, FV_HEALTH_PARTS_MAX - 5);
}

/* Kernels that are off by one grey level in one pixel, and by one bit. */
static struct fv_kernels right;

static void wrong_shrink(uint8_t *out, const uint8_t *in, int32_t count)
{
    right.shrink_row_u8(out, in, count);
    out[count / 2] ^= 1;
}

static void wrong_score(uint8_t *scores, const uint8_t *pixels, ptrdiff_t stride_bytes,
                        const uint8_t *thresholds, int32_t count)
{
    right.fast_score_u8(scores, pixels, stride_bytes, thresholds, count);
    for (int32_t i = 0; i < count; i++)
        if (scores[i] > 20) scores[i]--;
}

static void test_self_test(void **state)
{
    (void)state;
    char reason[FV_SELF_TEST_REASON_BYTES] = "?";
    struct fv_kernels kernels;
    fv_self_test(reason);
    assert_string_equal(reason, "");
    fv_kernels_init(&right, FV_CPU_C);
    kernels = right;
    assert_int_equal(fv_self_test_kernels(&kernels), FV_SELF_TEST_SAME);
    kernels.shrink_row_u8 = wrong_shrink;
    assert_int_equal(fv_self_test_kernels(&kernels), FV_SELF_TEST_DIFFERS);
    kernels = right;
    kernels.fast_score_u8 = wrong_score;
    assert_int_equal(fv_self_test_kernels(&kernels), FV_SELF_TEST_DIFFERS);
}

/* ---- what the watching thread gathers -------------------------------------------------------- */

static struct fv_run run;

static int make_run(void **state)
{
    memset(&run, 0, sizeof run);
    run.health.on = run.quiet = true;
    run.health.root = root;
    run.health.share = FV_HOST_SHARE_MAX;
    run.health.looked_ns = run.health.picture_ns = fv_clock_ns(CLOCK_MONOTONIC);
    run.settings.health_silence_ms = 60000;
    fv_watch_open(&run.watch, false, true);
    return make_root(state);
}

static const struct fv_health_part *told(const char *name)
{
    const struct fv_health *health = &run.health.told;
    for (uint32_t i = 0; i < health->count; i++)
        if (strcmp(health->parts[i].name, name) == 0) return &health->parts[i];
    return NULL;
}

/* The loop hangs before it has sent what was ready: that is replaced, with all counts since what
 * was last sent, and sent when it goes on. */
static void test_a_loop_that_hangs(void **state)
{
    (void)state;
    const struct fovea_inputs inputs = {.frame = NULL};
    run.shared.beats = 1;
    run.shared.dropped = 3;
    fv_run_health_tend(&run);
    assert_string_equal(told("loop")->reason, "3 frames came too late and were dropped");
    run.shared.dropped = 5;
    run.health.stood_ns = INT64_C(61000000000);
    fv_run_health_tend(&run);
    assert_int_equal(told("loop")->state, FV_HEALTH_FAILED);
    assert_int_equal(run.health.news, FV_RUN_HEALTH_SENT); /* by this thread */
    run.shared.beats = 2;
    run.shared.dropped = 7;
    fv_run_health_tend(&run);
    assert_string_equal(told("loop")->reason, "2 frames came too late and were dropped");
    run.shared.dropped = 9;
    run.health.told_ns = 0;
    fv_run_health_tend(&run); /* nobody has sent it */
    assert_string_equal(told("loop")->reason, "4 frames came too late and were dropped");
    fv_run_health_work(&run, &inputs);
    assert_int_equal(run.health.news, FV_RUN_HEALTH_SENT);
    fv_run_health_tend(&run);
    assert_int_equal(told("loop")->state, FV_HEALTH_OK);
    run.health.news = FV_RUN_HEALTH_TAKEN; /* the loop reads it */
    run.shared.dropped = 10;
    fv_run_health_tend(&run);
    assert_int_equal(told("loop")->state, FV_HEALTH_OK);
}

/* While a step hangs, and while the loop waits for seconds for the time of a recorded frame, the
 * watching thread itself sends. */
static void test_a_hung_step_is_told(void **state)
{
    (void)state;
    char url[128], path[96];
    struct fovea_error error;
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    int count = 0;
    snprintf(path, sizeof path, "%s/sent.log", root);
    snprintf(url, sizeof url, "file://%s?mode=w", path);
    strcpy(run.health.channel, "FOVEA_HEALTH");
    fv_message_prepare();
    assert_int_equal(fv_transport_open(url, 0, &run.transport, &error), FOVEA_OK);
    fv_transport_reserve(run.transport, FV_TRANSPORT_WATCHER, run.health.channel);
    run.health.stood_ns = INT64_C(61000000000);
    fv_run_health_tend(&run);
    for (int second = 0; second < 3; second++) { /* it lives, and takes nothing */
        run.shared.beats++;
        run.health.told_ns -= FV_SECOND_NS;
        fv_run_health_tend(&run);
        assert_int_equal(run.health.news, FV_RUN_HEALTH_SENT);
    }
    fv_transport_close(run.transport);
    run.transport = NULL;
    if (fv_lcmlog_open(path, &log, &error) != FOVEA_OK) fail_msg("%s", error.text);
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        fovea_health_t health;
        assert_string_equal(event.channel, "FOVEA_HEALTH");
        assert_true(fovea_health_t_decode(event.data, 0, (int)event.bytes, &health) > 0);
        assert_int_equal(health.state,
                         count == 0 ? FOVEA_HEALTH_T_STATE_FAILED : FOVEA_HEALTH_T_STATE_OK);
        fovea_health_t_decode_cleanup(&health);
        count++;
    }
    fv_lcmlog_close(log);
    assert_int_equal(count, 4);
}

/* Frames without a picture, and those that no step takes, are no life of a source. */
static void test_frames_without_pictures(void **state)
{
    (void)state;
    run.health.picture_ns -= INT64_C(61000000000);
    run.shared.frames = 7;
    fv_run_health_tend(&run);
    assert_int_equal(told("source")->state, FV_HEALTH_FAILED);
    run.shared.pictures = 1;
    fv_run_health_tend(&run);
    assert_int_equal(told("source")->state, FV_HEALTH_OK);
}

/* The first camera goes on, so there are frames. */
static void test_a_silent_camera_of_a_rig(void **state)
{
    (void)state;
    run.settings.runtime.rig.camera_count = 2;
    run.health.image_ns[0] = run.health.picture_ns;
    run.health.image_ns[1] = run.health.picture_ns - INT64_C(61000000000);
    run.shared.images[0] = 7;
    fv_run_health_tend(&run);
    assert_int_equal(told("source")->state, FV_HEALTH_DEGRADED);
    assert_non_null(strstr(told("source")->reason, "camera 2 gives no images, for 61."));
    run.shared.images[1] = 1;
    fv_run_health_tend(&run);
    assert_int_equal(told("source")->state, FV_HEALTH_OK);
    run.settings.runtime.rig.camera_count =
        1; /* without a rig, a silent camera is a frame that lacks */
    run.health.image_ns[0] -= INT64_C(61000000000);
    fv_run_health_tend(&run);
    assert_int_equal(told("source")->state, FV_HEALTH_OK);
}

/* A recording that was begun by command counts, too. */
static void test_recordings_by_command(void **state)
{
    (void)state;
    fv_run_health_tend(&run);
    assert_null(told("recorder"));
    run.health.told_ns = 0;
    run.recordings.setup.path = "a folder";
    fv_run_health_tend(&run);
    assert_int_equal(told("recorder")->state, FV_HEALTH_OK);
    strcpy(run.recordings.reason, "the disk is full");
    fv_run_health_tend(&run);
    assert_int_equal(told("recorder")->state, FV_HEALTH_FAILED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_host_is_read, make_root, remove_root),
        cmocka_unit_test_setup_teardown(test_a_loop_that_hangs, make_run, remove_root),
        cmocka_unit_test_setup_teardown(test_a_hung_step_is_told, make_run, remove_root),
        cmocka_unit_test_setup_teardown(test_frames_without_pictures, make_run, remove_root),
        cmocka_unit_test_setup_teardown(test_a_silent_camera_of_a_rig, make_run, remove_root),
        cmocka_unit_test_setup_teardown(test_recordings_by_command, make_run, remove_root),
        cmocka_unit_test_setup_teardown(test_odd_temperatures, make_root, remove_root),
        cmocka_unit_test_setup_teardown(test_critical_alone, make_root, remove_root),
        cmocka_unit_test_setup_teardown(test_nearest_zone, make_root, remove_root),
        cmocka_unit_test_setup_teardown(test_other_zones, make_root, remove_root),
        cmocka_unit_test(test_heat_takes_work_away),
        cmocka_unit_test(test_parts),
        cmocka_unit_test(test_absent_parts),
        cmocka_unit_test(test_self_test),
    };
    return cmocka_run_group_tests_name("health", tests, NULL, NULL);
}
