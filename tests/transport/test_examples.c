/* The programs of tools/examples do what they show: the loops in C and C++ print the poses that the
 * runtime gives for the same frames; the subscribers in C and Python print poses of a run, in a
 * network of the test's own. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/own_network.h"
#include "common/sim_rig.h"

#define URL "udpm://239.255.76.67:7667?ttl=0"

enum { FRAMES = 60, MESSAGES = 20, SECONDS_MAX = 300 };

static char frames_path[] = "/tmp/fovea_examples_XXXXXX";
static struct sim_rig rig;

static bool there(const char *program, char path[640])
{
    snprintf(path, 640, "%s/%s", build_folder(), program);
    if (access(path, X_OK) == 0) return true;
    print_message("SKIPPED %s: not built\n", program);
    return false;
}

/* ---- the loops ------------------------------------------------------------------------------- */

/* Frames of a pinhole into a file, and the poses of the runtime for them. */
static void frames_write(void)
{
    FILE *file = fopen(frames_path, "wb");
    assert_non_null(file);
    sim_rig_open(&rig, "sim:orbit?width=320&height=240&lens=pinhole", 0, FRAMES);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        const struct fovea_image *image = &rig.frame.images[0];
        assert_int_equal(image->size_bytes, 320 * 240);
        assert_int_equal(fwrite(image->data, 1, image->size_bytes, file), image->size_bytes);
        sim_rig_process(&rig);
    }
    assert_int_equal(fclose(file), 0);
    assert_int_equal(rig.frames, FRAMES);
}

/* Run a loop over the frames: every line must show the pose that the runtime gave. */
static void loop_matches(const char *program)
{
    static const char *const states[] = {"starting", "tracking", "weak", "lost"};
    char path[640], command[1400], line[256], expected[256];
    if (!there(program, path)) skip();
    frames_write();
    const struct fovea_camera *camera = &rig.config.rig.cameras[0].camera;
    snprintf(command, sizeof command, "%s 320 240 %.17g %.17g %.17g %.17g 30 <%s", path, camera->fx,
             camera->fy, camera->cx, camera->cy, frames_path);
    FILE *output = popen(command, "r");
    assert_non_null(output);
    int posed = 0;
    for (int n = 0; n < FRAMES; n++) {
        const struct fovea_pose *pose = &rig.pose[n];
        const double *T = pose->T_world_cam;
        assert_non_null(fgets(line, sizeof line, output));
        int length = snprintf(expected, sizeof expected, "%.3f %s", n / 30.0, states[pose->state]);
        if (pose->posed)
            length += snprintf(expected + length, sizeof expected - (size_t)length,
                               " %.6f %.6f %.6f", T[3], T[7], T[11]);
        if (strncmp(line, expected, (size_t)length) != 0)
            fail_msg("found \"%s\", expected \"%s\"", line, expected);
        posed += pose->posed;
    }
    while (fgets(line, sizeof line, output) != NULL) {
        double path_length;
        assert_int_equal(sscanf(line, "length %lf", &path_length), 1);
        assert_true(path_length > 0.05);
    }
    assert_int_equal(pclose(output), 0);
    assert_in_range(posed, FRAMES / 2, FRAMES);
    sim_rig_close(&rig);
}

static void test_the_loop_in_c_gives_the_poses_of_the_runtime(void **state)
{
    (void)state;
    loop_matches("examples/loop");
}

static void test_the_loop_in_cpp_gives_the_poses_of_the_runtime(void **state)
{
    (void)state;
    loop_matches("examples/loop_eigen");
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    char path[640], command[1400];
    if (!there("examples/loop", path)) skip();
    snprintf(command, sizeof command, "%s 2>/dev/null </dev/null", path);
    assert_int_equal(WEXITSTATUS(system(command)), 2);
    snprintf(command, sizeof command, "%s 320 240 0 0 0 0 2>/dev/null </dev/null", path);
    assert_int_equal(WEXITSTATUS(system(command)), 2);
}

