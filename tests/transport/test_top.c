/* `fovea top` as a whole program, in a network of the test's own: two robots as lines for scripts
 * and on a screen, which follows the terminal's size and is left as it was. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/patience.h"
#include "common/watched.h"

#include "fovea_camera_status_t.h"
#include "fovea_pose_t.h"
#include "fovea_run_t.h"
#include "fovea_statistics_t.h"

static struct watched watched;

/* One frame of two robots: LEFT tracks, RIGHT is lost and late. */
static void send_frame(void)
{
    static uint8_t data[4096];
    static int64_t frame;
    static fovea_stage_t stage = {(char *)"pyramid", 1000000, 1250000};
    static const char *const prefixes[] = {"LEFT", "RIGHT"};
    frame++;
    for (int i = 0; i < 2; i++) {
        char channel[64];
        fovea_run_t run = {.run_id = 77 + i,
                           .prefix = (char *)"",
                           .host = (char *)"robot\033[2J",
                           .version = (char *)"9"};
        fovea_pose_t pose;
        fovea_camera_status_t camera;
        fovea_statistics_t statistics;
        memset(&pose, 0, sizeof pose);
        memset(&camera, 0, sizeof camera);
        memset(&statistics, 0, sizeof statistics);
        pose.state = i == 0 ? FOVEA_POSE_T_STATE_TRACKING : FOVEA_POSE_T_STATE_LOST;
        pose.quality = 0.75f;
        pose.parent_frame = (char *)"odom";
        pose.child_frame = (char *)"body";
        camera.state = FOVEA_CAMERA_STATUS_T_STATE_STALLED;
        camera.pixel_format = (char *)"grey8";
        statistics.version = statistics.kernel_set = (char *)"";
        statistics.frames_processed = frame;
        statistics.frames_late = i == 0 ? 0 : 4321;
        statistics.stage_count = 1;
        statistics.stages = &stage;
        snprintf(channel, sizeof channel, "%s_RUN", prefixes[i]);
        watched_send(channel, data, (size_t)fovea_run_t_encode(data, 0, sizeof data, &run));
        snprintf(channel, sizeof channel, "%s_POSE", prefixes[i]);
        watched_send(channel, data, (size_t)fovea_pose_t_encode(data, 0, sizeof data, &pose));
        snprintf(channel, sizeof channel, "%s_CAMERA_STATUS", prefixes[i]);
        watched_send(channel, data,
                     (size_t)fovea_camera_status_t_encode(data, 0, sizeof data, &camera));
        snprintf(channel, sizeof channel, "%s_STATISTICS", prefixes[i]);
        watched_send(channel, data,
                     (size_t)fovea_statistics_t_encode(data, 0, sizeof data, &statistics));
    }
}

static void start(const char *const *arguments)
{
    watched_start(&watched, "top", arguments);
    while (!watched_readable(&watched, 20))
        send_frame();
}

/* Frames a second, which two messages tell. */
static bool has_rate(const char *text)
{
    const char *rate = strstr(text, "\"frames_hz\":");
    return rate != NULL && strtod(rate + strlen("\"frames_hz\":"), NULL) > 0;
}

static void test_json(void **state)
{
    static const char *const arguments[] = {"--once", "--json", NULL};
    static const char *const members[2][8] = {
        {"\"prefix\":\"LEFT\"", "\"state\":\"tracking\"", "\"late\":0,", "\"run_id\":77,",
         "\"host\":\"robot?[2J\"", "\"camera\":\"stalled\"",
         "\"stages_mean_ms\":{\"pyramid\":1.25}}", "\"quality\":0.75,"},
        {"\"prefix\":\"RIGHT\"", "\"state\":\"lost\"", "\"late\":4321,", "\"run_id\":78,",
         "\"frame_mean_ms\":1.25,", "\"silent\":false", "\"late_hz\":0,", "\"temperature_c\":0,"}};
    char text[2][4096];
    const char *missing = "a line";
    int64_t end_ns = 0;
    (void)state;
    do { /* again where too little was sent within the interval */
        start(arguments);
        for (int i = 0; i < 2; i++)
            if (!watched_line(&watched, text[i], sizeof text[i])) text[i][0] = '\0';
        missing = NULL;
        for (int k = 0; k < 16 && missing == NULL; k++)
            if (strstr(text[k / 8], members[k / 8][k % 8]) == NULL) missing = members[k / 8][k % 8];
        for (int i = 0; i < 2 && missing == NULL; i++)
            if (!has_rate(text[i])) missing = "\"frames_hz\"";
        char more[64];
        assert_false(watched_line(&watched, more, sizeof more));
        const int code = watched_end(&watched);
        if (missing == NULL) assert_int_equal(code, 0);
    } while (missing != NULL && fv_test_patient(&end_ns, 0));
    if (missing != NULL) fail_msg("found %s%s, expected %s", text[0], text[1], missing);
}

