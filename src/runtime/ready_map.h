/* A map that was read and checked beside the loop, and waits for a step to take it. */
#ifndef FOVEA_RUNTIME_READY_MAP_H
#define FOVEA_RUNTIME_READY_MAP_H

#include "map/archive.h"
#include "map/map.h"

struct fovea_ready_map {
    struct fv_map map;           /* settled; its pieces follow in the caller's memory */
    struct fv_archive_grid grid; /* of a settled map; side 0: none, or no use for it */
    int8_t *cells;
    uint64_t frame_number;
    uint64_t hash; /* of the file's bytes, for lock-step */
};

#endif
