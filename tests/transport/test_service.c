/* What a service manager learns: ready with the first beat of the loop, a sign of life only while
 * it beats, stopping at the end; and that a run that is stopped gives none. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/run/service.h"
#include "common/patience.h"
#include "common/watched.h"

static char folder[] = "/tmp/fovea_service_XXXXXX", path[64];
static int manager = -1;

static int set_up(void **state)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)state;
    if (manager < 0 && mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/notify", folder);
    unlink(path);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    manager = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    setenv("NOTIFY_SOCKET", path, 1);
    setenv("WATCHDOG_USEC", "60000", 1);
    unsetenv("WATCHDOG_PID");
    return bind(manager, (const struct sockaddr *)&address, sizeof address);
}

static int tear_down(void **state)
{
    (void)state;
    close(manager);
    return 0;
}

enum { PATIENCE_MS = FV_TEST_PATIENCE_S * 1000 };

/* The next datagram; "": none within so long. */
static const char *heard(int timeout_ms)
{
    static char text[256];
    const struct timeval patience = {timeout_ms / 1000, timeout_ms % 1000 * 1000 + 1};
    setsockopt(manager, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ssize_t got;
    do /* one with a timeout is not begun again by itself */
        got = recv(manager, text, sizeof text - 1, 0);
    while (got < 0 && errno == EINTR);
    text[got > 0 ? got : 0] = '\0';
    return text;
}

static void expect_heard(const char *text)
{
    for (const char *found = heard(PATIENCE_MS); strcmp(found, text) != 0;
         found = heard(PATIENCE_MS))
        if (found[0] == '\0') fail_msg("found nothing more, expected %s", text);
}

static void a_sign_of_life_needs_a_beat(void **state)
{
    static _Atomic uint64_t beats;
    struct fv_service service;
    (void)state;
    fv_service_open(&service, &beats);
    assert_string_equal(heard(200), ""); /* not ready before the loop runs */
    atomic_store(&beats, 1);
    assert_string_equal(heard(PATIENCE_MS), "READY=1");
    assert_string_equal(heard(PATIENCE_MS), "WATCHDOG=1");
    assert_string_equal(heard(200), ""); /* the loop hangs */
    atomic_store(&beats, 2);
    assert_string_equal(heard(PATIENCE_MS), "WATCHDOG=1");
    fv_service_state(&service, "lost");
    assert_string_equal(heard(PATIENCE_MS), "STATUS=pose: lost");
    fv_service_close(&service);
    assert_string_equal(heard(PATIENCE_MS), "STOPPING=1");
    assert_string_equal(heard(50), "");
}

static void ready_is_said_again_while_the_manager_takes_nothing(void **state)
{
    static _Atomic uint64_t beats = 1;
    static struct fv_service service; /* its thread outlives a failure */
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    (void)state;
    snprintf(to.sun_path, sizeof to.sun_path, "%s", path);
    const int other = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    while (sendto(other, "x", 1, 0, (const struct sockaddr *)&to, sizeof to) == 1)
        continue; /* until its queue is full */
    close(other);
    fv_service_open(&service, &beats);
    usleep(200000);
    expect_heard("READY=1");
    fv_service_close(&service);
}

static void without_a_watchdog_there_is_no_sign_of_life(void **state)
{
    static _Atomic uint64_t beats;
    static const char *const others[] = {"12x", "", "999"};
    (void)state;
    for (int i = 0; i < 4; i++) {
        struct fv_service service;
        if (i < 3) setenv("WATCHDOG_USEC", others[i], 1);
        if (i == 3) { /* of another process */
            setenv("WATCHDOG_USEC", "60000", 1);
            setenv("WATCHDOG_PID", "1", 1);
        }
        atomic_store(&beats, 1);
        fv_service_open(&service, &beats);
        assert_string_equal(heard(PATIENCE_MS), "READY=1");
        fv_service_close(&service);
        assert_string_equal(heard(PATIENCE_MS), "STOPPING=1");
    }
}

static void a_name_that_is_none_is_ignored(void **state)
{
    static _Atomic uint64_t beats = 1;
    char long_name[200] = "/";
    struct fv_service service;
    (void)state;
    memset(long_name + 1, 'x', sizeof long_name - 2);
    const char *const names[] = {"", "relative", long_name, "/none/x"};
    for (int i = 0; i < 4; i++) {
        setenv("NOTIFY_SOCKET", names[i], 1);
        fv_service_open(&service, &beats);
        fv_service_close(&service);
    }
    unsetenv("NOTIFY_SOCKET");
    fv_service_open(&service, &beats);
    assert_false(service.running);
    fv_service_close(&service);
}

static void a_run_is_ready_alive_and_stopping(void **state)
{
    static struct watched watched;
    const char *const arguments[] = {WATCHED_RUN("sim:orbit?width=160&height=120&frames=100000"),
                                     "--set", "lcm_url=", NULL};
    (void)state;
    setenv("WATCHDOG_USEC", "600000", 1);
    watched_start(&watched, "run", arguments);
    expect_heard("READY=1");
    for (int i = 0; i < 3; i++)
        expect_heard("WATCHDOG=1");
    expect_heard("STATUS=pose: tracking");
    assert_int_equal(kill(watched.process, SIGSTOP), 0);
    while (heard(1500)[0] != '\0') { /* what was sent before it stopped */
    }
    assert_int_equal(kill(watched.process, SIGCONT), 0);
    expect_heard("WATCHDOG=1");
    watched_interrupt(&watched);
    expect_heard("STOPPING=1");
    assert_int_equal(watched_end(&watched), 0);
}

int main(void)
{
    if (!watched_possible("test_service")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_sign_of_life_needs_a_beat, set_up, tear_down),
        cmocka_unit_test_setup_teardown(ready_is_said_again_while_the_manager_takes_nothing, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(without_a_watchdog_there_is_no_sign_of_life, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_name_that_is_none_is_ignored, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_run_is_ready_alive_and_stopping, set_up, tear_down),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    rmdir(folder);
    return failed;
}