static void test_table(void **state)
{
    static const char *const arguments[] = {"--once", "--interval", "1", "R*", NULL};
    static const char *const nobody[] = {"--once", "--interval", "1", NULL};
    static const char *const screen[] = {NULL};
    char text[4096];
    (void)state;
    int64_t end_ns = 0;
    bool heard;
    do { /* again where nothing was sent within the interval */
        start(arguments);
        heard = watched_line(&watched, text, sizeof text);
        if (!heard) (void)watched_end(&watched);
    } while (!heard && fv_test_patient(&end_ns, 0));
    assert_true(strncmp(text, "PREFIX ", 7) == 0);
    assert_true(watched_line(&watched, text, sizeof text));
    assert_true(strncmp(text, "RIGHT        lost ", 18) == 0);
    assert_non_null(strstr(text, " 4321 "));
    assert_true(watched_line(&watched, text, sizeof text));
    assert_string_equal(text, "  ms:  pyramid 1.25\n");
    assert_false(watched_line(&watched, text, sizeof text));
    assert_int_equal(watched_end(&watched), 0);
    watched_start(&watched, "top", nobody);
    assert_int_equal(watched_end(&watched), 1);
    watched_start(&watched, "top", screen);
    assert_int_equal(watched_end(&watched), 2); /* a pipe is no screen */
}

/* ---- the screen ------------------------------------------------------------------------------ */

/* Read what the terminal shows until `begin` has come and `end` after it; frames are sent
 * meanwhile. */
static void show_until(int terminal, char *seen, size_t capacity, const char *begin,
                       const char *end)
{
    size_t used = 0;
    const char *begun;
    seen[0] = '\0';
    for (int i = 0; (begun = strstr(seen, begin)) == NULL || strstr(begun, end) == NULL; i++) {
        struct pollfd wait = {.fd = terminal, .events = POLLIN};
        if (i == 6000 || used + 1 == capacity) fail_msg("found %s, expected %s", seen, end);
        send_frame();
        if (poll(&wait, 1, 20) <= 0) continue;
        const ssize_t got = read(terminal, seen + used, capacity - 1 - used);
        if (got <= 0) break;
        used += (size_t)got;
        seen[used] = '\0';
    }
}

/* The longest line without what steers a terminal, and their number, of the screen drawn last. */
static void measure(const char *seen, int *columns, int *lines)
{
    const char *at = seen;
    for (const char *next = seen; (next = strstr(next, "\033[H")) != NULL; next++)
        if (strstr(next, "\033[J") != NULL) at = next;
    *columns = *lines = 0;
    for (int column = 0; *at != '\0' && strncmp(at, "\033[J", 3) != 0; at++) {
        if (*at == '\033') {
            at += strcspn(at, "HKmhlJ");
        } else if (*at == '\n') {
            column = 0;
            ++*lines;
        } else if (*at != '\r' && ++column > *columns) {
            *columns = column;
        }
    }
}

static void test_screen(void **state)
{
    static char seen[1 << 18];
    struct winsize size = {.ws_row = 5, .ws_col = 100};
    struct termios before, after;
    int terminal, columns, lines, status;
    (void)state;
    const pid_t child = forkpty(&terminal, NULL, NULL, &size);
    if (child == 0) watched_exec("top", (const char *const[]){"--interval", "1", NULL});
    assert_int_equal(tcgetattr(terminal, &before), 0);
    show_until(terminal, seen, sizeof seen, "", "LEFT");
    show_until(terminal, seen, sizeof seen, "\033[H", "\033[J"); /* a whole screen */
    measure(seen, &columns, &lines);
    assert_int_equal(columns, 100);
    assert_int_equal(lines, 4); /* title, heading, two of four lines about robots */
    size.ws_row = 30;
    size.ws_col = 40;
    assert_int_equal(ioctl(terminal, TIOCSWINSZ, &size), 0);
    for (int i = 0; i == 0 || (columns != 40 && i < 100); i++) {
        show_until(terminal, seen, sizeof seen, "\033[H", "\033[J"); /* a whole screen */
        measure(seen, &columns, &lines);
    }
    assert_int_equal(columns, 40);
    assert_int_equal(lines, 6);
    assert_null(strstr(seen, "\033[2J")); /* of the robot's name */
    assert_int_equal(write(terminal, "q", 1), 1);
    show_until(terminal, seen, sizeof seen, "", "\033[?1049l");
    for (int i = 0; i < 600; i++) { /* restored after that is written */
        assert_int_equal(tcgetattr(terminal, &after), 0);
        if (after.c_lflag == before.c_lflag || after.c_lflag & ICANON) break;
        usleep(100000);
    }
    assert_true(after.c_lflag == before.c_lflag || after.c_lflag & ICANON);
    while (read(terminal, seen, sizeof seen) > 0)
        continue;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    close(terminal);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_json),
        cmocka_unit_test(test_table),
        cmocka_unit_test(test_screen),
    };
    if (!watched_possible("test_top")) return 0;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
