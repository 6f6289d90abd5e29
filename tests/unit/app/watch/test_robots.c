/* What is known of robots: rates and times over windows by the caller's clock, restarts, silence,
 * and robots beyond the room. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "app/watch/robots.h"

#include "fovea_health_t.h"
#include "fovea_pose_t.h"
#include "fovea_run_t.h"
#include "fovea_statistics_t.h"

#define SECOND INT64_C(1000000000)

static struct fv_robots robots;
static struct fv_receiver_channel rows[FV_ROBOT_ROWS];
enum { RUN, POSE, CAMERA, STATISTICS, HEALTH };

static int set_up(void **state)
{
    struct fovea_error error;
    (void)state;
    fv_robots_init(&robots, 2 * SECOND);
    return fv_robots_rows(&robots, "*", rows, &error) == FOVEA_OK ? 0 : -1;
}

static void hand_over(int row, const char *channel, const uint8_t *data, int bytes)
{
    assert_true(bytes > 0);
    rows[row].take(rows[row].context, &(struct fv_received){channel, data, (uint32_t)bytes, true});
}

static void say_run(const char *channel, int64_t run_id, const char *host)
{
    uint8_t data[512];
    fovea_run_t run = {.run_id = run_id,
                       .prefix = (char *)"",
                       .host = (char *)(uintptr_t)host,
                       .version = (char *)"1"};
    hand_over(RUN, channel, data, fovea_run_t_encode(data, 0, sizeof data, &run));
}

static void say_pose(const char *channel, int8_t state, const char *child)
{
    static uint8_t data[4096];
    fovea_pose_t pose;
    memset(&pose, 0, sizeof pose);
    pose.state = state;
    pose.quality = 0.5f;
    pose.latency_ns = 2500000;
    pose.parent_frame = (char *)"odom";
    pose.child_frame = (char *)(uintptr_t)child;
    hand_over(POSE, channel, data, fovea_pose_t_encode(data, 0, sizeof data, &pose));
}

static void say_statistics(const char *channel, int64_t processed, int64_t late, int64_t first_ns,
                           int64_t second_ns)
{
    static uint8_t data[4096];
    fovea_stage_t stages[] = {{(char *)"one", 0, first_ns}, {(char *)"two", 0, second_ns}};
    fovea_statistics_t statistics;
    memset(&statistics, 0, sizeof statistics);
    statistics.version = statistics.kernel_set = (char *)"";
    statistics.frames_processed = processed;
    statistics.frames_late = late;
    statistics.stage_count = 2;
    statistics.stages = stages;
    hand_over(STATISTICS, channel, data,
              fovea_statistics_t_encode(data, 0, sizeof data, &statistics));
}

static void say_health(int8_t state, fovea_health_part_t *parts, int32_t count)
{
    static uint8_t data[16384];
    fovea_health_t health = {.state = state, .count = count, .parts = parts};
    hand_over(HEALTH, "R_HEALTH", data, fovea_health_t_encode(data, 0, sizeof data, &health));
}

/* The parts with a fault, in the order of the message; text of others is cleaned and cut. */
static void test_health(void **state)
{
    (void)state;
    char longest[128];
    fovea_health_part_t parts[32] = {{(char *)"camera", 0, (char *)""},
                                     {(char *)"host", 1, (char *)"74 degrees\033[2J"},
                                     {(char *)"network", 2, (char *)"no route"}};
    say_health(2, parts, 3);
    const struct fv_robot *robot = &robots.robots[0];
    assert_string_equal(fv_robot_health_name(robot->health), "failed");
    assert_string_equal(robot->faults, "host degraded: 74 degrees?[2J; network failed: no route");
    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    for (int i = 0; i < 32; i++)
        parts[i] = (fovea_health_part_t){(char *)"part", 99, longest};
    say_health(99, parts, 32);
    assert_string_equal(fv_robot_health_name(robot->health), "?");
    assert_int_equal(strlen(robot->faults), FV_ROBOT_FAULT_BYTES - 1);
    say_health(0, parts, 0);
    assert_true(robot->health == 0 && robot->faults[0] == '\0');
}

