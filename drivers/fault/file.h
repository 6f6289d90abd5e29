/* Schedules of faults in a file, for `fault:URI?file=PATH`. Init-only. */
#ifndef FOVEA_DRIVERS_FAULT_FILE_H
#define FOVEA_DRIVERS_FAULT_FILE_H

#include <stddef.h>

#include "fovea/status.h"

/* Put the faults of the file around the URI in `address`, `capacity` bytes: those of its first line
 * are the innermost, as if `fault:` had been written once for each line. FOVEA_ERROR_INPUT: `error`
 * names the line. */
enum fovea_status fv_fault_file_read(const char *path, char *address, size_t capacity,
                                     struct fovea_error *error);

#endif
