/* The inside of struct fovea: what lies in the block, and who owns what. */
#ifndef FOVEA_RUNTIME_STATE_H
#define FOVEA_RUNTIME_STATE_H

#include "base/arena.h"
#include "features/features.h"
#include "fovea/elementary.h"
#include "fovea/fovea.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"
#include "message/message.h"
#include "runtime/preview.h"

/* What the runtime itself remembers from frame to frame. No addresses: copied and hashed as bytes. */
struct fv_state {
    struct fovea_random random;
    int64_t last_stamp_ns;
    uint64_t last_sequence;
    uint64_t frames_in, frames_processed, steps_without_frame;
    uint64_t refused_stamp, refused_format, refused_paused;
    uint64_t steps;
    uint32_t reset_counter;
    uint32_t features;
    bool paused, any_frame;
};

/* Clock readings: kept apart from the state, since they must not be hashed. */
struct fv_times {
    int64_t cpu_ns[FOVEA_STAGE_COUNT], wall_ns[FOVEA_STAGE_COUNT];
};

struct fovea {
    struct fovea_config config; /* mask points at the copy below */
    enum fv_cpu_set cpu;
    struct fv_kernels kernels;
    struct fv_arena parts[FOVEA_MEMORY_PART_COUNT];
    uint8_t *part_base[FOVEA_MEMORY_PART_COUNT];
    size_t part_bytes[FOVEA_MEMORY_PART_COUNT];
    size_t block_bytes;

    struct fv_state *state;
    uint8_t *mask;
    struct fv_pyramid pyramid;
    struct fv_features features;
    struct fv_preview preview;
    struct fv_message_writer writer; /* buffer and channel names of encoded messages */
    struct fv_times times;
};

/* Carve everything for rt->config out of the three parts; fills `table` when it is not NULL. */
void fv_runtime_carve(struct fovea *rt, struct fv_arena parts[FOVEA_MEMORY_PART_COUNT],
                      struct fovea_memory_table *table);

#endif
