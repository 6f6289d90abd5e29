/* Schedules of faults in a file, for `fault:URI?file=PATH`. Init-only. */
#ifndef FOVEA_DRIVERS_FAULT_FILE_H
#define FOVEA_DRIVERS_FAULT_FILE_H

#include <stdbool.h>
#include <stddef.h>

#include "fovea/status.h"

/* Put the faults of the file around the URI in `address`, `capacity` bytes: those of its first line
 * are the innermost, as if `fault:` had been written once for each line. FOVEA_ERROR_INPUT: `error`
 * names the line. */
enum fovea_status fv_fault_file_read(const char *path, char *address, size_t capacity,
                                     struct fovea_error *error);

enum { FV_FAULT_ADDRESS_BYTES = 4096 }; /* of a whole address, at most */

/* The URI of a source with the schedules of its files in their place, so that it says by itself
 * what it does; of other sources as it is. False: it is too long, or a file cannot be read. */
bool fv_fault_uri_whole(const char *uri, char whole[FV_FAULT_ADDRESS_BYTES]);

#endif
