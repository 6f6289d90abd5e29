/* Lock-step: hashes of one iteration, as lockstep_t, so that two runs on the same inputs can be
 * compared while they run or by their recordings (`fovea compare`). The first hash that differs
 * names the iteration and what became different in it: inputs, then features, then the state by
 * the owners of memory in the order of the memory table, then messages in the order of sending.
 *
 * Hashed: inputs and grants, samples, pixels; the features of the frame; persistent and job memory;
 * messages. What clocks and processes measure is left out of all of them: of the inputs latency_ns,
 * utc_offset_ns, frames_late, resident_bytes and temperature_c; of state and messages the offsets
 * to UTC that frames are remembered with (utc_offset_ns of stamps, utime) and the latency_ns of
 * poses; statistics_t as a whole. Real-time safe: bounded by the state's bytes, some 1 ms for 10
 * MB, each lockstep_every-th iteration. */
#ifndef FOVEA_RUNTIME_LOCKSTEP_H
#define FOVEA_RUNTIME_LOCKSTEP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/fovea.h"

enum { FV_LOCKSTEP_MAX = 64 }; /* COUNT_MAX of lockstep_t */

/* A run of bytes of the state that one stage or job owns. */
struct fv_lockstep_part {
    const char *owner;
    enum fovea_memory_part part;
    size_t from, bytes; /* in its part */
};

struct fv_lockstep {
    uint32_t part_count;
    struct fv_lockstep_part parts[FV_LOCKSTEP_MAX]; /* as carved */
    bool due;                                       /* in this iteration */
    uint64_t iteration, inputs_hash;
    uint32_t message_count;
    uint32_t kinds[FV_LOCKSTEP_MAX]; /* enum fv_message_kind */
    uint64_t hashes[FV_LOCKSTEP_MAX];
};

/* Note that `owner` owns `bytes` of `part` from `from` on; frame memory is not noted. */
void fv_lockstep_own(struct fv_lockstep *lockstep, const char *owner, enum fovea_memory_part part,
                     size_t from, size_t bytes);

/* Hash of the pixels of a frame's images as a recording holds them, one after the other; 0 for
 * NULL. Real-time safe. */
uint64_t fv_lockstep_frame_hash(const struct fovea_frame *frame);

/* At the start and the end of a step, and at the end of the work after it, which adds the message
 * to `outputs`. The grants of the work are inputs, too. */
void fv_lockstep_begin(struct fovea *rt, const struct fovea_inputs *inputs);
void fv_lockstep_sent(struct fovea *rt, const struct fovea_outputs *outputs);
void fv_lockstep_end(struct fovea *rt, const struct fovea_grants *grants,
                     struct fovea_outputs *outputs);

#endif
