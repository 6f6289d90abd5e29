/* `fovea check` says everything that it can, whatever is missing. Each run is a process of its own.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/datasets.h"

/* What is said of pictures is said of small ones, too. */
#define SMALL "sim:still?width=160&height=120"

enum { TEXT_MAX = 1 << 15, ARGUMENTS_MAX = 16, SECONDS_MAX = 300 };

static char out[TEXT_MAX], err[TEXT_MAX];
static bool as_nobody; /* the next check runs without any right */
static char camera[] = "/tmp/fovea_check_XXXXXX";

static FILE *capture(void)
{
    FILE *file = tmpfile();
    assert_non_null(file);
    return file;
}

static void take(FILE *file, char *text)
{
    rewind(file);
    text[fread(text, 1, TEXT_MAX - 1, file)] = '\0';
    fclose(file);
}

/* Words are separated by blanks. Returns the exit status; `out` and `err` hold what was printed. */
static int check(const char *command)
{
    char line[1024], *argv[ARGUMENTS_MAX + 1];
    int argc = 0, status = 0;
    FILE *files[2] = {capture(), capture()};
    snprintf(line, sizeof line, "%s", command);
    for (char *word = strtok(line, " "); word != NULL && argc < ARGUMENTS_MAX;
         word = strtok(NULL, " "))
        argv[argc++] = word;
    argv[argc] = NULL;
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        alarm(SECONDS_MAX);
        dup2(fileno(files[0]), STDOUT_FILENO);
        dup2(fileno(files[1]), STDERR_FILENO);
        if (as_nobody && (setrlimit(RLIMIT_RTPRIO, &(struct rlimit){0, 0}) != 0 ||
                          setrlimit(RLIMIT_MEMLOCK, &(struct rlimit){65536, 65536}) != 0 ||
                          (geteuid() == 0 && setuid(65534) != 0)))
            _exit(99);
        exit(fv_dispatch(argc, argv));
    }
    waitpid(child, &status, 0);
    take(files[0], out);
    take(files[1], err);
    if (!WIFEXITED(status)) fail_msg("%s: wait status %x: %s%s", command, status, out, err);
    return WEXITSTATUS(status);
}

static void assert_tells(const char *text, const char *words)
{
    if (strstr(text, words) == NULL) fail_msg("'%s' is not in:\n%s%s", words, out, err);
}

/* The verdict stands before the question, whatever it is here. */
static void assert_answers(const char *question)
{
    static const char *const verdicts[] = {"ok", "warning", "failed"};
    for (int i = 0; i < 3; i++) {
        char line[64];
        snprintf(line, sizeof line, "\n%-8s %-12s ", verdicts[i], question);
        if (strstr(out, line) != NULL) return;
    }
    fail_msg("'%s' is not asked in:\n%s%s", question, out, err);
}

static void assert_machine_reported(void)
{
    assert_answers("kernels");
    assert_answers("scheduling");
    assert_answers("LCM");
    assert_answers("commands");
}

static void test_everything_is_reported(void **state)
{
    static const char *const owners[] = {"pyramid",
                                         "features",
                                         "odometry",
                                         "messages",
                                         "the block",
                                         "source",
                                         "LCM",
                                         "stack of the loop",
                                         "recorder, if recording",
                                         "map to be saved"};
    (void)state;
    assert_int_equal(
        check(
            "fovea check --source sim:still --set lcm_url=memq:// --set map.save=/tmp/fovea_none.map"),
        0);
    assert_string_equal(err, "");
    assert_tells(out, "memory of sim:still, 640 x 480");
    for (size_t i = 0; i < sizeof owners / sizeof owners[0]; i++)
        assert_tells(out, owners[i]);
    assert_machine_reported();
    assert_answers("memory lock");
    assert_tells(out, "\nok       camera       sim:still answers: 640 x 480 grey8 at 30 Hz after ");
}

static void test_who_may_command_is_said(void **state)
{
    static const struct {
        const char *sets, *line;
        int status;
    } cases[] = {
        {"lcm_url=memq://", "\nwarning  commands     none is received", 0},
        {"listen=none", "\nwarning  commands     none is received", 0},
        {"listen=loopback", "\nok       commands     are accepted from programs on this host", 0},
        {"command_key=/tmp", "\nfailed   commands     command_key: /tmp: found no ordinary file",
         2},
    };
    char command[256];
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        snprintf(command, sizeof command, "fovea check --source " SMALL " --set %s", cases[i].sets);
        const int status = check(command);
        if (cases[i].status != 0) assert_int_equal(status, cases[i].status);
        assert_tells(out, cases[i].line);
    }
}

static void test_frame_rate(void **state)
{
    (void)state;
    assert_int_equal(
        check("fovea check --bench --source " SMALL "&frames=40 --set lcm_url=memq://"), 0);
    assert_tells(out, "this board can hold");
    assert_tells(out, "of 40 frames at 160 x 120");
}

