/* Calls that wait are found; calls whose thread computes are not taken for them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/patience.h"
#include "support/stall.h"

static int64_t clock_ns(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void test_a_call_that_waits_grows_old(void **state)
{
    struct fv_stall first, later;
    int64_t moved_ns;
    (void)state;
    assert_false(fv_stall_longest(&first, &moved_ns));
    const int call = fv_stall_enter("a.lcm");
    assert_true(fv_stall_longest(&first, &moved_ns));
    assert_string_equal(first.name, "a.lcm");
    nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
    assert_true(fv_stall_longest(&later, &moved_ns));
    assert_int_equal(later.since_ns, first.since_ns);
    fv_stall_move(call);
    assert_true(fv_stall_longest(&later, &moved_ns));
    assert_true(later.since_ns >= first.since_ns + 100000000);
    assert_true(moved_ns <= later.since_ns && moved_ns >= first.since_ns + 100000000);
    fv_stall_move(-1); /* the calls of this thread, whichever they are */
    first = later;
    assert_true(fv_stall_longest(&later, &moved_ns));
    assert_true(later.since_ns > first.since_ns);
    fv_stall_leave(call);
    assert_false(fv_stall_longest(&later, &moved_ns));
}

static void test_a_call_that_computes_stays_young(void **state)
{
    struct fv_stall first, later;
    int64_t moved_ns;
    (void)state;
    const int call = fv_stall_enter("picture.png");
    assert_true(fv_stall_longest(&first, &moved_ns));
    const int64_t begin_ns = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    while (clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_ns < 2 * FV_STALL_COMPUTES_NS)
        ;
    assert_true(fv_stall_longest(&later, &moved_ns));
    assert_true(later.id == first.id);
    assert_true(later.since_ns >= first.since_ns + FV_STALL_COMPUTES_NS);
    fv_stall_leave(call);
}

/* A thread that has no processor, for another that goes first has the only one that it may use. */
struct starved {
    int call;
    atomic_bool entered, stop;
};

static void *compute(void *context)
{
    struct starved *starved = context;
    starved->call = fv_stall_enter("picture.png");
    atomic_store(&starved->entered, true);
    while (!atomic_load(&starved->stop))
        ;
    fv_stall_leave(starved->call);
    return NULL;
}

static void stay_on(int cpu)
{
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(cpu, &set);
    assert_int_equal(pthread_setaffinity_np(pthread_self(), sizeof set, &set), 0);
}

static void test_a_call_that_waits_for_the_processor_stays_young(void **state)
{
    (void)state;
    struct starved starved = {.call = -1};
    struct fv_stall first, later;
    int64_t moved_ns;
    cpu_set_t all;
    pthread_t thread;
    const struct sched_param idle = {0}, before = {.sched_priority = 1};
    assert_int_equal(pthread_getaffinity_np(pthread_self(), sizeof all, &all), 0);
    if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &before) != 0) {
        printf("SKIPPED a thread without a processor: real-time scheduling is not permitted\n");
        return;
    }
    assert_int_equal(pthread_setschedparam(pthread_self(), SCHED_OTHER, &idle), 0);
    stay_on(sched_getcpu());
    assert_int_equal(pthread_create(&thread, NULL, compute, &starved), 0);
    while (!atomic_load(&starved.entered))
        sched_yield();
    assert_int_equal(pthread_setschedparam(pthread_self(), SCHED_FIFO, &before), 0);
    assert_true(fv_stall_longest(&first, &moved_ns));
    const int64_t begin_ns = clock_ns(CLOCK_MONOTONIC), cpu_ns = clock_ns(first.cpu);
    while (clock_ns(CLOCK_MONOTONIC) - begin_ns < 100000000)
        ;
    const int64_t had_ns = clock_ns(first.cpu) - cpu_ns;
    assert_true(fv_stall_longest(&later, &moved_ns));
    assert_int_equal(pthread_setschedparam(pthread_self(), SCHED_OTHER, &idle), 0);
    atomic_store(&starved.stop, true);
    pthread_join(thread, NULL);
    assert_int_equal(pthread_setaffinity_np(pthread_self(), sizeof all, &all), 0);
    assert_true(had_ns < FV_STALL_COMPUTES_NS);
    assert_true(later.since_ns >= first.since_ns + 100000000);
}

static atomic_bool waited;

/* Whoever called vfork waits as for a disk until the child is gone. */
static void *wait_in_the_kernel(void *context)
{
    const int call = fv_stall_enter("a.lcm");
    const pid_t child = vfork();
    if (child == 0) {
        nanosleep(&(struct timespec){.tv_nsec = 300000000}, NULL);
        _exit(0);
    }
    waitpid(child, NULL, 0);
    fv_stall_leave(call);
    atomic_store(&waited, true);
    return context;
}

static void test_who_waits_for_a_disk_is_known(void **state)
{
    (void)state;
    struct fv_stall call;
    int64_t moved_ns;
    bool disk = false;
    pthread_t thread;
    if (getenv("FOVEA_EMULATED") != NULL) {
        printf("SKIPPED who waits for a disk: emulated, vfork is fork\n");
        return;
    }
    const int own = fv_stall_enter("a pipe");
    assert_true(fv_stall_longest(&call, &moved_ns));
    assert_false(call.disk);
    fv_stall_leave(own);
    int64_t end_ns = 0;
    do { /* again where this thread had no processor while that one waited */
        atomic_store(&waited, false);
        assert_int_equal(pthread_create(&thread, NULL, wait_in_the_kernel, NULL), 0);
        while (!disk && !atomic_load(&waited)) {
            disk = fv_stall_longest(&call, &moved_ns) && call.disk;
            nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
        }
        pthread_join(thread, NULL);
    } while (!disk && fv_test_patient(&end_ns, 0));
    assert_true(disk);
    assert_string_equal(call.name, "a.lcm");
}

/* More calls than the table holds: those beyond are not watched, and harm nothing. */
static void test_a_full_table_takes_no_more(void **state)
{
    int calls[FV_STALL_CALLS_MAX + 2];
    struct fv_stall longest;
    int64_t moved_ns;
    (void)state;
    for (int i = 0; i < FV_STALL_CALLS_MAX + 2; i++)
        calls[i] = fv_stall_enter("x");
    assert_int_equal(calls[FV_STALL_CALLS_MAX - 1], FV_STALL_CALLS_MAX - 1);
    assert_int_equal(calls[FV_STALL_CALLS_MAX], -1);
    for (int i = 0; i < FV_STALL_CALLS_MAX + 2; i++)
        fv_stall_leave(calls[i]);
    assert_false(fv_stall_longest(&longest, &moved_ns));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_call_that_waits_grows_old),
        cmocka_unit_test(test_a_call_that_computes_stays_young),
        cmocka_unit_test(test_a_call_that_waits_for_the_processor_stays_young),
        cmocka_unit_test(test_who_waits_for_a_disk_is_known),
        cmocka_unit_test(test_a_full_table_takes_no_more),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
