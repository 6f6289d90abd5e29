/* A run with two networks is recorded with both models, and replays with both. */
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
#include "app/record/replay.h"
#include "support/lcmlog.h"
#include "support/text.h"

static char path[] = "/tmp/fovea-two-XXXXXX";

static void record(void)
{
    static char arguments[][64] = {"fovea",     "run",
                                   "--source",  "sim:orbit?width=320&height=240",
                                   "--frames",  "30",
                                   "--model",   "tests/golden/detector.fvm",
                                   "--set",     "detect2.model=src/detect/shipped.fvm",
                                   "--set",     "lcm_url=",
                                   "--picture", "none",
                                   "--quiet",   "--record",
                                   ""};
    enum { COUNT = sizeof arguments / sizeof arguments[0] };
    char *argv[COUNT + 1] = {NULL};
    for (int i = 0; i < COUNT; i++)
        argv[i] = arguments[i];
    argv[COUNT - 1] = path;
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) exit(fv_dispatch(COUNT, argv));
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

/* Offset in the file of the last message of a channel, and how many there are. */
static size_t find(const char *channel, int *count)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    size_t found = 0;
    *count = 0;
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    while (fv_lcmlog_skim(log, &event, &error) == FOVEA_OK) {
        if (strcmp(event.channel, channel) != 0) continue;
        found = (size_t)event.offset + FV_LCMLOG_HEADER_BYTES + strlen(channel);
        ++*count;
    }
    fv_lcmlog_close(log);
    return found;
}

static void both_networks_replay_bit_for_bit(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    int first, second;
    close(mkstemp(path));
    unlink(path); /* a recording overwrites nothing */
    record();
    find("FOVEA_DETECTIONS", &first);
    const size_t at = find("FOVEA_DETECTIONS2", &second);
    assert_true(first > 5 && second > 5);
    assert_int_equal(fv_replay(path, FV_REPLAY_STOPS, NULL, NULL, &result, &error), FOVEA_OK);
    if (result.different) fail_msg("%s", result.difference);
    assert_int_equal(result.steps, 30);

    FILE *file = fopen(path, "r+b");
    assert_non_null(file);
    assert_int_equal(fseek(file, (long)at + 8 + 7, SEEK_SET), 0); /* stamp.time_ns */
    const int byte = fgetc(file);
    assert_int_equal(fseek(file, (long)at + 8 + 7, SEEK_SET), 0);
    fputc(byte ^ 1, file);
    fclose(file);
    assert_int_equal(fv_replay(path, FV_REPLAY_STOPS, NULL, NULL, &result, &error), FOVEA_OK);
    assert_true(result.different);
    assert_non_null(strstr(result.difference, "FOVEA_DETECTIONS2"));
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_networks_replay_bit_for_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
