/* Recording a run as an LCM log: header, frames, inputs, grants and messages, so that `fovea
 * replay` needs nothing else.
 *
 * The loop thread copies into a preallocated ring and never waits, allocates or enters the system;
 * a thread of its own writes. When the disk is full or the ring overflows because the disk is slow,
 * the recording ends at a whole iteration, the log's last message and one line on stderr say why,
 * what came later is counted, and the run goes on. For recorded input at full speed
 * the loop waits instead until fv_recorder_room says that the disk has caught up. A write that
 * stalls is in the table of support/stall.h.
 *
 *     fv_recorder_open(&setup, &recorder, &error);
 *     for each iteration:
 *         fovea_step(...);
 *         fv_recorder_step(recorder, &inputs, &outputs);
 *         fovea_work(...);
 *         fv_recorder_work(recorder, &inputs, &grants, &outputs);
 *     fv_recorder_close(recorder, &summary);
 *
 * Every function takes NULL for "not recording". */
#ifndef FOVEA_APP_RECORD_RECORDER_H
#define FOVEA_APP_RECORD_RECORDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/network/identity.h"
#include "app/record/recording_end.h"
#include "support/output.h"
#include "app/config/settings.h"
#include "fovea/fovea.h"

struct fv_recorder;

struct fv_recorder_setup {
    const char *path; /* FILE or DIR/, as recording_file.h says */
    const struct fv_settings
        *settings; /* as the runtime was initialised: rig fitted, masks loaded */
    const struct fv_identity *identity; /* NULL: none */
    const char *kernel_set;
    bool real_time;
    size_t frame_bytes; /* of the largest frame, all its images */
    /* 0: settings->record_buffer frames when real_time, else a few, as the loop waits then */
    size_t ring_bytes;
    /* A recording that begins in the middle of its run, at fv_recorder_begin: memory for the state
     * (fovea_state_bytes) and of `ring_bytes` for the ring (fv_recorder_ring_bytes), the caller's
     * until closed, as `settings` and `identity` are. NULL: it begins with its run. */
    uint8_t *state, *ring_memory;
    size_t state_bytes;
};

/* The bytes of a ring for a recording that begins in the middle of its run. Init-only. */
size_t fv_recorder_ring_bytes(const struct fv_recorder_setup *setup);

/* Create the file, the ring and the thread. Init-only. */
enum fovea_status fv_recorder_open(const struct fv_recorder_setup *setup,
                                   struct fv_recorder **recorder, struct fovea_error *error);

/* The file that is written; valid until closed. */
const char *fv_recorder_path(const struct fv_recorder *recorder);

/* Begin in the middle of the run: copy the state, in the time that this takes (some 1 ms for 4 MB).
 * Before the first step that is recorded is given `inputs`, whose times are filled in. Loop thread,
 * real-time safe. */
void fv_recorder_begin(struct fv_recorder *recorder, const struct fovea *rt,
                       const struct fovea_inputs *inputs);

/* Bytes written so far. Any thread. */
uint64_t fv_recorder_written(const struct fv_recorder *recorder);
/* Whether it has ended early. Any thread. */
bool fv_recorder_has_ended(const struct fv_recorder *recorder);
/* The recording ends before its run, for this reason, which goes into the log's last message. Then
 * close it. Not while the loop may record. */
void fv_recorder_stop(struct fv_recorder *recorder, const char *reason);

/* Record a change of a parameter that the coming fv_recorder_step was given, before it; at most
 * FV_MESSAGE_PARAMETERS_MAX. Loop thread, real-time safe. */
void fv_recorder_parameter(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                           const char *key, const char *value);

/* Record the map that the coming fv_recorder_step was given, before it: a file of at most
 * fovea_map_bytes_max, where settings->map_folder names a folder. In the time that copying it takes
 * (some 1 ms for 4 MB). Loop thread, real-time safe. */
void fv_recorder_map(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                     const char *file, const uint8_t *data, size_t bytes);

/* Record what a step was given and what it gave. After fovea_step, while frame and outputs are
 * valid. Loop thread, real-time safe. */
void fv_recorder_step(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                      const struct fovea_outputs *outputs);

/* The same for a work; `inputs` are those of the step before. Loop thread, real-time safe. */
void fv_recorder_work(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                      const struct fovea_grants *grants, const struct fovea_outputs *outputs);

/* Whether the ring has room for a whole iteration, or the recording has ended. What waits for it
 * is input at full speed, not frames that come by the clock. */
bool fv_recorder_room(struct fv_recorder *recorder);

struct fv_recorder_summary {
    uint64_t events, bytes; /* written; whole events only, the log's own end among them */
    uint64_t steps_lost;    /* steps that came after the recording had ended */
    bool complete;          /* everything was written */
    bool removed;           /* it is numbered and held no iteration */
    char reason[FV_RECORDING_END_REASON_BYTES]; /* why not, "" when complete */
    char path[FV_OUTPUT_PATH_BYTES];            /* of the file, as it is called now */
};

/* Bytes that a recorder so set up takes outside the runtime's block, for the memory table; its path
 * does not matter. Init-only. */
size_t fv_recorder_bytes(const struct fv_recorder_setup *setup);

/* Write what is left, sync, close, free. `summary` may be NULL. FOVEA_OK: complete.
 * FOVEA_ERROR_SYSTEM: it ended early; that has been said. */
enum fovea_status fv_recorder_close(struct fv_recorder *recorder,
                                    struct fv_recorder_summary *summary);

#endif
