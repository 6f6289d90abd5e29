#include "app/run/realtime.h"

#include <errno.h>
#include <link.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

static void say_unlocked(struct fovea_error *why, const char *what, int failure, size_t bytes,
                         const char *needed)
{
    struct rlimit limit = {0};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    fovea_error_set(
        why, FOVEA_OK, "%s not locked: %s; the limit is %llu KiB (ulimit -l), %zu are %s", what,
        strerror(failure), (unsigned long long)limit.rlim_cur / 1024, bytes / 1024 + 1, needed);
}

enum fovea_status fv_realtime_map(size_t bytes, bool lock, void **memory, bool *locked,
                                  struct fovea_error *why)
{
    void *mapped = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (mapped == MAP_FAILED)
        return fovea_error_set(why, FOVEA_ERROR_SYSTEM, "no %zu bytes of memory: %s", bytes,
                               strerror(errno));
    *locked = lock && mlock(mapped, bytes) == 0;
    if (lock && !*locked) say_unlocked(why, "memory is", errno, bytes, "needed");
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

/* ---- the program's own pages ----------------------------------------------------------------- */

struct lock {
    size_t bytes; /* of all parts */
    int failure;  /* the first one, an errno value */
};

/* From its first use on; before Linux 4.4, and under qemu, all of it at once. */
static int lock_part(void *from, size_t bytes)
{
    if (mlock2(from, bytes, MLOCK_ONFAULT) == 0) return 0;
    if (errno != ENOSYS && errno != EINVAL) return errno;
    return mlock(from, bytes) == 0 ? 0 : errno;
}

/* The program, or one of its libraries. */
static int lock_object(struct dl_phdr_info *object, size_t size, void *context)
{
    struct lock *lock = context;
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    (void)size;
    for (int i = 0; i < object->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &object->dlpi_phdr[i];
        const uintptr_t at = object->dlpi_addr + part->p_vaddr, from = at / page * page;
        if (part->p_type != PT_LOAD) continue;
        const size_t bytes = at + part->p_memsz - from;
        lock->bytes += bytes;
        if (lock->failure == 0) lock->failure = lock_part((void *)from, bytes);
    }
    return 0;
}

bool fv_realtime_lock_program(struct fovea_error *why)
{
    struct lock lock = {0, 0};
#ifdef FOVEA_SANITIZED
    const bool able = false; /* sanitizers have mlock do nothing, and make programs large */
#else
    const bool able = true;
#endif
    if (able) dl_iterate_phdr(lock_object, &lock);
    if (lock.failure == 0) return true;
    say_unlocked(why, "the program is", lock.failure, lock.bytes, "needed beside the block");
    return false;
}

/* ---- the thread that the process came with --------------------------------------------------- */

/* What main's thread is asked to do while the program runs on another. */
static struct {
    bool offered; /* set before the program's thread starts */
    sem_t asked, done;
    void *(*body)(void *); /* NULL: the program has ended */
    void *argument;
    int32_t cpu;
    int failure; /* to bind it to `cpu` */
    sem_t begun;
} lent;

struct program {
    int (*run)(int, char **);
    int argc;
    char **argv;
    int end;
};

static void *program_run(void *context)
{
    struct program *program = context;
    program->end = program->run(program->argc, program->argv);
    lent.body = NULL;
    sem_post(&lent.asked);
    return NULL;
}

static void wait_for(sem_t *semaphore)
{
    while (sem_wait(semaphore) != 0) {
    } /* a signal came */
}

static int bind_here(int32_t cpu)
{
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((unsigned)cpu, &set);
    return sched_setaffinity(0, sizeof set, &set) == 0 ? 0 : errno;
}

static void lent_serve(void)
{
    cpu_set_t before;
    const bool known = sched_getaffinity(0, sizeof before, &before) == 0;
    for (;;) {
        wait_for(&lent.asked);
        if (lent.body == NULL) return;
        lent.failure = lent.cpu >= 0 ? bind_here(lent.cpu) : 0;
        sem_post(&lent.begun);
        lent.body(lent.argument);
        if (lent.cpu >= 0 && lent.failure == 0 && known)
            (void)sched_setaffinity(0, sizeof before, &before);
        sem_post(&lent.done);
    }
}

/* A thread as main's: with a stack of the process's limit. Its scheduling is ordinary by
 * SCHED_RESET_ON_FORK; where that flag could not be had it is asked for. */
static int program_start(pthread_t *thread, int policy, struct program *program)
{
    pthread_attr_t attributes;
    int failure = pthread_attr_init(&attributes);
    if (failure != 0) return failure;
    if ((policy & SCHED_RESET_ON_FORK) == 0) {
        const struct sched_param ordinary = {.sched_priority = 0};
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
        pthread_attr_setschedparam(&attributes, &ordinary);
    }
    failure = pthread_create(thread, &attributes, program_run, program);
    pthread_attr_destroy(&attributes);
    return failure;
}

int fv_realtime_main(int (*program)(int, char **), int argc, char **argv)
{
    struct program given = {program, argc, argv, 0};
    pthread_t thread;
    struct sched_param given_priority;
    int policy = sched_getscheduler(0);
    const int kind = policy < 0 ? SCHED_OTHER : policy & ~SCHED_RESET_ON_FORK;
    if (kind != SCHED_FIFO && kind != SCHED_RR) return program(argc, argv);
    /* Where it lacks the flag, as from chrt without -R, it takes it, so that no thread of this
     * process becomes real-time. */
    if (policy == kind && sched_getparam(0, &given_priority) == 0 &&
        sched_setscheduler(0, kind | SCHED_RESET_ON_FORK, &given_priority) == 0)
        policy |= SCHED_RESET_ON_FORK;
    sem_init(&lent.asked, 0, 0);
    sem_init(&lent.begun, 0, 0);
    sem_init(&lent.done, 0, 0);
    lent.offered = true;
    if (program_start(&thread, policy, &given) != 0) {
        lent.offered = false;
        return program(argc, argv);
    }
    sigset_t all; /* signals are the program's thread's */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, NULL);
    lent_serve();
    pthread_join(thread, NULL);
    return given.end;
}

