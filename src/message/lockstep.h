/* lockstep_t: hashes of one iteration of the loop. Encoding is real-time safe. */
#ifndef FOVEA_MESSAGE_LOCKSTEP_H
#define FOVEA_MESSAGE_LOCKSTEP_H

#include <stddef.h>
#include <stdint.h>

#include "fovea_stamp_t.h"

enum { FV_MESSAGE_LOCKSTEP_MAX = 64 }; /* COUNT_MAX */

struct fv_message_hash {
    const char *name; /* at most 63 bytes; messages: the channel, whose prefix is left out */
    uint64_t hash;
};

struct fv_message_lockstep {
    fovea_stamp_t stamp;
    uint64_t iteration, inputs_hash, state_hash;
    uint32_t stage_count, message_count;
    size_t prefix_bytes; /* of the channels */
    struct fv_message_hash stages[FV_MESSAGE_LOCKSTEP_MAX], messages[FV_MESSAGE_LOCKSTEP_MAX];
};

/* Enough also for inputs and samples, which are hashed in the same buffer. */
size_t fv_message_lockstep_size_max(void);
uint32_t fv_message_lockstep_encode(const struct fv_message_lockstep *in, uint8_t *buffer,
                                    size_t capacity);

#endif
