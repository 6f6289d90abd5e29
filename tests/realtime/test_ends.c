/* Every end of a run is an end: signals end it in order, a stray one changes nothing, and a disk or
 * pipe that stalls holds neither the run nor its end. Each run is a process of its own. */
#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/datasets.h"
#include "common/program.h"

static char folder[FV_TEST_IN_MEMORY_BYTES];
static char recording[64], map[64], errors[64];

/* What a child does before its command. */
struct setting {
    int output;          /* becomes stdout; -1: /dev/null */
    bool fsync_stalls;   /* fsync and fdatasync never return */
    bool fsync_fails;    /* they return EIO */
    bool hangup_ignored; /* as nohup does */
    int descriptors;     /* at most this number; 0: as it is */
    bool closed;         /* the standard streams, but for stderr */
    rlim_t file_bytes;   /* no file may be larger; 0: as it is */
};

static const struct setting ordinary = {.output = -1};

/* What becomes of the calls. False: not permitted here. */
static bool filter_fsync(uint32_t action, unsigned flags)
{
    struct sock_filter rules[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_fsync, 2, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_fdatasync, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
        BPF_STMT(BPF_RET | BPF_K, action),
    };
    const struct sock_fprog filter = {sizeof rules / sizeof *rules, rules};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, flags, &filter) >= 0;
}

/* To a listener that never answers. */
static bool stall_fsync(void)
{
    return filter_fsync(SECCOMP_RET_USER_NOTIF, SECCOMP_FILTER_FLAG_NEW_LISTENER);
}

static bool fail_fsync(void)
{
    return filter_fsync(SECCOMP_RET_ERRNO | EIO, 0);
}

static bool fsync_can_stall(void)
{
    int status = 1;
    if (getenv("FOVEA_EMULATED") != NULL) return false;
    const pid_t child = fork();
    if (child == 0) _exit(stall_fsync() ? 0 : 1);
    waitpid(child, &status, 0);
    return status == 0;
}

/* In the child. */
static void take_setting(const void *context)
{
    const struct setting *setting = context;
    const struct rlimit few = {(rlim_t)setting->descriptors, (rlim_t)setting->descriptors};
    if (setting->descriptors > 0) {
        close_range(3, ~0U, 0);
        setrlimit(RLIMIT_NOFILE, &few);
    }
    const struct rlimit small = {setting->file_bytes, setting->file_bytes};
    if (setting->file_bytes > 0) setrlimit(RLIMIT_FSIZE, &small);
    if (setting->closed) {
        close(STDIN_FILENO);
        close(STDOUT_FILENO);
    }
    if (setting->hangup_ignored) signal(SIGHUP, SIG_IGN);
    if (setting->fsync_stalls && !stall_fsync()) _exit(99);
    if (setting->fsync_fails && !fail_fsync()) _exit(99);
}

static pid_t begin(const struct setting *setting, const char *const words[])
{
    return program_begin(words, setting->output, take_setting, setting);
}

#define RUN(source) "run", "--quiet", "--set", "lcm_url=", "--source", source
/* Small frames and a buffer of half a minute: a disk that others keep busy ends no recording. */
#define RECORDED_RUN                                                                               \
    RUN("sim:wander?width=160&height=120"), "--set", "record_buffer=1000", "--rate", "real",       \
        "--record", recording, "--save-map", map

/* ---- in order -------------------------------------------------------------------------------- */

/* Ended in order: the map is there, and the recording has its end. */
static void expect_whole(void)
{
    const char *const verify[] = {"replay", "--verify", recording, NULL};
    assert_true(program_file_bytes(map) > 0);
    program_expect_end(begin(&ordinary, verify), FV_EXIT_OK);
    unlink(map);
    unlink(recording);
}

static void test_a_signal_ends_a_run_in_order(void **state)
{
    const int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGXCPU, SIGHUP};
    const char *const words[] = {RECORDED_RUN, NULL};
    (void)state;
    for (int i = 0; i < 5; i++) {
        if (i == 4) setenv("NOTIFY_SOCKET", "", 1); /* an empty one is none */
        const pid_t child = begin(&ordinary, words);
        program_wait_until_grown(recording, 1 << 20);
        kill(child, signals[i]);
        program_expect_end(child, FV_EXIT_OK);
        expect_whole();
    }
    unsetenv("NOTIFY_SOCKET");
}

/* What is printed would else go into the file that was opened in place of the stream. */
static void test_closed_streams_harm_no_recording(void **state)
{
    const struct setting closed = {.output = -1, .closed = true};
    const char *const words[] = {"run",      "--set",      "lcm_url=", "--source", "sim:wander",
                                 "--frames", "20",         "--record", recording,  "--picture",
                                 "none",     "--save-map", map,        NULL};
    (void)state;
    program_expect_end(begin(&closed, words), FV_EXIT_OK);
    expect_whole();
}

