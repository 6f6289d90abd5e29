/* A signal while something is still being opened: what computes is given time, and nothing hangs:
 * neither what waits nor what asks again and again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <signal.h>
#include <stdatomic.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "app/run/signals.h"
#include "common/patience.h"
#include "drivers/clock.h"

enum { ENDED = 7, COMPUTES_MS = 2 * FV_SIGNALS_PATIENCE_MS };

static void lose_nothing(const void *context, char *text, size_t bytes)
{
    (void)context;
    if (bytes > 0) text[0] = '\0';
}

static void compute(int64_t ns)
{
    const int64_t begin_ns = fv_clock_ns(CLOCK_THREAD_CPUTIME_ID);
    while (fv_clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_ns < ns) {
    }
}

/* As a driver that waits for a device in steps: a fifth of a processor. */
static void ask_for_ever(void)
{
    for (;;) {
        compute(250000);
        usleep(1000);
    }
}

static void wait_for_ever(void)
{
    for (;;)
        pause();
}

/* For longer than what waits is given, however little of the processor it gets in that time. */
static void compute_and_end(void)
{
    const int64_t end_ns = fv_clock_ns(CLOCK_MONOTONIC) + COMPUTES_MS * INT64_C(1000000);
    while (fv_clock_ns(CLOCK_MONOTONIC) < end_ns)
        compute(100000);
    fv_signals_opened();
    _exit(ENDED);
}

/* A process that opens so, and has got the signal. */
static pid_t begin(void (*open)(void))
{
    int ready[2];
    char byte = 0;
    assert_int_equal(pipe(ready), 0);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        static atomic_bool stop;
        const struct fv_signals signals = {
            .stop = &stop, .lost = lose_nothing, .context = NULL, .reload = NULL};
        struct fovea_error error;
        if (fv_signals_watch(&signals, &error) != FOVEA_OK) _exit(1);
        if (write(ready[1], &byte, 1) != 1) _exit(1);
        open();
    }
    assert_int_equal(read(ready[0], &byte, 1), 1);
    close(ready[0]);
    close(ready[1]);
    kill(child, SIGTERM);
    return child;
}

/* Its status. */
static int end(pid_t child)
{
    int status = 0;
    int64_t end_ns = 0;
    pid_t ended;
    while ((ended = waitpid(child, &status, WNOHANG)) == 0 && fv_test_patient(&end_ns, 10)) {
    }
    if (ended == child) return status;
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    fail_msg("it did not end in %d s", FV_TEST_PATIENCE_S);
    return -1;
}

static int64_t since_ms(int64_t begin_ns)
{
    return (fv_clock_ns(CLOCK_MONOTONIC) - begin_ns) / 1000000;
}

static void what_is_opened_has_its_time(void **state)
{
    const int64_t begin_ns = fv_clock_ns(CLOCK_MONOTONIC);
    (void)state;
    const pid_t waits = begin(wait_for_ever), computes = begin(compute_and_end),
                asks = begin(ask_for_ever);
    int status = end(waits);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
    assert_true(since_ms(begin_ns) >= FV_SIGNALS_PATIENCE_MS);
    assert_int_equal(waitpid(asks, &status, WNOHANG), 0); /* that waits is enough */
    status = end(computes);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == ENDED);
    status = end(asks);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
    assert_true(since_ms(begin_ns) >= FV_SIGNALS_DISK_MS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_opened_has_its_time)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
