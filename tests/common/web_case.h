/* fovea-web, and a run beside it, as children of one test; what a failed test leaves is killed. */
#ifndef FOVEA_TESTS_WEB_CASE_H
#define FOVEA_TESTS_WEB_CASE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <signal.h>
#include <sys/wait.h>

#include <cmocka.h>

#include "common/watched.h"
#include "common/web_client.h"

static struct watched watched; /* the run */
static pid_t running;          /* fovea-web; 0: none */

static inline void start(const char *const *arguments)
{
    running = web_start(arguments);
    assert_true(running > 0);
}

static inline void end(void)
{
    assert_int_equal(web_end(running, true), 0);
    running = 0;
}

static inline void end_run(void)
{
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
    watched.process = 0;
}

static inline int tear_down(void **state)
{
    (void)state;
    if (watched.process > 0) kill(watched.process, SIGKILL);
    if (watched.process > 0) waitpid(watched.process, NULL, 0);
    if (running > 0 && kill(running, SIGKILL) == 0) waitpid(running, NULL, 0);
    watched.process = running = 0;
    return 0;
}

#endif
