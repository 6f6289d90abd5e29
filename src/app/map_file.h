/* Map files on disk. Written to a temporary name beside the file, synced, renamed, and the folder
 * synced: whenever the process or the machine dies, the old file or the new one is there, whole.
 * The heap is used; off the loop thread. */
#ifndef FOVEA_APP_MAP_FILE_H
#define FOVEA_APP_MAP_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

/* Whether a file can be put there at the end of a run, without touching what is there.
 * FOVEA_ERROR_INPUT: `error` names it and the reason. */
enum fovea_status fv_map_file_probe(const char *path, struct fovea_error *error);

/* Replace the file by these bytes (a sealed map). The temporary name is PATH.part; one that an
 * earlier death left is written over. FOVEA_ERROR_SYSTEM: the file is as it was; `error` names it
 * and the reason. */
enum fovea_status fv_map_file_write(const char *path, const uint8_t *data, size_t bytes,
                                    struct fovea_error *error);

/* Read a whole file into memory from malloc. FOVEA_ERROR_INPUT: not there, no regular file, or
 * larger than any map. */
enum fovea_status fv_map_file_read(const char *path, uint8_t **data, size_t *bytes,
                                   struct fovea_error *error);

#endif
