/* Answers to commands: one command_result_t for each command that was taken, and for refused ones
 * as network/command_gate.h allows.
 *
 * A command is done when the step has taken it; one that saves the map, when the file is written or
 * could not be; one that records, when that has begun or ended. The loop's thread sends the
 * answers, so that they stand in the order of what happened among its other messages. A run that
 * ends answers what still waits. */
#ifndef FOVEA_APP_RUN_ANSWERS_H
#define FOVEA_APP_RUN_ANSWERS_H

#include <stdint.h>

#include "app/network/feed.h"
#include "app/network/transport.h"
#include "app/run/keeper.h"
#include "app/run/recordings.h"
#include "message/message.h"

enum {
    FV_ANSWERS_WAITING_MAX = 32,
    FV_ANSWER_REASON_BYTES = 256, /* with its zero */
    FV_ANSWER_BYTES_MAX = 512     /* of an encoded answer */
};

/* Encode a command_result_t, of which longer reasons are cut; `result` is one of its RESULT_*.
 * Returns its bytes. Real-time safe. */
uint32_t fv_answer_encode(int64_t run_id, const struct fv_judged_command *command, int8_t result,
                          const char *reason, uint8_t data[FV_ANSWER_BYTES_MAX]);

struct fv_answers {
    struct fv_transport *transport;
    struct fv_feed *feed;
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    int64_t run_id;
    uint32_t count;
    struct fv_answers_waiting {
        struct fv_judged_command command;
        uint32_t save;      /* number of the save that it waits for (keeper.h); 0: for none */
        uint32_t recording; /* of the begin or end (recordings.h); 0 as well: for the step alone */
    } waiting[FV_ANSWERS_WAITING_MAX];
};

/* Prepare; `transport` and `feed` may be NULL. Init-only. */
void fv_answers_open(struct fv_answers *answers, struct fv_transport *transport,
                     struct fv_feed *feed, const char *prefix, int64_t run_id);

/* Take commands that have come, as enum fovea_command bits for fv_keeper_commands: of pause and
 * resume the later one. Before that call: answers those whose save has ended, likewise recordings,
 * which are asked here. Loop thread, wait-free. */
uint32_t fv_answers_take(struct fv_answers *answers, const struct fv_keeper *keeper,
                         struct fv_recordings *recordings);

/* The step has taken the commands: answer those that wait for nothing else. Loop thread, wait-free.
 */
void fv_answers_step(struct fv_answers *answers);

/* The loop has ended, and so have recordings: answer the rest. `failure`: why the map of the end
 * could not be saved, NULL: it was saved. */
void fv_answers_end(struct fv_answers *answers, const struct fv_keeper *keeper,
                    const struct fv_recordings *recordings, const char *failure);

#endif
