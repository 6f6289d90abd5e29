/* What a run says of its inertial sensor while it goes on: its state, a clock and a mount that are
 * others than stated; each once, and nothing with --quiet. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/run/run.h"

static struct fv_run run;
static char text[4096]; /* what was said last */

static int set_up(void **state)
{
    (void)state;
    memset(&run, 0, sizeof run);
    fv_watch_open(&run.watch, true, false);
    strcpy(run.settings.source, "sim:orbit?imu=200");
    run.imu_said = FOVEA_IMU_OK;
    run.watch.imu_state = FOVEA_IMU_OK;
    return 0;
}

/* Take the lines that are due from stderr. */
static void hear(void)
{
    FILE *file = tmpfile();
    assert_non_null(file);
    const int before = dup(STDERR_FILENO);
    assert_true(before >= 0 && dup2(fileno(file), STDERR_FILENO) >= 0);
    fv_run_changes_say(&run);
    assert_true(dup2(before, STDERR_FILENO) >= 0);
    close(before);
    const ssize_t bytes = pread(fileno(file), text, sizeof text - 1, 0);
    assert_true(bytes >= 0);
    text[bytes] = '\0';
    fclose(file);
}

static void test_a_wrong_mount_is_said_once(void **state)
{
    (void)state;
    hear();
    assert_string_equal(text, "");
    run.watch.imu_turned_sigma_mdeg = 1040;
    run.watch.imu_turned_mdeg = 5730;
    hear();
    assert_string_equal(text, "inertial sensor is turned by 5.7 degrees (sigma 1.0) against "
                              "T_body_imu of sim:orbit?imu=200: calibrate again\n");
    hear();
    assert_string_equal(text, "");
}

/* Where the sensor has a calibration of its own, that is named. */
static void test_the_file_of_the_mount_is_named(void **state)
{
    (void)state;
    strcpy(run.settings.imu_file, "/etc/fovea/imu.yaml");
    run.watch.imu_turned_mdeg = 5000;
    hear();
    assert_non_null(strstr(text, "against T_body_imu of /etc/fovea/imu.yaml: calibrate again"));
}

static void test_a_wrong_clock_is_said_as_it_is_followed(void **state)
{
    (void)state;
    run.watch.imu_moved_sigma_ns = 400000;
    run.watch.imu_moved_ns = -12300000;
    hear();
    assert_string_equal(text, "inertial sensor: the camera's stamps are 12.3 ms early against it "
                              "(sigma 0.4): samples are moved\n");
    run.watch.imu_moved_ns = -12900000;
    hear();
    assert_string_equal(text, "");
    run.watch.imu_moved_ns = 2000000;
    hear();
    assert_non_null(strstr(text, "stamps are 2.0 ms late"));
}

static void test_a_state_is_said_when_it_is_another(void **state)
{
    (void)state;
    char expected[128];
    run.watch.imu_state = FOVEA_IMU_SILENT;
    hear();
    snprintf(expected, sizeof expected, "inertial sensor: %s\n",
             fovea_imu_state_name(FOVEA_IMU_SILENT));
    assert_string_equal(text, expected);
    hear();
    assert_string_equal(text, "");
}

static void test_a_quiet_run_says_nothing(void **state)
{
    (void)state;
    run.quiet = true;
    run.watch.imu_state = FOVEA_IMU_SILENT;
    run.watch.imu_moved_ns = -12300000;
    run.watch.imu_turned_mdeg = 5730;
    hear();
    assert_string_equal(text, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_a_wrong_mount_is_said_once, set_up),
        cmocka_unit_test_setup(test_the_file_of_the_mount_is_named, set_up),
        cmocka_unit_test_setup(test_a_wrong_clock_is_said_as_it_is_followed, set_up),
        cmocka_unit_test_setup(test_a_state_is_said_when_it_is_another, set_up),
        cmocka_unit_test_setup(test_a_quiet_run_says_nothing, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
