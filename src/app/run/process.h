/* What the process looks like from outside, in memory. Each call reads a file under /proc: off the
 * loop thread. Of its machine: host.h. */
#ifndef FOVEA_APP_RUN_PROCESS_H
#define FOVEA_APP_RUN_PROCESS_H

#include <stdint.h>

/* Resident set, and the largest it ever was; 0 where not known. */
uint64_t fv_process_resident_bytes(void);
uint64_t fv_process_resident_max_bytes(void);
/* Of it, what is in no file: counted page by page, and the same whatever other programs do, where
 * the resident set also counts pages of libraries that happen to be cached. */
uint64_t fv_process_anonymous_bytes(void);

/* Drop the pages of code and constants from memory: those that only the set-up used do not come
 * again, the others come from the cache of files when they are used. Not under a debugger, whose
 * breakpoints are in them. Init-only, before the loop. */
void fv_process_drop_code(void);

#endif
