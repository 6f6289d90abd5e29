/* Replaying a recording: the runtime is built again from the header, fed the recorded frames,
 * inputs and grants, and what it sends is held against what it sent then, message by message and
 * bit by bit.
 *
 * Of messages with clock readings (fovea_message.volatile_values) all but those is compared. A log
 * comes from outside: whatever is in it, the outcome is a replay or one line that names file and
 * byte. Memory: the runtime's block, one frame, one event. Init-only (not for the loop). */
#ifndef FOVEA_APP_RECORD_REPLAY_H
#define FOVEA_APP_RECORD_REPLAY_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/identity.h"
#include "app/record/recording_end.h"
#include "fovea/fovea.h"

/* How a recording ends. */
enum fv_replay_end {
    FV_REPLAY_CUT_OFF =
        0, /* within an iteration or without its last message: the rest is missing */
    FV_REPLAY_ENDED_EARLY, /* the recording ended before the run, as `reason` says */
    FV_REPLAY_WHOLE
};

struct fv_replay_result {
    uint64_t frames, steps, works;
    int64_t offset;                       /* of the event read last, bytes into the recording */
    uint64_t messages_equal, bytes_equal; /* compared and found equal */
    uint64_t messages_with_readings;      /* of clocks, among them: all but those was compared */
    enum fv_replay_end end;               /* where the replay came to the end of the log */
    char reason[FV_RECORDING_END_REASON_BYTES]; /* printable, as recorded_by is */
    bool different;
    char difference[512];        /* one line: frame, channel, field, both values */
    char recorded_by[192];       /* version, machine and kernel set of the recording */
    const char *kernel_set;      /* of this replay */
    struct fv_identity identity; /* of the recorded run, before the first call; run_id 0: none */
};

/* Called with what every step and work sends; may be NULL. */
typedef void (*fv_replay_function)(void *context, int64_t now_ns,
                                   const struct fovea_outputs *outputs);

/* Of fv_replay, as bits. */
enum fv_replay_how {
    FV_REPLAY_STOPS = 1, /* at the first difference */
    /* Take the state of a recording that began in the middle of its run. It is taken as it is, so
     * that one from a stranger can make this program do anything. */
    FV_REPLAY_TRUSTS = 2
};

/* A recording of another version is named in one line on stderr before anything is compared.
 *
 * Run a recording until its end or, with FV_REPLAY_STOPS, the first difference (noted in either
 * case). One that began in the middle of its run is refused without FV_REPLAY_TRUSTS. FOVEA_OK: the
 * recording was read to the end, or a difference was found. Else `error` says what is wrong with it
 * and `result` says how far the replay got. */
enum fovea_status fv_replay(const char *path, unsigned how, fv_replay_function sent, void *context,
                            struct fv_replay_result *result, struct fovea_error *error);

#endif
