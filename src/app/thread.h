/* Helper threads beside the loop: ordinary scheduling whatever the starter has, 256 KiB of stack, no signals.
 */
#ifndef FOVEA_APP_THREAD_H
#define FOVEA_APP_THREAD_H

#include <pthread.h>

enum { FV_THREAD_STACK_BYTES = 256 << 10 };

/* 0, or an errno value. Init-only. */
int fv_thread_start(pthread_t *thread, void *(*run)(void *), void *context);

#endif
