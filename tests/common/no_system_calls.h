#ifndef FOVEA_TESTS_NO_SYSTEM_CALLS_H
#define FOVEA_TESTS_NO_SYSTEM_CALLS_H

#include <stdbool.h>

/* From here on this thread may sleep, read clocks and end; anything else kills the process. Freed
 * memory of the thread's is given back after that: munmap and madvise are its end's. False:
 * not possible here. */
bool no_system_calls(void);

#endif
