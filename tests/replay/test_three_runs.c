/* Three runs of the program, each a process of its own, record the same frames, grants and messages
 * to the byte; only what is measured in the process (in inputs and statistics) may differ. And what
 * the command that verifies a recording says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/data_folder.h"
#include "support/lcmlog.h"

enum { RUNS = 3 };

static char folder[] = "/tmp/fovea-test-XXXXXX";
static char paths[RUNS][64];

/* The exit status of a command; its stderr goes to a file, unless NULL. */
static int command(const char *const words[], int count, const char *errors)
{
    enum { COUNT_MAX = 24 };
    int status = 0;
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        char *argv[COUNT_MAX + 1]; /* getopt_long moves them about */
        for (int i = 0; i <= count; i++)
            argv[i] = i < count ? strdup(words[i]) : NULL;
        if (errors != NULL && freopen(errors, "w", stderr) == NULL) exit(99);
        exit(fv_dispatch(count, argv));
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + status;
}

static void run(const char *source, const char *frames, const char *log)
{
    const char *const words[] = {"fovea",
                                 "run",
                                 "--quiet",
                                 "--set",
                                 "lcm_url=",
                                 "--picture",
                                 "none",
                                 "--source",
                                 source,
                                 "--frames",
                                 frames,
                                 "--set",
                                 "preview.period_frames=7",
                                 "--record",
                                 log};
    assert_int_equal(command(words, sizeof words / sizeof words[0], NULL), FV_EXIT_OK);
}

/* The next event of those that must be equal; false at the end. */
static bool next(struct fv_lcmlog *log, struct fv_lcmlog_event *event)
{
    static const char *const measured[] = {"RECORDING", "INPUTS", "STATISTICS", "RECORDING_END"};
    struct fovea_error error;
    for (;;) {
        const enum fovea_status status = fv_lcmlog_next(log, event, &error);
        bool skip = false;
        if (status == FOVEA_END) return false;
        if (status != FOVEA_OK) fail_msg("%s", error.text);
        for (size_t i = 0; i < sizeof measured / sizeof measured[0]; i++)
            skip = skip || fv_lcmlog_channel_is(event->channel, measured[i]);
        if (!skip) return true;
    }
}

static void expect_equal(const char *first, const char *second)
{
    struct fv_lcmlog *logs[2];
    struct fv_lcmlog_event a, b;
    struct fovea_error error;
    uint32_t events = 0;
    assert_int_equal(fv_lcmlog_open(first, &logs[0], &error), FOVEA_OK);
    assert_int_equal(fv_lcmlog_open(second, &logs[1], &error), FOVEA_OK);
    while (next(logs[0], &a)) {
        assert_true(next(logs[1], &b));
        assert_string_equal(a.channel, b.channel);
        if (a.bytes != b.bytes || memcmp(a.data, b.data, a.bytes) != 0 || a.time_us != b.time_us ||
            a.number != b.number)
            fail_msg("event %d: %s differs", (int)a.number, a.channel);
        events++;
    }
    assert_false(next(logs[1], &b));
    assert_true(events > 100);
    fv_lcmlog_close(logs[0]);
    fv_lcmlog_close(logs[1]);
}

static void expect_runs_equal(const char *source, const char *frames)
{
    for (int i = 0; i < RUNS; i++)
        run(source, frames, paths[i]);
    for (int i = 1; i < RUNS; i++)
        expect_equal(paths[0], paths[i]);
}

static void test_simulated(void **state)
{
    (void)state;
    expect_runs_equal("sim:?width=320&height=240&seed=3", "60");
}

static void test_recording(void **state)
{
    char source[512];
    (void)state;
    snprintf(source, sizeof source, "kitti:%s/kitti06_a", fv_data_folder());
    if (access(source + strlen("kitti:"), R_OK) != 0) {
        print_message("SKIPPED %s: not there\n", source);
        skip();
    }
    expect_runs_equal(source, "20");
}

/* What `fovea replay --verify` says and ends with. */
static void expect_verdict(const char *log, int status, const char *text)
{
    const char *const words[] = {"fovea", "replay", log, "--verify"};
    char errors[64], line[512] = "";
    snprintf(errors, sizeof errors, "%s/errors", folder);
    assert_int_equal(command(words, 4, errors), status);
    FILE *file = fopen(errors, "r");
    assert_non_null(file);
    const bool any = fgets(line, sizeof line, file) != NULL;
    fclose(file);
    unlink(errors);
    assert_true(any == (text[0] != '\0'));
    if (strncmp(line, any ? log : "", any ? strlen(log) : 0) != 0 || strstr(line, text) == NULL)
        fail_msg("%s", line);
}

static void test_verdicts(void **state)
{
    (void)state;
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    int64_t last = 0, grants = 0;
    run("sim:?width=320&height=240&seed=3", "10", paths[0]);
    expect_verdict(paths[0], FV_EXIT_OK, "");
    assert_int_equal(fv_lcmlog_open(paths[0], &log, &error), FOVEA_OK);
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        last = event.offset;
        if (fv_lcmlog_channel_is(event.channel, "GRANTS")) grants = event.offset;
    }
    fv_lcmlog_close(log);
    assert_int_equal(truncate(paths[0], last), 0); /* as when the program was killed there */
    expect_verdict(paths[0], FV_EXIT_FAILED,
                   "found no end of the recording after 10 frames, expected one");
    assert_int_equal(truncate(paths[0], grants), 0);
    expect_verdict(paths[0], FV_EXIT_FAILED,
                   "found no end of the recording after 10 frames, expected one");
    assert_int_equal(truncate(paths[0], grants - 1), 0);
    expect_verdict(paths[0], FV_EXIT_WRONG, "the event is cut off");
}

int main(void)
{
    if (mkdtemp(folder) == NULL) return 1;
    for (int i = 0; i < RUNS; i++)
        snprintf(paths[i], sizeof paths[i], "%s/%d", folder, i);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_simulated),
                                       cmocka_unit_test(test_recording),
                                       cmocka_unit_test(test_verdicts)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    for (int i = 0; i < RUNS; i++)
        unlink(paths[i]);
    rmdir(folder);
    return failed;
}
