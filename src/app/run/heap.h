/* Counting heap calls of a thread. The program puts its own malloc, calloc, realloc, free,
 * posix_memalign, aligned_alloc and memalign before the C library's and passes every call on; while
 * a thread is armed they are counted. Sanitizer builds have an allocator of their own in that
 * place: there nothing is counted. */
#ifndef FOVEA_APP_RUN_HEAP_H
#define FOVEA_APP_RUN_HEAP_H

#include <stdbool.h>
#include <stdint.h>

/* Whether this build counts at all. */
bool fv_heap_counted(void);

/* Start counting for the calling thread from 0, or stop; counting costs an addition per heap call.
 */
void fv_heap_arm(void);
void fv_heap_disarm(void);

/* Calls that the calling thread made while armed. Real-time safe. */
uint64_t fv_heap_calls(void);

#endif
