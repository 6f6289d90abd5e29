/* A map that was read and checked beside the loop, and waits for a step to take it. */
#ifndef FOVEA_RUNTIME_READY_MAP_H
#define FOVEA_RUNTIME_READY_MAP_H

#include "map/map.h"

struct fovea_ready_map {
    struct fv_map map; /* settled; its pieces follow in the caller's memory */
    uint64_t frame_number;
    uint64_t hash; /* of the file's bytes, for lock-step */
};

#endif