/* A map that a limit on file sizes does not let be saved is an error, with one line and no rest. */
static void test_a_limit_on_file_sizes_is_an_error(void **state)
{
    const struct setting small = {.output = -1, .file_bytes = 4096};
    const char *const words[] = {RUN("sim:wander"), "--frames", "60", "--save-map", map, NULL};
    char part[80];
    (void)state;
    snprintf(part, sizeof part, "%s.part", map);
    program_expect_end(begin(&small, words), FV_EXIT_FAILED);
    program_expect_said("File too large");
    assert_int_equal(access(map, F_OK), -1);
    assert_int_equal(access(part, F_OK), -1);
}

static void test_a_stray_signal_changes_nothing(void **state)
{
    const int strays[] = {SIGUSR1, SIGUSR2, SIGPIPE, SIGHUP};
    const struct setting nohup = {.output = -1, .hangup_ignored = true};
    const char *const words[] = {RECORDED_RUN, NULL};
    (void)state;
    const pid_t child = begin(&nohup, words);
    program_wait_until_grown(recording, 1 << 20);
    for (int i = 0; i < 4; i++) {
        const off_t before = program_file_bytes(recording);
        kill(child, strays[i]);
        program_wait_until_grown(recording, before + (1 << 19));
        assert_int_equal(waitpid(child, NULL, WNOHANG), 0);
    }
    kill(child, SIGTERM);
    program_expect_end(child, FV_EXIT_OK);
    expect_whole();
}

/* ---- what stalls ----------------------------------------------------------------------------- */

/* A run whose output nobody reads: it says so, and the signal ends it. */
static void stalled_run(const char *const words[], const char *line, const char *lost)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    assert_true(fcntl(ends[1], F_SETPIPE_SZ, 4096) > 0);
    const struct setting unread = {.output = ends[1]};
    struct timespec before, after;
    const pid_t child = begin(&unread, words);
    program_wait_until_said(line);
    clock_gettime(CLOCK_MONOTONIC, &before);
    kill(child, SIGTERM);
    program_expect_end(child, FV_EXIT_FAILED);
    clock_gettime(CLOCK_MONOTONIC, &after);
    program_expect_said("after Terminated");
    program_expect_said(lost);
    print_message("ended %.1f s after the signal\n",
                  (double)(after.tv_sec - before.tv_sec) +
                      1e-9 * (double)(after.tv_nsec - before.tv_nsec));
    close(ends[0]);
    close(ends[1]);
}

static void test_a_stalled_recording_ends(void **state)
{
    const char *const real[] = {
        RUN("sim:still?width=320&height=240"), "--rate", "real", "--record", "/dev/stdout", NULL};
    const char *const fast[] = {
        RUN("sim:still?width=320&height=240"), "--rate", "max", "--record", "/dev/stdout", NULL};
    const char line[] = "/dev/stdout: has taken nothing for ",
               lost[] = "lost: the end of the recording /dev/stdout";
    (void)state;
    stalled_run(real, line, lost);
    stalled_run(fast, line, lost);
}

static void test_a_stalled_trajectory_ends(void **state)
{
    const char *const words[] = {RUN("sim:wander"),        "--rate",       "max",         "--set",
                                 "features.count_max=400", "--trajectory", "/dev/stdout", NULL};
    (void)state;
    stalled_run(words, "/dev/stdout: has taken nothing for ", "the end of the trajectory");
}

/* A pipe that is read again after a while loses nothing. */
static void test_what_stalls_for_a_while_goes_on(void **state)
{
    const char *const words[] = {RUN("sim:still"), "--frames",    "40",
                                 "--record",       "/dev/stdout", NULL};
    static char bytes[1 << 16];
    int ends[2];
    ssize_t got;
    (void)state;
    assert_int_equal(pipe(ends), 0);
    const struct setting unread = {.output = ends[1]};
    const pid_t child = begin(&unread, words);
    program_wait_until_said("has taken nothing");
    close(ends[1]);
    FILE *file = fopen(recording, "w");
    while ((got = read(ends[0], bytes, sizeof bytes)) > 0)
        fwrite(bytes, 1, (size_t)got, file);
    fclose(file);
    close(ends[0]);
    program_expect_end(child, FV_EXIT_OK);
    program_expect_said("/dev/stdout: goes on after");
    const char *const verify[] = {"replay", "--verify", recording, NULL};
    program_expect_end(begin(&ordinary, verify), FV_EXIT_OK);
    unlink(recording);
}

static void test_a_stalled_disk_ends(void **state)
{
    const struct setting stalled = {.output = -1, .fsync_stalls = true};
    const char *const words[] = {RECORDED_RUN, NULL};
    (void)state;
    if (!fsync_can_stall()) {
        print_message("SKIPPED a stalled disk: no seccomp listener here\n");
        skip();
    }
    pid_t child = begin(&stalled, words);
    program_wait_until_grown(recording, 1 << 20);
    kill(child, SIGHUP);
    program_expect_end(child, FV_EXIT_FAILED);
    program_expect_said("after Hangup");
    program_expect_said(map);

    /* A second SIGINT does not wait for that. */
    unlink(recording);
    child = begin(&stalled, words);
    program_wait_until_grown(recording, 1 << 20);
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) {
        kill(child, SIGINT);
        usleep(50000);
    }
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGINT);
    program_expect_said("a second signal ended it at once: lost: the map");
    unlink(recording);
}

