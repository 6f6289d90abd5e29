/* Map files on disk. Written to a temporary name beside the file, synced, renamed, and the folder
 * synced: whenever the process or the machine dies, the old file or the new one is there, whole.
 * The heap is used; off the loop thread. */
#ifndef FOVEA_APP_CONFIG_MAP_FILE_H
#define FOVEA_APP_CONFIG_MAP_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"
#include "map/archive.h"

/* Whether a file can be put there at the end of a run, under each name that a save may give it,
 * without touching what is there.
 * FOVEA_ERROR_INPUT: `error` names it and the reason. */
enum fovea_status fv_map_file_probe(const char *path, struct fovea_error *error);

/* Save a sealed map at PATH and keep those that were there: PATH.1 is the one before, PATH.2 the
 * one before that, `keep` of them with PATH itself (1: none is kept). PATH leads to a whole map at
 * every instant, also when the process or the machine dies; then at most one old map stands twice.
 *
 * A map with under half of the landmarks of the one at PATH, or without a grid of free space where
 * that has one, goes to PATH.small, and what was there to PATH.small.1 and so on, unless
 * `overwrite`: a run that was lost, a reset before a save, or a run without the grid shall not push
 * out what was built in hours. A file that is cut or damaged counts as no map.
 *
 * The temporary name is PATH.part; one that an earlier death left is removed. While another program
 * saves there, it is waited for, at most 2 s. No heap call.
 * FOVEA_ERROR_SYSTEM: PATH is as it was; `error` names it and the reason. */
struct fv_map_file_rules {
    uint32_t keep; /* 1 to FV_MAP_FILE_KEEP_MAX */
    bool overwrite;
};

struct fv_map_file_saved {
    bool beside;                          /* at PATH.small; what both hold says why */
    struct fv_archive_outline map, there; /* the map, and the one at PATH before */
};

enum { FV_MAP_FILE_KEEP_MAX = 10 };
#define FV_MAP_FILE_SMALL ".small"

enum fovea_status fv_map_file_save(const char *path, const struct fv_map_file_rules *rules,
                                   const uint8_t *data, size_t bytes,
                                   struct fv_map_file_saved *saved, struct fovea_error *error);

/* Read a whole file into memory from malloc. FOVEA_ERROR_INPUT: not there, no regular file, or
 * larger than any map. */
enum fovea_status fv_map_file_read(const char *path, uint8_t **data, size_t *bytes,
                                   struct fovea_error *error);

#endif