/* A camera that is not there is one line of the report, not the end of it. */
static void test_without_the_camera(void **state)
{
    static const char absent[] =
        "failed   camera       v4l2:/dev/fovea_none: found no such device, expected a camera: is it plugged in?\n";
    char command[256];
    (void)state;
    assert_int_equal(check("fovea check --source v4l2:/dev/fovea_none --set lcm_url=memq://"), 2);
    assert_string_equal(err, absent);
    assert_machine_reported();
    assert_tells(
        out,
        "memory of v4l2:/dev/fovea_none: known when it answers, or with a calibration that states the size of its frames");
    snprintf(command, sizeof command,
             "fovea check --source v4l2:/dev/fovea_none --set lcm_url= --camera %s", camera);
    assert_int_equal(check(command), 2);
    assert_string_equal(err, absent);
    assert_machine_reported();
    assert_answers("memory lock");
    assert_tells(out, "memory of v4l2:/dev/fovea_none, 752 x 480");
    assert_tells(out, "the block");
}

static int block_reported(void)
{
    const char *line = strstr(out, "  the block ");
    int bytes = 0;
    if (line == NULL || sscanf(line, " the block %d", &bytes) != 1)
        fail_msg("no block is stated in:\n%s%s", out, err);
    return bytes;
}

/* Of what stands in the block, a mask too is there without the camera. */
static void test_without_the_camera_with_a_mask(void **state)
{
    static uint8_t white[752 * 480];
    char command[256], mask[64];
    (void)state;
    snprintf(mask, sizeof mask, "%s.png", camera);
    memset(white, 255, sizeof white);
    fv_test_write_png(mask, &(struct fv_test_png){752, 480, 1, 8, false}, white);
    snprintf(command, sizeof command,
             "fovea check --memory-only --source v4l2:/dev/fovea_none --camera %s", camera);
    assert_int_equal(check(command), 2);
    const int without = block_reported();
    snprintf(command, sizeof command,
             "fovea check --memory-only --source v4l2:/dev/fovea_none --camera %s --set mask=%s",
             camera, mask);
    assert_int_equal(check(command), 2);
    assert_int_equal(block_reported() - without, sizeof white);
    unlink(mask);
}

/* What belongs to a network does not go with the source. */
static void test_without_the_camera_with_a_network(void **state)
{
    char command[256];
    (void)state;
    snprintf(
        command, sizeof command,
        "fovea check --source v4l2:/dev/fovea_none --set lcm_url= --camera %s --set detect.model=src/detect/shipped.fvm",
        camera);
    assert_int_equal(check(command), 2);
    assert_tells(out, "  detection ");
    assert_tells(out, "  model ");
}

static void test_kernels(void **state)
{
    (void)state;
    setenv("FOVEA_CPU", "c", 1);
    assert_int_equal(check("fovea check --source " SMALL " --set lcm_url=memq://"), 0);
    assert_tells(out, "\nwarning  kernels      set c, though this processor has ");
    setenv("FOVEA_CPU", "mmx", 1);
    assert_int_equal(check("fovea check --source v4l2:/dev/fovea_none --set lcm_url=memq://"), 2);
    assert_tells(err, "FOVEA_CPU: found 'mmx'");
    unsetenv("FOVEA_CPU");
}

static void test_without_rights(void **state)
{
    (void)state;
    as_nobody = true;
    assert_int_equal(check("fovea check --source " SMALL " --set lcm_url=memq://"), 0);
    assert_tells(
        out,
        "\nwarning  scheduling   no SCHED_FIFO: not permitted; 'ulimit -r 40' or CAP_SYS_NICE would permit it");
#ifndef FOVEA_SANITIZED /* sanitizers have mlock do nothing and succeed */
    assert_tells(out, "\nwarning  memory lock  memory is not locked: ");
#endif
    /* One thing missing must not hide the other. */
    assert_int_equal(check("fovea check --source " SMALL " --set lcm_url= --set loop.cpu=1000"), 0);
    assert_tells(out, "\nwarning  scheduling   ");
    assert_tells(out, "no SCHED_FIFO: not permitted");
    assert_tells(out, "not bound to processor 1000");
    assert_int_equal(check("fovea run --source " SMALL
                           " --set lcm_url= --set loop.cpu=1000 --frames 1 --picture none --quiet"),
                     0);
    assert_tells(err, "no SCHED_FIFO: not permitted");
    assert_tells(err, "not bound to processor 1000");
    /* Wrong input is one line here too. */
    setenv("FOVEA_CPU", "mmx", 1);
    assert_int_equal(check("fovea run --source " SMALL " --set lcm_url= --frames 1 --picture none"),
                     2);
    assert_tells(err, "FOVEA_CPU: found 'mmx'");
    assert_string_equal(strchr(err, '\n'), "\n");
    unsetenv("FOVEA_CPU");
    as_nobody = false;
}

