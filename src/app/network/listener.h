/* The receiving half of a transport: a receiver (receiver.h) in a thread of its own, and wait-free
 * rings of commands, refused ones that are to be answered, and wheel odometry from there to the
 * loop. */
#ifndef FOVEA_APP_NETWORK_LISTENER_H
#define FOVEA_APP_NETWORK_LISTENER_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include "app/network/receiver.h"
#include "app/network/transport.h"
#include "base/ring.h"
#include "fovea/fovea.h"
#include "message/message.h"

enum {
    FV_LISTENER_COMMAND_BYTES = 64 * sizeof(struct fv_judged_command),
    FV_LISTENER_WHEEL_ODOMETRY_BYTES = 1 << 15 /* half a second at 1 kHz */
};

struct fv_listener {
    struct fv_ring commands; /* of struct fv_judged_command, from the listener to the loop */
    uint8_t commands_memory[FV_LISTENER_COMMAND_BYTES];
    struct fv_ring wheel_odometry; /* of struct fovea_wheel_odometry_sample, likewise */
    uint8_t wheel_odometry_memory[FV_LISTENER_WHEEL_ODOMETRY_BYTES];
    struct fv_receiver *receiver; /* NULL: nothing is heard */
    pthread_t thread;
    atomic_bool stop;
    struct fv_command_gate gate;                       /* the thread's */
    struct fv_wheel_odometry_gate wheel_odometry_gate; /* likewise */
    bool said_too_fast;
};

/* Prepare zeroed memory, aligned as fv_aligned_zeroed does. */
void fv_listener_init(struct fv_listener *listener);

/* As fv_transport_listen. */
enum fovea_status fv_listener_start(struct fv_listener *listener, const char *url,
                                    const struct fv_transport_ears *ears,
                                    struct fovea_error *error);

/* As fv_transport_command and fv_transport_wheel_odometry. */
bool fv_listener_command(struct fv_listener *listener, struct fv_judged_command *command);
uint32_t fv_listener_wheel_odometry(struct fv_listener *listener,
                                    struct fovea_wheel_odometry_sample *samples,
                                    uint32_t count_max);

/* Adds to the numbers of what came in. */
void fv_listener_counts(const struct fv_listener *listener, struct fv_transport_counts *counts);

void fv_listener_stop(struct fv_listener *listener);

#endif