/* ---- threads of our own ---------------------------------------------------------------------- */

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

/* `unbound`: why it is not on its processor, an errno value. */
static void say_why(struct fv_realtime_rights *rights, uint32_t priority, int32_t cpu, int unbound)
{
    char no_fifo[96] = "", not_bound[128] = "";
    if (priority > 0 && !rights->fifo)
        snprintf(no_fifo, sizeof no_fifo,
                 "no SCHED_FIFO: not permitted; 'ulimit -r %u' or CAP_SYS_NICE would permit it",
                 (unsigned)priority);
    if (cpu >= 0 && !rights->bound)
        snprintf(not_bound, sizeof not_bound, "not bound to processor %d: %s", (int)cpu,
                 unbound == EPERM ? "not permitted; 'SystemCallFilter=sched_setaffinity' in the "
                                    "service would permit it"
                                  : "there is no such one");
    if (no_fifo[0] != '\0' || not_bound[0] != '\0')
        fovea_error_set(&rights->why, FOVEA_OK, "%s%s%s", not_bound,
                        not_bound[0] != '\0' && no_fifo[0] != '\0' ? "; " : "", no_fifo);
}

static void lent_start(int32_t cpu, void *(*body)(void *), void *argument,
                       struct fv_realtime_rights *rights)
{
    lent.body = body;
    lent.argument = argument;
    lent.cpu = cpu;
    sem_post(&lent.asked);
    wait_for(&lent.begun);
    *rights = (struct fv_realtime_rights){
        .fifo = true, .lent = true, .bound = cpu >= 0 && lent.failure == 0};
    say_why(rights, 0, cpu, lent.failure);
}

enum fovea_status fv_realtime_start(struct fv_realtime_thread *thread, uint32_t priority,
                                    int32_t cpu, void *(*body)(void *), void *argument,
                                    struct fv_realtime_rights *rights, struct fovea_error *error)
{
    int failure = 0, unbound = 0;
    thread->lent = lent.offered;
    if (lent.offered) {
        lent_start(cpu, body, argument, rights);
        return FOVEA_OK;
    }
    *rights = (struct fv_realtime_rights){.fifo = priority > 0, .bound = cpu >= 0};
    /* What is not permitted and what is not there are gone without, one after the other. */
    for (int tries = 0; tries < 3; tries++) {
        if (start(&thread->thread, rights->fifo ? priority : 0, rights->bound ? cpu : -1, body,
                  argument, &failure) == FOVEA_OK) {
            say_why(rights, priority, cpu, unbound);
            return FOVEA_OK;
        }
        if (failure == EPERM && rights->fifo) {
            rights->fifo = false;
        } else if ((failure == EINVAL || failure == EPERM) && rights->bound) {
            rights->bound = false;
            unbound = failure;
        } else {
            break;
        }
    }
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "the loop's thread could not be started: %s",
                           strerror(failure));
}

void fv_realtime_join(struct fv_realtime_thread *thread)
{
    if (thread->lent)
        wait_for(&lent.done);
    else
        pthread_join(thread->thread, NULL);
}

void fv_realtime_touch_stack(void)
{
#ifndef FOVEA_SANITIZED /* sanitizers put their own data on the stack and leave less of it */
    volatile char stack[FV_THREAD_STACK_BYTES / 2];
    for (size_t at = 0; at < sizeof stack; at += 1024)
        stack[at] = 0;
#endif
}
