/* Helper threads beside the loop, and how the loop waits for them. Drivers and the application use
 * them. */
#ifndef FOVEA_DRIVERS_THREAD_H
#define FOVEA_DRIVERS_THREAD_H

#include <pthread.h>
#include <semaphore.h>
#include <stdbool.h>
#include <stdint.h>

enum { FV_THREAD_STACK_BYTES = 256 << 10 };

/* Ordinary scheduling whatever the starter has, FV_THREAD_STACK_BYTES of stack, no signals. 0, or
 * an errno value. Init-only. */
int fv_thread_start(pthread_t *thread, void *(*run)(void *), void *context);

/* Take one of `count`, waiting until CLOCK_MONOTONIC reaches `deadline_ns` (INT64_MAX: no limit; 0:
 * not at all). False: there was none, or a signal came. No heap. */
bool fv_thread_take(sem_t *count, int64_t deadline_ns);

#endif