static void test_rates_and_times(void **state)
{
    const struct fv_robot *robot = &robots.robots[0];
    (void)state;
    robots.now_ns = 10 * SECOND;
    say_statistics("A_STATISTICS", 100, 7, 1000000, 3000000);
    for (int i = 1; i <= 60; i++) {
        robots.now_ns += SECOND / 30;
        say_pose("A_POSE", FOVEA_POSE_T_STATE_TRACKING, "body");
        say_pose("A_CAMERA_POSE", FOVEA_POSE_T_STATE_LOST, "cam0");
        say_statistics("A_STATISTICS", 100 + i, 7 + i / 10, 1000000, i == 30 ? 10000000 : 3000000);
        fv_robots_tick(&robots);
    }
    assert_int_equal(robots.count, 1);
    assert_true(isnan(robot->frames_hz)); /* 1.99999998 s are over */
    robots.now_ns = 12 * SECOND;
    fv_robots_tick(&robots);
    assert_string_equal(robot->prefix, "A");
    assert_float_equal(robot->frames_hz, 30, 1e-6);
    assert_float_equal(robot->poses_hz, 30, 1e-6);
    assert_float_equal(robot->late_hz, 3, 1e-6);
    assert_int_equal(robot->late, 13);
    assert_float_equal(robot->frame_max_ms, 11, 1e-9);
    assert_float_equal(robot->frame_mean_ms, (60 * 4.0 + 11) / 61, 1e-9);
    assert_float_equal(robot->stages[0].mean_ms, 1, 1e-9);
    assert_string_equal(robot->stages[1].name, "two");
    assert_float_equal(robot->latency_ms, 2.5, 1e-9);
    assert_int_equal(robot->state, FOVEA_POSE_T_STATE_TRACKING);
    assert_int_equal(robot->state_since_ns, 10 * SECOND + SECOND / 30);
    robots.now_ns = 14 * SECOND; /* nothing in this window */
    fv_robots_tick(&robots);
    assert_true(isnan(robot->frames_hz) && isnan(robot->frame_mean_ms));
    assert_float_equal(robot->poses_hz, 0, 0);
}

/* One count alone gives no rate, not even that of a robot that stands still. */
static void test_one_count(void **state)
{
    const struct fv_robot *robot = &robots.robots[0];
    (void)state;
    robots.now_ns = 10 * SECOND;
    say_statistics("A_STATISTICS", 100, 7, 1000000, 3000000);
    robots.now_ns = 12 * SECOND;
    fv_robots_tick(&robots);
    assert_true(isnan(robot->frames_hz) && isnan(robot->late_hz));
    assert_float_equal(robot->frame_mean_ms, 4, 1e-9);
    robots.now_ns = 13 * SECOND; /* the next window has what it follows on */
    say_statistics("A_STATISTICS", 130, 7, 1000000, 3000000);
    robots.now_ns = 14 * SECOND;
    fv_robots_tick(&robots);
    assert_float_equal(robot->frames_hz, 15, 1e-9);
}

/* Counts of another run are not compared with those before. */
static void test_restart(void **state)
{
    const struct fv_robot *robot = &robots.robots[0];
    (void)state;
    robots.now_ns = SECOND;
    say_run("A_RUN", 5, "h\033[1mst");
    say_statistics("A_STATISTICS", 1000, 0, 1, 1);
    assert_string_equal(robot->host, "h?[1mst");
    robots.now_ns = 2 * SECOND;
    say_run("A_RUN", 6, "host");
    assert_int_equal(robot->restarts, 1);
    assert_false(robot->counted);
    say_statistics("A_STATISTICS", 10, 0, 1, 1);
    robots.now_ns = 4 * SECOND;
    say_statistics("A_STATISTICS", 30, 0, 1, 1);
    fv_robots_tick(&robots);
    assert_float_equal(robot->frames_hz, 10, 1e-9);
    robots.now_ns = 5 * SECOND; /* not announced */
    say_statistics("A_STATISTICS", 2, 0, 1, 1);
    robots.now_ns = 7 * SECOND;
    say_statistics("A_STATISTICS", 12, 0, 1, 1);
    fv_robots_tick(&robots);
    assert_float_equal(robot->frames_hz, 5, 1e-9);
    assert_int_equal(robot->restarts, 1);
}

static void test_many(void **state)
{
    (void)state;
    robots.now_ns = SECOND;
    for (int i = FV_ROBOTS_MAX + 2; i >= 0; i--) {
        char channel[16];
        snprintf(channel, sizeof channel, "R%02d_RUN", i);
        say_run(channel, 1 + i, "host");
        say_run(channel, 1 + i, "host");
    }
    assert_int_equal(robots.count, FV_ROBOTS_MAX);
    assert_int_equal(robots.crowded, 6);
    for (uint32_t i = 0; i < robots.count; i++) {
        assert_int_equal(robots.robots[i].run_id, 4 + i);
        assert_int_equal(robots.robots[i].restarts, 0);
    }
    robots.now_ns = 30 * SECOND;
    say_run("R10_RUN", 11, "host");
    robots.now_ns = SECOND + FV_ROBOT_GONE_NS;
    fv_robots_tick(&robots);
    assert_int_equal(robots.count, 1);
    assert_string_equal(robots.robots[0].prefix, "R10");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_health, set_up),
        cmocka_unit_test_setup(test_rates_and_times, set_up),
        cmocka_unit_test_setup(test_one_count, set_up),
        cmocka_unit_test_setup(test_restart, set_up),
        cmocka_unit_test_setup(test_many, set_up),
    };
    fv_message_prepare();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
