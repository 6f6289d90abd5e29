/* LCM: messages out from the loop thread, commands in through a thread of their own and a wait-free
 * ring.
 *
 * Sending an encoded message through LCM's UDP provider makes no heap call (tests/realtime holds it
 * to that); it takes LCM's transmit mutex and one sendmsg per 64 KiB. What a remote party sends is
 * checked before it is decoded. Every function takes NULL for "nothing is sent". */
#ifndef FOVEA_APP_TRANSPORT_H
#define FOVEA_APP_TRANSPORT_H

#include <stdint.h>
#include <stdio.h>

#include "fovea/fovea.h"

enum { FV_TRANSPORT_URL_BYTES = 320 };

/* What makes multicast reach subscribers on a host without a network. */
#define FV_TRANSPORT_MEND                                                                          \
    "sudo ip link set lo up multicast on; sudo ip route replace 224.0.0.0/4 dev lo"

struct fv_transport;

/* Prepare for sending to `url` ("udpm://239.255.76.67:7667", "tcpq://...", any LCM URL; "":
 * *transport is NULL) with time-to-live `ttl` (0: this host), unless the URL states its own.
 * FOVEA_ERROR_INPUT: malformed URL. FOVEA_ERROR_SYSTEM: the system has no way to the address;
 * `error` holds the command that mends it. Init-only. */
enum fovea_status fv_transport_open(const char *url, uint32_t ttl, struct fv_transport **transport,
                                    struct fovea_error *error);

/* Listen for fovea.command_t on <prefix>_COMMAND, and for bot_core.pose_t on `odometry_channel`
 * unless that is NULL or empty, in a thread of its own, which says on stderr when it cannot.
 * Init-only. */
enum fovea_status fv_transport_listen(struct fv_transport *transport, const char *prefix,
                                      const char *odometry_channel, struct fovea_error *error);

/* Send the messages of a step or a work. Failures are counted, never waited for. Loop thread, no
 * heap call.
 */
void fv_transport_publish(struct fv_transport *transport, const struct fovea_outputs *outputs);

/* Commands that have come since the last call, as enum fovea_command bits; of pause and resume the
 * later one. Loop thread, wait-free. */
uint32_t fv_transport_commands(struct fv_transport *transport);

/* Odometry that has come since the last call, oldest first, at most `count_max`; what there is no
 * room for waits. Stamps are those of the messages in nanoseconds. Returns the number. Loop thread,
 * wait-free. */
uint32_t fv_transport_odometry(struct fv_transport *transport,
                               struct fovea_odometry_sample *samples, uint32_t count_max);

struct fv_transport_counts {
    uint64_t sent, failed;               /* messages */
    uint64_t commands, commands_refused; /* understood; malformed or unknown bits */
    uint64_t odometry, odometry_refused; /* taken; malformed, or no room since the loop was busy */
};
void fv_transport_counts(const struct fv_transport *transport, struct fv_transport_counts *counts);

/* A line of what could not be sent and what was refused; nothing where all went well. Init-only. */
void fv_transport_tell(FILE *out, const struct fv_transport *transport);

void fv_transport_close(struct fv_transport *transport);

/* The file of a well-formed file URL; false, and "", for the others. */
bool fv_transport_file(const char *url, char path[FV_TRANSPORT_URL_BYTES]);

/* Does a message reach a subscriber on this host? Sends through LCM and listens, at most about a
 * second. For a log file: can it be written? It is left as it is, or unmade. FOVEA_OK, or an error
 * whose text says what failed and the command that mends it. Init-only. */
enum fovea_status fv_transport_check(const char *url, uint32_t ttl, struct fovea_error *error);

#endif