static int camera_make(void **state)
{
    static const char text[] =
        "image_width: 752\nimage_height: 480\nK: [458, 0, 367, 0, 457, 248, 0, 0, 1]\nD: [-0.28, 0.07, 0, 0]\n";
    const int file = mkstemp(camera);
    (void)state;
    if (file < 0) return -1;
    const ssize_t written = write(file, text, sizeof text - 1);
    close(file);
    return written == (ssize_t)sizeof text - 1 ? 0 : -1;
}

static int camera_remove(void **state)
{
    (void)state;
    return unlink(camera);
}

/* A line for each camera of a rig and for its inertial sensor, and the masks of all in the memory.
 */
static void every_sensor_of_a_rig_is_shown(void **state)
{
    (void)state;
    assert_int_equal(
        check(
            "fovea check --source sim:orbit?width=160&height=120&baseline=0.25&imu=200 --set lcm_url=memq://"),
        FV_EXIT_OK);
    assert_tells(out,
                 "ok       camera 2     160 x 120 grey8, calibrated, 0.250 m from the first\n");
    assert_tells(out,
                 "ok       IMU          200 Hz, samples with the first frame: 1; 0.000 m from");
    check("fovea check --source sim:orbit?width=160&height=120 --set lcm_url=memq://");
    assert_null(strstr(out, "camera 2"));
    assert_null(strstr(out, "IMU"));
}

/* `fovea check` hears no LCM, so it does not say that a sensor there is well. */
static void a_sensor_on_lcm_is_not_said_to_be_well(void **state)
{
    char folder[] = "/tmp/fovea_check_imu_XXXXXX", file[64], command[256];
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(file, sizeof file, "%s/imu.yaml", folder);
    fv_test_write_text(file, "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
                             "rate_hz: 200\ngyroscope_noise_density: 0.001\n"
                             "gyroscope_random_walk: 0.0001\naccelerometer_noise_density: 0.02\n"
                             "accelerometer_random_walk: 0.003\n");
    snprintf(command, sizeof command,
             "fovea check --source sim:orbit?width=160&height=120 --set lcm_url=memq:// --set "
             "imu=lcm:IMU --set imu_file=%s",
             file);
    assert_int_equal(check(command), FV_EXIT_OK);
    assert_tells(out, "warning  IMU          lcm:IMU, not listened to here: IMU_STATUS of a run");
    fv_test_folder_remove(folder);
}

/* A source without a calibration gets every line, and one that says how to make it. */
static void test_without_a_calibration(void **state)
{
    static uint8_t white[320 * 240];
    char folder[] = "/tmp/fovea_check_pictures_XXXXXX", picture[64], command[256], expected[256];
    (void)state;
    assert_non_null(mkdtemp(folder));
    memset(white, 255, sizeof white);
    snprintf(picture, sizeof picture, "%s/1.png", folder);
    fv_test_write_png(picture, &(struct fv_test_png){320, 240, 1, 8, false}, white);
    snprintf(command, sizeof command, "fovea check --source images:%s/*.png --set lcm_url=memq://",
             folder);
    assert_int_equal(check(command), FV_EXIT_OK);
    assert_string_equal(err, "");
    assert_machine_reported();
    assert_tells(out, ", 320 x 240, in bytes\n");
    assert_true(block_reported() > 0);
    assert_tells(out, " answers: 320 x 240 grey8 ");
    assert_tells(out, "\nwarning  calibration  none, and 'fovea run' needs one for "
                      "odometry.enabled: ");
    snprintf(expected, sizeof expected, "'fovea-calibrate camera --source images:%s/*.png ",
             folder);
    assert_tells(out, expected);
    strcat(command, " --set objects.ground=true");
    assert_int_equal(check(command), FV_EXIT_OK);
    assert_tells(out, " for odometry.enabled, objects.ground: ");
    snprintf(command, sizeof command,
             "fovea check --source images:%s/*.png --set lcm_url=memq:// --fov 70", folder);
    assert_int_equal(check(command), FV_EXIT_OK);
    assert_tells(out, "\nwarning  calibration  rough, from a field of view of 70 degrees");
    assert_null(strstr(out, "fovea-calibrate"));
    snprintf(command, sizeof command,
             "fovea check --source images:%s/*.png --set lcm_url=memq:// --set "
             "odometry.enabled=false",
             folder);
    assert_int_equal(check(command), FV_EXIT_OK);
    assert_null(strstr(out, "calibration "));
    unlink(picture);
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_sensor_of_a_rig_is_shown),
        cmocka_unit_test(a_sensor_on_lcm_is_not_said_to_be_well),
        cmocka_unit_test(test_everything_is_reported),
        cmocka_unit_test(test_who_may_command_is_said),
        cmocka_unit_test(test_frame_rate),
        cmocka_unit_test(test_without_the_camera),
        cmocka_unit_test(test_without_the_camera_with_a_mask),
        cmocka_unit_test(test_without_the_camera_with_a_network),
        cmocka_unit_test(test_without_a_calibration),
        cmocka_unit_test(test_kernels),
        cmocka_unit_test(test_without_rights),
    };
    return cmocka_run_group_tests(tests, camera_make, camera_remove);
}
