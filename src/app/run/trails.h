/* Where confirmed objects were in the image over a whole run, for its picture. Fixed memory: when
 * it is full, every second inference is removed, and of later ones every stride-th is kept. */
#ifndef FOVEA_APP_RUN_TRAILS_H
#define FOVEA_APP_RUN_TRAILS_H

#include "fovea/objects.h"

enum { FV_TRAILS_MAX = 8192 };

struct fv_trail_point {
    float time_s, x_px, y_px;
    uint32_t id, inference; /* inference: its number, of those kept */
    int32_t class_id;
};

struct fv_trails {
    int64_t first_ns, last_ns;
    uint32_t count, inferences, stride; /* every stride-th inference is kept; 0 before the first */
    struct fv_trail_point points[FV_TRAILS_MAX];
};

/* Zeroed memory is empty trails. Loop thread, real-time safe. */
void fv_trails_observe(struct fv_trails *trails, const struct fovea_objects *objects);

#endif
