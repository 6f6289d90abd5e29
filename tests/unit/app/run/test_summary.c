/* The lines at the end of a run: a path without length has no error in percent. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <sys/wait.h>
#include <unistd.h>

#include "app/command.h"
#include "app/run/report.h"

static char text[65536];

/* What a run of a source of so many frames prints. */
static void run_of(const char *source, const char *frames)
{
    char path[] = "/tmp/fovea_summary_XXXXXX", picture[64];
    const int file = mkstemp(path);
    assert_true(file >= 0);
    snprintf(picture, sizeof picture, "%s.png", path);
    const char *words[] = {"fovea", "run",   "--source", source,      "--rate", "max", "--frames",
                           frames,  "--set", "lcm_url=", "--picture", picture,  NULL};
    int status = -1;
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        dup2(file, STDOUT_FILENO);
        exit(fv_dispatch(12, (char **)(uintptr_t)words));
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    const ssize_t bytes = pread(file, text, sizeof text - 1, 0);
    assert_true(bytes > 0);
    text[bytes] = '\0';
    close(file);
    unlink(path);
    unlink(picture);
}

static void a_path_without_length_has_no_percentage(void **state)
{
    (void)state;
    run_of("sim:drive?seed=7&baseline=0.12&width=320&height=240", "3");
    assert_non_null(strstr(text, "posed 3 of 3 frames"));
    assert_non_null(strstr(text, "RMS error 0 m, by the truth the camera stood still"));
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "inf %"));
}

static void a_path_has_one(void **state)
{
    (void)state;
    run_of("sim:drive?seed=7&baseline=0.12&width=320&height=240", "40");
    assert_non_null(strstr(text, "%) of a path of "));
    assert_non_null(strstr(text, "scale off by "));
    assert_null(strstr(text, "stood still"));
}

/* What is wrong with the sensor's calibration, and nothing where it is right. */
static void a_calibration_that_is_wrong_is_said(void **state)
{
    (void)state;
    static struct fv_timings timings;
    static struct fv_loop loop;
    struct fv_report report = {.source = "s", .kernel_set = "c", .loop = &loop};
    loop.timings = &timings;
    report.imu_calibration = "imu.yaml";
    report.imu = (struct fovea_imu_status){.state = FOVEA_IMU_OK,
                                           .time_offset_s = -0.0123,
                                           .time_offset_sigma_s = 0.0004,
                                           .mount_angle = 0.0873,
                                           .mount_angle_sigma = 0.0087,
                                           .mount_wrong = true};
    for (int right = 0; right < 2; right++) {
        FILE *file = fmemopen(text, sizeof text, "w");
        if (right) {
            report.imu.time_offset_s = -0.0009;
            report.imu.mount_wrong = false;
        }
        fv_report_summary(file, &report);
        assert_int_equal(fclose(file), 0);
        assert_int_equal(strstr(text, "stamps are 12.3 ms early against the inertial sensor's "
                                      "(sigma 0.4): add -12300000 to time_offset_ns") != NULL,
                         !right);
        assert_int_equal(strstr(text, "turned by 5.0 degrees (sigma 0.5) against T_body_imu of "
                                      "imu.yaml: calibrate again") != NULL,
                         !right);
        assert_int_equal(strstr(text, "time_offset_ns") != NULL, !right);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_path_without_length_has_no_percentage),
        cmocka_unit_test(a_path_has_one),
        cmocka_unit_test(a_calibration_that_is_wrong_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
