/* A recording describes its own types: a program that knows none of them (read_recording.py) reads
 * every message, and finds the numbers that the generated decoders find. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/build_folder.h"

#include "support/lcmlog.h"

#include "fovea_pose_t.h"

static char recording[600];

static int make_recording(void **state)
{
    (void)state;
    char command[2048];
    snprintf(
        command, sizeof command,
        "%s/fovea run --source 'sim:orbit?width=320&height=240&frames=60' --model src/detect/shipped.fvm --quiet --picture none --set lcm_url= --set loop.priority=0 --record %s",
        build_folder(), recording);
    return system(command) == 0 ? 0 : -1;
}

static int remove_recording(void **state)
{
    (void)state;
    return remove(recording);
}

/* What the reader prints of one suffix, or of all channels (""). The caller closes it. */
static FILE *read_with_python(const char *suffix)
{
    char command[1400];
    snprintf(command, sizeof command, "python3 tools/subscribers/read_recording.py %s %s",
             recording, suffix);
    FILE *lines = popen(command, "r");
    assert_non_null(lines);
    return lines;
}

static struct fv_lcmlog *open_recording(void)
{
    struct fv_lcmlog *log = NULL;
    struct fovea_error error;
    if (fv_lcmlog_open(recording, &log, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return log;
}

static void every_message_is_read(void **state)
{
    (void)state;
    static char line[1 << 20];
    struct fv_lcmlog_event event;
    struct fovea_error error;
    FILE *lines = read_with_python("");
    struct fv_lcmlog *log = open_recording();
    int events = 0;
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        char start[160];
        snprintf(start, sizeof start, "{\"channel\": \"%s\", \"type\": ", event.channel);
        if (fgets(line, sizeof line, lines) == NULL || strncmp(line, start, strlen(start)) != 0)
            fail_msg("event %d: found %.100s, expected %s", events, line, start);
        events++;
    }
    assert_null(fgets(line, sizeof line, lines));
    assert_int_equal(pclose(lines), 0);
    assert_in_range(events, 400, 1000);
    fv_lcmlog_close(log);
}

static void the_numbers_are_those_of_the_decoders(void **state)
{
    (void)state;
    static char line[1 << 16];
    struct fv_lcmlog_event event;
    struct fovea_error error;
    FILE *lines = read_with_python("POSE");
    struct fv_lcmlog *log = open_recording();
    int posed = 0;
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        fovea_pose_t pose;
        double p[3];
        if (strcmp(event.channel, "FOVEA_POSE") != 0) continue;
        assert_true(fovea_pose_t_decode(event.data, 0, (int)event.bytes, &pose) > 0);
        assert_non_null(fgets(line, sizeof line, lines));
        const char *position = strstr(line, "\"position\": ");
        assert_non_null(position);
        if (isnan(pose.position[0])) {
            assert_non_null(strstr(position, "[null, null, null]"));
        } else {
            assert_int_equal(sscanf(position, "\"position\": [%lf, %lf, %lf]", &p[0], &p[1], &p[2]),
                             3);
            assert_true(p[0] == pose.position[0] && p[1] == pose.position[1] &&
                        p[2] == pose.position[2]);
            posed++;
        }
        fovea_pose_t_decode_cleanup(&pose);
    }
    assert_null(fgets(line, sizeof line, lines));
    assert_int_equal(pclose(lines), 0);
    assert_true(posed > 20);
    fv_lcmlog_close(log);
}

int main(void)
{
    snprintf(recording, sizeof recording, "%s/read_recording.lcm", build_folder());
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_read_recording: it starts the program itself");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_message_is_read),
        cmocka_unit_test(the_numbers_are_those_of_the_decoders),
    };
    return cmocka_run_group_tests(tests, make_recording, remove_recording);
}
