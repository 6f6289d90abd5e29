/* Real-time means of the system: memory that stays, and a thread that runs first. Init-only. What
 * the system does not permit is no error: it is a warning that names the remedy. */
#ifndef FOVEA_APP_RUN_REALTIME_H
#define FOVEA_APP_RUN_REALTIME_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "drivers/thread.h" /* FV_THREAD_STACK_BYTES */
#include "fovea/status.h"

/* Map `bytes` of zeroed memory, lock it when asked to, and touch every page. Whether it could be
 * locked is in
 * `*locked`; if not, `why` says so. FOVEA_ERROR_SYSTEM: no memory. */
enum fovea_status fv_realtime_map(size_t bytes, bool lock, void **memory, bool *locked,
                                  struct fovea_error *why);
void fv_realtime_unmap(void *memory, size_t bytes);
/* Give the pages of the last `tail` of `bytes` mapped bytes back to the system: they read as zero.
 */
void fv_realtime_release(void *memory, size_t bytes, size_t tail);

/* Lock what the process has of the files of its program and its libraries, code and data: where
 * memory is scarce the kernel takes back what was not used just now, also where nothing is swapped,
 * and the loop would wait for the disk. A page is locked from its first use on; what is never used
 * is not read for it, though it counts against the limit. False: `why` says what is missing. */
bool fv_realtime_lock_program(struct fovea_error *why);

struct fv_realtime_rights {
    bool fifo;  /* runs under SCHED_FIFO; a lent one under SCHED_RR, where it came so */
    bool bound; /* runs on the processor that was asked for */
    bool lent;  /* on the thread that the process was started with, at the priority it came with */
    struct fovea_error
        why; /* what was not permitted, one line; "" when nothing was asked in vain */
};

struct fv_realtime_thread {
    pthread_t thread;
    bool lent;
};

/* Start a thread with a stack of FV_THREAD_STACK_BYTES under SCHED_FIFO `priority` (0:
 * ordinary) on processor `cpu` (-1: any). What is not permitted is left out and stated in `rights`.
 * In a process that was started real-time (fv_realtime_main) it is the thread that came so, one
 * at a time, whatever `priority`: nothing is asked of the system then. */
enum fovea_status fv_realtime_start(struct fv_realtime_thread *thread, uint32_t priority,
                                    int32_t cpu, void *(*body)(void *), void *argument,
                                    struct fv_realtime_rights *rights, struct fovea_error *error);
/* Wait for its end, once. */
void fv_realtime_join(struct fv_realtime_thread *thread);

/* Run `program` and return what it returns. In a process that a service manager (systemd's
 * CPUSchedulingPolicy=fifo) or chrt(1) started real-time, all of it runs on a thread of ordinary
 * scheduling, and the calling thread stays real-time and waits for what fv_realtime_start gives it:
 * so the loop alone is real-time, and the right to become so is not needed. Once, from main. */
int fv_realtime_main(int (*program)(int, char **), int argc, char **argv);

/* Touch half of the calling thread's stack, so that the loop meets no page fault there. */
void fv_realtime_touch_stack(void);

#endif