/* ---- the subscribers ------------------------------------------------------------------------- */

struct process {
    pid_t id;
    FILE *output;
};

static void start(struct process *process, const char *const words[])
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    process->id = fork();
    if (process->id == 0) {
        alarm(SECONDS_MAX);
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        execv(words[0], (char *const *)(uintptr_t)words);
        _exit(127);
    }
    close(ends[1]);
    process->output = fdopen(ends[0], "r");
    assert_non_null(process->output);
}

/* Start a subscriber, send poses until it ends, and judge what it printed. The run has no last
 * frame: packets may be lost where the subscriber gets no time, and it waits for the next. */
static void subscriber_prints(const char *const words[])
{
    char program[640], line[256];
    struct process subscriber, runtime;
    int status, lines = 0, tracking = 0;
    if (!there("fovea", program)) skip();
    start(&subscriber, words);
    assert_non_null(fgets(line, sizeof line, subscriber.output));
    assert_string_equal(line, "listening\n");
    const char *const run[] = {program,    "run",       "--quiet",
                               "--source", "sim:orbit", "--picture",
                               "none",     "--set",     "lcm_url=udpm://239.255.76.67:7667",
                               NULL};
    start(&runtime, run);
    while (fgets(line, sizeof line, subscriber.output) != NULL) {
        double seconds, at[3];
        char state[16], unit[8];
        const int found = sscanf(line, "FOVEA_POSE %lf %15s %lf %lf %lf %7s", &seconds, state, at,
                                 at + 1, at + 2, unit);
        assert_true(found == 2 || found == 6);
        if (found == 6) assert_string_equal(unit, "units");
        tracking += found == 6;
        lines++;
    }
    assert_int_equal(waitpid(subscriber.id, &status, 0), subscriber.id);
    assert_int_equal(status, 0);
    assert_int_equal(kill(runtime.id, SIGINT), 0);
    assert_int_equal(waitpid(runtime.id, &status, 0), runtime.id);
    assert_int_equal(status, 0);
    fclose(subscriber.output);
    fclose(runtime.output);
    assert_int_equal(lines, MESSAGES);
    assert_true(tracking > 0);
}

static bool network;

static void test_the_subscriber_in_c_prints_poses(void **state)
{
    (void)state;
    char path[640];
    if (!network || !there("examples/subscriber", path)) skip();
    const char *const words[] = {path, URL, "20", NULL};
    subscriber_prints(words);
}

static void test_the_subscriber_in_python_prints_poses(void **state)
{
    (void)state;
    char python[640], types[640], ready[640];
    snprintf(ready, sizeof ready, "%s/venv-lcm/ready", build_folder());
    snprintf(types, sizeof types, "%s/python", build_folder());
    setenv("FOVEA_TYPES", types, 1);
    if (access(ready, R_OK) != 0)
        print_message("SKIPPED subscriber.py: no Python package lcm in %s/venv-lcm\n",
                      build_folder());
    if (!network || access(ready, R_OK) != 0 || !there("venv-lcm/bin/python", python)) skip();
    const char *const words[] = {python, "tools/examples/subscriber.py", URL, "20", NULL};
    subscriber_prints(words);
}

/* ---- */

static int set_up(void **state)
{
    (void)state;
    const int file = mkstemp(frames_path);
    return file < 0 ? -1 : close(file);
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(frames_path);
}

int main(void)
{
    if (getenv("FOVEA_EMULATED") != NULL) { /* a child would need the kernel to know the format */
        print_message("SKIPPED: emulated, programs cannot be started\n");
        return 0;
    }
    network = own_network_enter() && own_network_mend();
    if (!network) print_message("SKIPPED the subscribers: no network of the test's own here\n");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_loop_in_c_gives_the_poses_of_the_runtime),
        cmocka_unit_test(test_the_loop_in_cpp_gives_the_poses_of_the_runtime),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_the_subscriber_in_c_prints_poses),
        cmocka_unit_test(test_the_subscriber_in_python_prints_poses),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
