/* A small receiver of LCM messages, in fixed memory, for the runtime and for viewers.
 *
 * liblcm's receiver is not used anywhere: its check of fragments overflows in 32 bits
 * (docs/security.md), so that one packet ends the program. This one takes messages of one packet
 * ("LC02") on the channels of a table and nothing else. Each message is checked before its handler
 * sees it: packet, channel, length, and, for a row with a type, fingerprint and every length inside
 * (fv_message_check), so that the generated `_decode` may follow. What is dropped is counted by
 * reason. All memory is taken by fv_receiver_open; no packet makes it grow.
 *
 * Whom it hears is `listen`:
 *   "none"      nobody
 *   "loopback"  programs of this host: packets that the kernel itself marks as looped back, or that
 *               come in on `lo`. Neither the TTL nor the source address of a packet proves this.
 *   INTERFACE   these, and what comes in on the interface ("eth0")
 *   "any"       these, and what comes in on every interface
 * The sockets are bound to the group's address, so that unicast cannot reach them. A kernel filter,
 * attached before they are bound, drops other packets, fragments and foreign channels.
 * Memberships follow the kernel's news of routes and interfaces. A tcpq server is heard when it
 * runs on this host, or with "any"; its messages count as sent from the network. memq:// and
 * file:// are for sending only.
 *
 * One thread at a time, except fv_receiver_wake and fv_receiver_counts, which any thread may call.
 */
#ifndef FOVEA_APP_NETWORK_RECEIVER_H
#define FOVEA_APP_NETWORK_RECEIVER_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/status.h"
#include "message/message.h"

enum { FV_RECEIVER_CHANNELS_MAX = 24, FV_RECEIVER_BYTES_MAX = 65507 };

struct fv_received {
    const char
        *channel; /* as the packet names it; valid, as `data`, during the call of the handler */
    const uint8_t *data;
    uint32_t bytes;
    bool from_host; /* the kernel vouches that a program on this host sent it */
};

struct fv_receiver_channel {
    char name[FV_MESSAGE_CHANNEL_BYTES];
    const char *type;   /* "fovea.command_t": must be a well-formed one; NULL: any bytes */
    uint32_t bytes_max; /* a longer message is dropped; at most FV_RECEIVER_BYTES_MAX */
    void (*take)(void *context, const struct fv_received *received);
    void *context;
    bool pattern; /* `name` is one of many: '*' stands for any letters or none, '?' for one byte.
                     Of the rows that fit a channel the first counts */
};

/* Messages of one channel and one type, each handed to `take`. */
struct fv_receiver_channel
fv_receiver_channel_of(const char *name, const char *type, uint32_t bytes_max,
                       void (*take)(void *context, const struct fv_received *received),
                       void *context);

/* Why something was not handed to a handler. */
enum fv_drop {
    FV_DROP_KERNEL,    /* by the kernel: filtered, or no room in the socket; it gives one number */
    FV_DROP_FRAGMENT,  /* LC03: a piece of a message of several packets */
    FV_DROP_CHANNEL,   /* no row of the table */
    FV_DROP_LONG,      /* longer than its row allows */
    FV_DROP_MALFORMED, /* no LCM packet, or a broken tcpq stream */
    FV_DROP_TYPE,      /* not a well-formed message of its row's type */
    FV_DROP_INTERFACE, /* to another address, or in on another interface than was joined */
    FV_DROP_COUNT
};
/* "fragment"; for reports. */
const char *fv_drop_name(enum fv_drop reason);

struct fv_receiver_counts {
    uint64_t taken; /* handed to handlers */
    uint64_t dropped[FV_DROP_COUNT];
};

struct fv_receiver_setup {
    const char *url;    /* well-formed (fv_transport_url_check) */
    const char *listen; /* see above */
    const struct fv_receiver_channel *channels;
    uint32_t channel_count; /* at most FV_RECEIVER_CHANNELS_MAX */
};

struct fv_receiver;

/* Open for `setup`, which is copied. *receiver is NULL where there is nothing to hear ("none",
 * memq://, file://). FOVEA_ERROR_SYSTEM: the machine refuses a socket, the filter or the group.
 * Init-only. */
enum fovea_status fv_receiver_open(const struct fv_receiver_setup *setup,
                                   struct fv_receiver **receiver, struct fovea_error *error);

/* Whether `listen` is one of the words or can be the name of an interface. */
bool fv_receiver_listen_valid(const char *listen);

/* Wait until something comes, at most `timeout_ms` (negative: without limit), and hand what has
 * come to the handlers, some hundred messages at most. Returns the number handed over. No heap call
 * except when memberships change. */
uint32_t fv_receiver_handle(struct fv_receiver *receiver, int timeout_ms);

/* Make the running or the next fv_receiver_handle return. */
void fv_receiver_wake(struct fv_receiver *receiver);

void fv_receiver_counts(const struct fv_receiver *receiver, struct fv_receiver_counts *counts);

void fv_receiver_close(struct fv_receiver *receiver);

#endif
