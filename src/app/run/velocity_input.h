/* Velocity commands of a controller outside (fovea.velocity_command_t), on their way to the source:
 * judged as commands are (command_gate.h), on the listener's thread, and handed to the source at
 * once, which gives out as samples what it took. Counted, never answered. */
#ifndef FOVEA_APP_RUN_VELOCITY_INPUT_H
#define FOVEA_APP_RUN_VELOCITY_INPUT_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>

#include "app/network/receiver.h"
#include "app/run/requests.h"
#include "fovea/source.h"

struct fv_velocity_input {
    struct fv_requests *requests;
    const struct fovea_source_ops *ops;
    struct fovea_source *source; /* NULL: none any more */
    pthread_mutex_t lock;        /* of source: between the listener and the end of the run */
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    bool said; /* that commands are dropped, and why the first was */
    atomic_uint_fast64_t taken, refused, malformed, busy;
};

void fv_velocity_input_open(struct fv_velocity_input *input, struct fv_requests *requests,
                            const struct fovea_source_ops *ops, struct fovea_source *source,
                            const char *prefix);
/* The row of the receiver's table. */
struct fv_receiver_channel fv_velocity_input_row(struct fv_velocity_input *input);
/* Whether the source has taken a command: what it gives next depends on what is sent. */
bool fv_velocity_input_drives(const struct fv_velocity_input *input);
/* From now on nothing reaches the source, which may then be stopped. Not on the loop thread. */
void fv_velocity_input_end(struct fv_velocity_input *input);
/* A line of what came; nothing where nothing did. */
void fv_velocity_input_tell(FILE *out, const struct fv_velocity_input *input);

#endif
