/* How many connections fovea-web keeps: nothing is left of a thousand, one address does not take
 * all of them, and pages are counted. No run is needed. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/patience.h"
#include "common/web_case.h"
#include "drivers/clock.h"

#define OURS "Origin: http://127.0.0.1:7680\r\n"

static char folder[] = "/tmp/fovea_web_many_XXXXXX", token_path[64], socket_path[64];
static char answer[WEB_ANSWER_BYTES];

static void begin(void)
{
    const char *const arguments[] = {"--feed", socket_path, "--lcm-url", "", NULL};
    start(arguments);
}

static int descriptors(pid_t process)
{
    char path[64];
    int count = 0;
    snprintf(path, sizeof path, "/proc/%d/fd", (int)process);
    DIR *all = opendir(path);
    assert_non_null(all);
    while (readdir(all) != NULL)
        count++;
    closedir(all);
    return count;
}

static long resident_kb(pid_t process)
{
    char path[64], line[200];
    long kb = -1;
    snprintf(path, sizeof path, "/proc/%d/status", (int)process);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file) != NULL)
        if (strncmp(line, "VmRSS:", 6) == 0) kb = strtol(line + 6, NULL, 10);
    fclose(file);
    return kb;
}

static void connections(int count)
{
    for (int i = 0; i < count; i++) {
        int to = -1;
        if (i % 3 == 0)
            assert_int_equal(web_open(OURS, "", &to), 101);
        else
            to = web_connect();
        assert_true(to >= 0);
        if (i % 3 == 1) (void)web_send(to, "GET / HTTP/1.1\r\nHost: 127");
        close(to);
    }
}

static void a_thousand_connections_leave_nothing_behind(void **state)
{
    (void)state;
    begin();
    connections(100); /* memory that is taken once */
    assert_int_equal(web_get("/", "", answer), 200);
    usleep(200000);
    const int before = descriptors(running);
    const long before_kb = resident_kb(running);
    connections(1000);
    int after = before + 1;
    int64_t end_ns = 0;
    while (after > before && fv_test_patient(&end_ns, 10)) { /* it sees the last ends later */
        assert_int_equal(web_get("/", "", answer), 200);
        after = descriptors(running);
    }
    assert_true(after <= before);
#ifndef FOVEA_SANITIZED
    if (resident_kb(running) > before_kb + 1024)
        fail_msg("%ld kB before, %ld after", before_kb, resident_kb(running));
#endif
    (void)before_kb;
    end();
}

/* Of the sockets those that the server has not closed, now the first; how many they are. */
static int left_open(int sockets[], int count)
{
    int open = 0;
    char byte;
    for (int i = 0; i < count; i++) {
        if (recv(sockets[i], &byte, 1, MSG_DONTWAIT) < 0 && errno == EAGAIN)
            sockets[open++] = sockets[i];
        else
            close(sockets[i]);
    }
    return open;
}

/* Connections from an address of this host's; returns how many are not refused. The server refuses
 * by closing, and leaves idle ones open for seconds: `expected` says how many it is waited for. */
static int connect_from(const char *address, int count, int expected, int sockets[])
{
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons(WEB_PORT),
                                   .sin_addr.s_addr = inet_addr("10.11.0.1")},
                             from = {.sin_family = AF_INET, .sin_addr.s_addr = inet_addr(address)};
    int open = count;
    int64_t end_ns = 0;
    for (int i = 0; i < count; i++) {
        sockets[i] = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        assert_int_equal(bind(sockets[i], (const struct sockaddr *)&from, sizeof from), 0);
        assert_int_equal(connect(sockets[i], (const struct sockaddr *)&to, sizeof to), 0);
    }
    while (open > expected && fv_test_patient(&end_ns, 10))
        open = left_open(sockets, open);
    usleep(500000);
    return left_open(sockets, open); /* and no more */
}

static void close_all(const int sockets[], int count)
{
    for (int i = 0; i < count; i++)
        close(sockets[i]);
}

/* Whether one address has as many connections as it may, with half a request each, and yet others
 * get a page sooner than such a request is given up, which is after 5 s, and connections. */
static bool others_are_served(void)
{
    enum { OF_ADDRESS = 32, TRIES = 40, OTHERS = 4 };
    int sockets[TRIES], others[OTHERS];
    const int open = connect_from("10.11.0.2", TRIES, OF_ADDRESS, sockets);
    assert_true(open <= OF_ADDRESS);
    for (int i = 0; i < open; i++)
        (void)web_send(sockets[i], "GET / HTTP/1.1\r\nHost: 10.");
    const int64_t asked_ns = fv_clock_ns(CLOCK_MONOTONIC);
    assert_int_equal(web_get("/app.js", "", answer), 401);
    const bool soon = fv_clock_ns(CLOCK_MONOTONIC) - asked_ns < 4 * FV_SECOND_NS;
    const int more = connect_from("10.11.0.3", OTHERS, OTHERS, others);
    close_all(sockets, open);
    close_all(others, more);
    return open == OF_ADDRESS && soon && more == OTHERS;
}

static void one_address_does_not_keep_the_others_out(void **state)
{
    const char *const arguments[] = {"--feed",  socket_path, "--lcm-url", "",  "--address",
                                     "0.0.0.0", "--token",   token_path,  NULL};
    int sockets[8], open = 0;
    int64_t served_ns = 0, end_ns = 0;
    bool served = false;
    (void)state;
    assert_int_equal(system("ip addr add 10.11.0.1/24 dev lo && ip addr add 10.11.0.2/24 dev lo "
                            "&& ip addr add 10.11.0.3/24 dev lo"),
                     0);
    start(arguments);
    while (!(served = others_are_served()) && fv_test_patient(&served_ns, 10)) {
    } /* on a machine that stands still for seconds, again */
    assert_true(served);
    do { /* there is room again */
        close_all(sockets, open);
        open = connect_from("10.11.0.2", 8, 8, sockets);
    } while (open < 8 && fv_test_patient(&end_ns, 10));
    assert_int_equal(open, 8);
    close_all(sockets, open);
    end();
}

static void more_pages_than_there_is_room_for_are_refused(void **state)
{
    enum { ROOM = 24 };
    int sockets[ROOM], one;
    (void)state;
    begin();
    for (int i = 0; i < ROOM; i++)
        assert_int_equal(web_open(OURS, "", &sockets[i]), 101);
    assert_int_equal(web_open(OURS, "", &one), 503);
    assert_int_equal(web_get("/", "", answer), 200);
    close(sockets[3]);
    int64_t end_ns = 0;
    while (web_open(OURS, "", &sockets[3]) != 101 && fv_test_patient(&end_ns, 10)) {
    }
    assert_true(sockets[3] >= 0);
    for (int i = 0; i < ROOM; i++)
        close(sockets[i]);
    end();
}

int main(void)
{
    if (!web_possible("test_web_connections") || !watched_possible("test_web_connections"))
        return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_thousand_connections_leave_nothing_behind, tear_down),
        cmocka_unit_test_teardown(one_address_does_not_keep_the_others_out, tear_down),
        cmocka_unit_test_teardown(more_pages_than_there_is_room_for_are_refused, tear_down),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    snprintf(socket_path, sizeof socket_path, "%s/feed", folder);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(token_path);
    rmdir(folder);
    return failed;
}
