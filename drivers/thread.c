#include "thread.h"

#include <sched.h>
#include <signal.h>

#include "clock.h"

int fv_thread_start(pthread_t *thread, void *(*run)(void *), void *context)
{
    pthread_attr_t attributes;
    const struct sched_param ordinary = {.sched_priority = 0};
    sigset_t all, before;
    int failed = pthread_attr_init(&attributes);
    if (failed != 0) return failed;
    pthread_attr_setstacksize(&attributes, FV_THREAD_STACK_BYTES);
    /* It is ordinary by itself, but where this thread is real-time without the flag; a service that
     * was started real-time may not ask for it. */
    const int policy = sched_getscheduler(0);
    if (policy > 0 && (policy & SCHED_RESET_ON_FORK) == 0) {
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
        pthread_attr_setschedparam(&attributes, &ordinary);
    }
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    failed = pthread_create(thread, &attributes, run, context);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    return failed;
}

bool fv_thread_take(sem_t *count, int64_t deadline_ns)
{
    if (sem_trywait(count) == 0) return true;
    if (deadline_ns <= 0) return false;
    if (deadline_ns == INT64_MAX) return sem_wait(count) == 0;
    const struct timespec deadline = fv_clock_timespec(deadline_ns);
    return sem_clockwait(count, CLOCK_MONOTONIC, &deadline) == 0;
}
