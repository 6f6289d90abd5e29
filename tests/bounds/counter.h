/* Instructions that this program has executed, as the plug-in tools/count/count.c counts them where
 * the program runs under qemu (tools/bounds.sh): exact but for the few of the block that reads. */
#ifndef FOVEA_TESTS_BOUNDS_COUNTER_H
#define FOVEA_TESTS_BOUNDS_COUNTER_H

#include <stdbool.h>
#include <stdint.h>

/* Map the file that FOVEA_COUNT_FILE names. False, after a line on stderr: nothing counts. */
bool counter_open(void);
uint64_t counter_now(void);
/* A fovea_clock_function: nanoseconds are instructions. */
void counter_clock(void *context, int64_t *wall_ns, int64_t *cpu_ns);

/* Instructions of one call, without those of counting. */
typedef void counter_work(void *context);
uint64_t counter_of(counter_work *work, void *context);

#endif