/* The messages are all written, but the disk does not keep them. */
static void test_a_log_that_does_not_last_fails_the_run(void **state)
{
    char log[64], url[96];
    const struct setting failing = {.output = -1, .fsync_fails = true};
    (void)state;
    if (!fsync_can_stall()) {
        print_message("SKIPPED a log that does not last: no seccomp filter here\n");
        skip();
    }
    snprintf(log, sizeof log, "%s/messages.lcm", folder);
    snprintf(url, sizeof url, "lcm_url=file://%s?mode=w", log);
    const char *const words[] = {"run",       "--quiet", "--source", "sim:still", "--frames",
                                 "5",         "--set",   url,        "--set",     "loop.priority=0",
                                 "--picture", "none",    NULL};
    program_expect_end(begin(&ordinary, words), FV_EXIT_OK);
    program_expect_end(begin(&failing, words), FV_EXIT_FAILED);
    program_expect_said("lcm_url: ");
    program_expect_said("Input/output error");
    unlink(log);
}

/* Too few descriptors are no fault of the network. */
static void test_too_few_descriptors_are_named(void **state)
{
    const char *const words[] = {"check", "--source", "sim:still?width=96&height=64", NULL};
    char text[1 << 14];
    (void)state;
    for (int limit = 5; limit < 8; limit++) {
        char path[64];
        snprintf(path, sizeof path, "%s/checked", folder);
        const int file = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        const struct setting few = {.output = file, .descriptors = limit};
        program_end(begin(&few, words));
        const ssize_t got = pread(file, text, sizeof text - 1, 0);
        close(file);
        assert_true(got > 0);
        text[got] = '\0';
        assert_null(strstr(text, "multicast on"));
        assert_non_null(strstr(text, "LCM"));
    }
}

/* The picture that is drawn unasked is not drawn with --quiet. */
static void test_a_quiet_run_leaves_no_picture(void **state)
{
    char before[4096];
    const char *const words[] = {RUN("sim:still"), "--frames", "2", NULL};
    (void)state;
    assert_non_null(getcwd(before, sizeof before));
    assert_int_equal(chdir(folder), 0);
    program_expect_end(begin(&ordinary, words), FV_EXIT_OK);
    assert_int_equal(access("fovea-run.png", F_OK), -1);
    assert_int_equal(chdir(before), 0);
}

/* ---- other commands -------------------------------------------------------------------------- */

static void test_other_commands_end_by_signals(void **state)
{
    const int signals[] = {SIGINT, SIGTERM, SIGHUP};
    char made[80], sent[96], log[80];
    snprintf(made, sizeof made, "%s/made", folder);
    snprintf(log, sizeof log, "%s/sent.lcm", folder);
    snprintf(sent, sizeof sent, "file://%s?mode=w", log);
    /* A quarter of a minute of small frames: a replay by the clock does not end before its signal.
     */
    const char *const record[] = {
        RUN("sim:still?width=160&height=120"), "--frames", "450", "--record", recording, NULL};
    const char *const replay[] = {"replay", "--rate", "real", "--lcm-url", sent, recording, NULL};
    const char *const export[] = {"export", "--source", "sim:still", "--frames",
                                  "100000", made,       NULL};
    (void)state;
    program_expect_end(begin(&ordinary, record), FV_EXIT_OK);
    for (int i = 0; i < 3; i++) {
        pid_t child = begin(&ordinary, replay);
        program_wait_until_grown(log, 1);
        kill(child, signals[i]);
        program_expect_end(child, 1000 + signals[i]);
        unlink(log);
        child = begin(&ordinary, export);
        program_wait_until_grown(made, 1);
        usleep(200000);
        kill(child, signals[i]);
        program_expect_end(child, 1000 + signals[i]);
        fv_test_folder_remove(made);
    }
    unlink(recording);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_signal_ends_a_run_in_order),
        cmocka_unit_test(test_closed_streams_harm_no_recording),
        cmocka_unit_test(test_a_limit_on_file_sizes_is_an_error),
        cmocka_unit_test(test_a_stray_signal_changes_nothing),
        cmocka_unit_test(test_a_stalled_recording_ends),
        cmocka_unit_test(test_a_stalled_trajectory_ends),
        cmocka_unit_test(test_what_stalls_for_a_while_goes_on),
        cmocka_unit_test(test_a_stalled_disk_ends),
        cmocka_unit_test(test_a_log_that_does_not_last_fails_the_run),
        cmocka_unit_test(test_too_few_descriptors_are_named),
        cmocka_unit_test(test_a_quiet_run_leaves_no_picture),
        cmocka_unit_test(test_other_commands_end_by_signals),
    };
    fv_test_folder_in_memory(folder);
    snprintf(recording, sizeof recording, "%s/run.lcm", folder);
    snprintf(map, sizeof map, "%s/run.map", folder);
    snprintf(errors, sizeof errors, "%s/errors", folder);
    program_says_to(errors);
    const int failed = cmocka_run_group_tests_name("realtime/test_ends", tests, NULL, NULL);
    fv_test_folder_remove(folder);
    return failed;
}
