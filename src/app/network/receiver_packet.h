/* What both ways in share: the table of channels, and the checks that a message passes before its
 * handler sees it. No memory of its own, no system call. */
#ifndef FOVEA_APP_NETWORK_RECEIVER_PACKET_H
#define FOVEA_APP_NETWORK_RECEIVER_PACKET_H

#include <stdatomic.h>
#include <stddef.h>

#include "app/network/receiver.h"

enum {
    FV_PACKET_MAGIC = 0x4c433032,    /* "LC02", then 4 bytes of number, the channel with its zero */
    FV_PACKET_FRAGMENT = 0x4c433033, /* "LC03" */
    FV_PACKET_HEADER_BYTES = 8
};

struct fv_receiver_table {
    struct fv_receiver_channel rows[FV_RECEIVER_CHANNELS_MAX];
    uint32_t count;
    atomic_uint_fast64_t taken, dropped[FV_DROP_COUNT];
};

/* The row of a channel whose name has `length` bytes; NULL: none. */
const struct fv_receiver_channel *fv_table_find(const struct fv_receiver_table *table,
                                                const char *name, size_t length);

/* The largest datagram that a row allows, with packet header and channel. */
size_t fv_table_packet_bytes_max(const struct fv_receiver_table *table);

void fv_table_drop(struct fv_receiver_table *table, enum fv_drop reason);

/* Check a message that `row` was found for, and hand it over or count why not. Returns messages
 * handed over. */
uint32_t fv_table_deliver(struct fv_receiver_table *table, const struct fv_receiver_channel *row,
                          const struct fv_received *received);

/* Take one datagram; `cut`: it was longer than `bytes`. Returns messages handed over. */
uint32_t fv_packet_take(struct fv_receiver_table *table, const uint8_t *packet, size_t bytes,
                        bool cut, bool from_host);

#endif
