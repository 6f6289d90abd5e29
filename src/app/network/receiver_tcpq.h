/* The receiver's connection to an LCM server (tcpq://), and the parser of its stream.
 *
 * Whatever lengths the stream claims, memory is one buffer: what is too long or on a foreign
 * channel is passed over byte by byte. */
#ifndef FOVEA_APP_NETWORK_RECEIVER_TCPQ_H
#define FOVEA_APP_NETWORK_RECEIVER_TCPQ_H

#include <netinet/in.h>

#include "app/network/receiver_packet.h"

/* ---- the stream: type, length and bytes of a channel, length and bytes of a message ---------- */

enum fv_tcpq_part {
    FV_TCPQ_MAGIC,
    FV_TCPQ_VERSION,
    FV_TCPQ_TYPE,
    FV_TCPQ_CHANNEL_LENGTH,
    FV_TCPQ_CHANNEL,
    FV_TCPQ_LENGTH,
    FV_TCPQ_DATA
};

struct fv_tcpq_stream {
    struct fv_receiver_table *table;
    uint8_t *buffer; /* of the longest message that a row allows; the caller's */
    size_t capacity;
    enum fv_tcpq_part part;
    uint64_t wanted, got; /* bytes of this part */
    uint8_t number[4];
    char name[FV_MESSAGE_CHANNEL_BYTES];
    uint64_t name_length;
    const struct fv_receiver_channel *row; /* NULL: the message is passed over */
};

/* Begin with the first byte of a connection. */
void fv_tcpq_begin(struct fv_tcpq_stream *stream, struct fv_receiver_table *table, uint8_t *buffer,
                   size_t capacity);
/* Take some bytes. False: this is no LCM server's stream, and the connection is to be closed.
 * *taken grows by the messages handed over. */
bool fv_tcpq_feed(struct fv_tcpq_stream *stream, const uint8_t *bytes, size_t count,
                  uint32_t *taken);

/* ---- the connection -------------------------------------------------------------------------- */

enum { FV_TCPQ_RETRY_MS = 1000 };

struct fv_tcpq {
    struct sockaddr_in server;
    bool host_only; /* a server on another host is not heard */
    int tcp;        /* -1: not connected */
    bool connecting;
    int64_t retry_ns; /* when to try again, CLOCK_MONOTONIC */
    bool refused;     /* said that the server is on another host */
    const char *url;
    struct fv_tcpq_stream stream;
};

/* Connect if it is time. The descriptor to wait for, and the events; -1: none now. */
int fv_tcpq_wait_for(struct fv_tcpq *tcpq, short *events);
/* It has become ready. Returns messages handed over. */
uint32_t fv_tcpq_ready(struct fv_tcpq *tcpq);
void fv_tcpq_close(struct fv_tcpq *tcpq);

#endif
