#include "app/run/realtime.h"

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

enum fovea_status fv_realtime_map(size_t bytes, bool lock, void **memory, bool *locked,
                                  struct fovea_error *why)
{
    void *mapped = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapped == MAP_FAILED)
        return fovea_error_set(why, FOVEA_ERROR_SYSTEM, "no %zu bytes of memory: %s", bytes,
                               strerror(errno));
    *locked = lock && mlock(mapped, bytes) == 0;
    if (lock && !*locked) {
        struct rlimit limit = {0};
        getrlimit(RLIMIT_MEMLOCK, &limit);
        fovea_error_set(
            why, FOVEA_OK,
            "memory is not locked: %s; the limit is %llu KiB (ulimit -l), %zu are needed",
            strerror(errno), (unsigned long long)limit.rlim_cur / 1024, bytes / 1024 + 1);
    }
    size_t page = (size_t)sysconf(_SC_PAGESIZE);
    for (size_t at = 0; at < bytes; at += page)
        ((volatile char *)mapped)[at] = 0;
    *memory = mapped;
    return FOVEA_OK;
}

void fv_realtime_unmap(void *memory, size_t bytes)
{
    munmap(memory, bytes);
}

void fv_realtime_release(void *memory, size_t bytes, size_t tail)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE),
                 from = (bytes - tail + page - 1) / page * page;
    if (from >= bytes) return;
    munlock((uint8_t *)memory + from, bytes - from);
    madvise((uint8_t *)memory + from, bytes - from, MADV_DONTNEED);
}

static enum fovea_status start(pthread_t *thread, uint32_t priority, int32_t cpu,
                               void *(*body)(void *), void *argument, int *failure)
{
    pthread_attr_t attributes;
    *failure = pthread_attr_init(&attributes);
    if (*failure == 0) *failure = pthread_attr_setstacksize(&attributes, FV_THREAD_STACK_BYTES);
    if (*failure == 0 && priority > 0) {
        struct sched_param parameter = {.sched_priority = (int)priority};
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
        *failure = pthread_attr_setschedparam(&attributes, &parameter);
    }
    if (*failure == 0 && cpu >= 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET((unsigned)cpu, &set);
        *failure = pthread_attr_setaffinity_np(&attributes, sizeof set, &set);
    }
    if (*failure == 0) *failure = pthread_create(thread, &attributes, body, argument);
    pthread_attr_destroy(&attributes);
    return *failure == 0 ? FOVEA_OK : FOVEA_ERROR_SYSTEM;
}

static void say_why(struct fv_realtime_rights *rights, uint32_t priority, int32_t cpu)
{
    char no_fifo[96] = "", not_bound[96] = "";
    if (priority > 0 && !rights->fifo)
        snprintf(no_fifo, sizeof no_fifo,
                 "no SCHED_FIFO: not permitted; 'ulimit -r %u' or CAP_SYS_NICE would permit it",
                 (unsigned)priority);
    if (cpu >= 0 && !rights->bound)
        snprintf(not_bound, sizeof not_bound, "not bound to processor %d: there is no such one",
                 (int)cpu);
    if (no_fifo[0] != '\0' || not_bound[0] != '\0')
        fovea_error_set(&rights->why, FOVEA_OK, "%s%s%s", not_bound,
                        not_bound[0] != '\0' && no_fifo[0] != '\0' ? "; " : "", no_fifo);
}

enum fovea_status fv_realtime_start(pthread_t *thread, uint32_t priority, int32_t cpu,
                                    void *(*body)(void *), void *argument,
                                    struct fv_realtime_rights *rights, struct fovea_error *error)
{
    int failure = 0;
    *rights = (struct fv_realtime_rights){.fifo = priority > 0, .bound = cpu >= 0};
    /* What is not permitted and what is not there are gone without, one after the other. */
    for (int tries = 0; tries < 3; tries++) {
        if (start(thread, rights->fifo ? priority : 0, rights->bound ? cpu : -1, body, argument,
                  &failure) == FOVEA_OK) {
            say_why(rights, priority, cpu);
            return FOVEA_OK;
        }
        if (failure == EPERM && rights->fifo)
            rights->fifo = false;
        else if (failure == EINVAL && rights->bound)
            rights->bound = false;
        else
            break;
    }
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "the loop's thread could not be started: %s",
                           strerror(failure));
}

void fv_realtime_touch_stack(void)
{
#ifndef FOVEA_SANITIZED /* sanitizers put their own data on the stack and leave less of it */
    volatile char stack[FV_THREAD_STACK_BYTES / 2];
    for (size_t at = 0; at < sizeof stack; at += 1024)
        stack[at] = 0;
#endif
}
