#include "app/network/receiver_tcpq.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "drivers/clock.h"
#include "support/say.h"

enum {
    MAGIC_OF_SERVER = 0x287617fa,
    MAGIC_OF_CLIENT = 0x287617fb,
    VERSION = 0x0100,
    TYPE_PUBLISH = 1,
    TYPE_SUBSCRIBE = 2
};

/* ---- the stream ------------------------------------------------------------------------------ */

static void begin_part(struct fv_tcpq_stream *stream, enum fv_tcpq_part part, uint64_t wanted)
{
    stream->part = part;
    stream->wanted = wanted;
    stream->got = 0;
}

void fv_tcpq_begin(struct fv_tcpq_stream *stream, struct fv_receiver_table *table, uint8_t *buffer,
                   size_t capacity)
{
    memset(stream, 0, sizeof *stream);
    stream->table = table;
    stream->buffer = buffer;
    stream->capacity = capacity;
    begin_part(stream, FV_TCPQ_MAGIC, 4);
}

/* Where bytes of this part are kept; NULL: they are passed over. */
static uint8_t *room_for(struct fv_tcpq_stream *stream, size_t *capacity)
{
    switch (stream->part) {
    case FV_TCPQ_CHANNEL:
        *capacity = sizeof stream->name;
        return (uint8_t *)stream->name;
    case FV_TCPQ_DATA:
        *capacity = stream->row != NULL ? stream->capacity : 0;
        return stream->buffer;
    default:
        *capacity = sizeof stream->number;
        return stream->number;
    }
}

/* All bytes of a number are there. */
static bool take_number(struct fv_tcpq_stream *stream)
{
    uint32_t value = 0;
    for (int i = 0; i < 4; i++)
        value = value << 8 | stream->number[i];
    switch (stream->part) {
    case FV_TCPQ_MAGIC:
        begin_part(stream, FV_TCPQ_VERSION, 4);
        return value == MAGIC_OF_SERVER;
    case FV_TCPQ_VERSION:
        begin_part(stream, FV_TCPQ_TYPE, 4);
        return value == VERSION;
    case FV_TCPQ_TYPE:
        begin_part(stream, FV_TCPQ_CHANNEL_LENGTH, 4);
        return value == TYPE_PUBLISH;
    case FV_TCPQ_CHANNEL_LENGTH:
        stream->name_length = value;
        begin_part(stream, FV_TCPQ_CHANNEL, value);
        return true;
    default: /* FV_TCPQ_LENGTH */
        if (stream->row != NULL && (value > stream->row->bytes_max || value > stream->capacity)) {
            fv_table_drop(stream->table, FV_DROP_LONG);
            stream->row = NULL;
        }
        begin_part(stream, FV_TCPQ_DATA, value);
        return true;
    }
}

/* All bytes of the part are there. */
static bool end_part(struct fv_tcpq_stream *stream, uint32_t *taken)
{
    if (stream->part == FV_TCPQ_CHANNEL) {
        const bool fits = stream->name_length < sizeof stream->name;
        stream->row = fits ? fv_table_find(stream->table, stream->name, stream->name_length) : NULL;
        if (fits) stream->name[stream->name_length] = '\0';
        if (stream->row == NULL) fv_table_drop(stream->table, FV_DROP_CHANNEL);
        begin_part(stream, FV_TCPQ_LENGTH, 4);
        return true;
    }
    if (stream->part != FV_TCPQ_DATA) return take_number(stream);
    if (stream->row != NULL)
        *taken += fv_table_deliver(
            stream->table, stream->row,
            &(struct fv_received){stream->name, stream->buffer, (uint32_t)stream->wanted, false});
    begin_part(stream, FV_TCPQ_TYPE, 4);
    return true;
}

bool fv_tcpq_feed(struct fv_tcpq_stream *stream, const uint8_t *bytes, size_t count,
                  uint32_t *taken)
{
    for (size_t at = 0;;) {
        while (stream->got == stream->wanted) /* a part of no bytes is whole at once */
            if (!end_part(stream, taken)) {
                fv_table_drop(stream->table, FV_DROP_MALFORMED);
                return false;
            }
        if (at == count) return true;
        size_t capacity;
        uint8_t *room = room_for(stream, &capacity);
        const uint64_t missing = stream->wanted - stream->got;
        const size_t some = missing < count - at ? (size_t)missing : count - at;
        if (stream->got < capacity) {
            const size_t left = capacity - (size_t)stream->got;
            memcpy(room + stream->got, bytes + at, some < left ? some : left);
        }
        stream->got += some;
        at += some;
    }
}

/* ---- the connection -------------------------------------------------------------------------- */

static void disconnect(struct fv_tcpq *tcpq)
{
    if (tcpq->tcp >= 0) close(tcpq->tcp);
    tcpq->tcp = -1;
    tcpq->connecting = false;
    tcpq->retry_ns = fv_clock_ns(CLOCK_MONOTONIC) + (int64_t)FV_TCPQ_RETRY_MS * 1000000;
}

int fv_tcpq_wait_for(struct fv_tcpq *tcpq, short *events)
{
    if (tcpq->tcp < 0) {
        if (tcpq->refused || fv_clock_ns(CLOCK_MONOTONIC) < tcpq->retry_ns) return -1;
        tcpq->tcp = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        const bool begun =
            tcpq->tcp >= 0 &&
            (connect(tcpq->tcp, (const struct sockaddr *)&tcpq->server, sizeof tcpq->server) == 0 ||
             errno == EINPROGRESS);
        tcpq->connecting = true;
        if (!begun) disconnect(tcpq);
    }
    *events = tcpq->connecting ? POLLOUT : POLLIN;
    return tcpq->tcp;
}

/* A server on this host has the address that we have on the connection to it. */
static bool server_is_here(int tcp)
{
    struct sockaddr_in own, other;
    socklen_t own_bytes = sizeof own, other_bytes = sizeof other;
    return getsockname(tcp, (struct sockaddr *)&own, &own_bytes) == 0 &&
           getpeername(tcp, (struct sockaddr *)&other, &other_bytes) == 0 &&
           own.sin_addr.s_addr == other.sin_addr.s_addr;
}

static size_t put_number(uint8_t *at, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> (24 - 8 * i));
    return 4;
}

/* To the server a channel is a regular expression: what is no letter or digit must stand for itself
 * alone. Letters beyond ASCII take several bytes, between which no backslash may come. */
static size_t put_subscription(uint8_t *at, const struct fv_receiver_channel *row)
{
    size_t used = 8;
    for (const char *channel = row->name; *channel != '\0'; channel++) {
        const unsigned char byte = (unsigned char)*channel;
        const bool letter = ((byte | 0x20) >= 'a' && (byte | 0x20) <= 'z') || byte >= 0x80;
        if (row->pattern && (byte == '*' || byte == '?')) { /* a letter may have several bytes */
            at[used++] = '.';
            at[used++] = '*';
            continue;
        }
        if (!letter && (byte < '0' || byte > '9') && byte != '_') at[used++] = '\\';
        at[used++] = byte;
    }
    put_number(at, TYPE_SUBSCRIBE);
    put_number(at + 4, (uint32_t)used - 8);
    return used;
}

static bool greet(struct fv_tcpq *tcpq)
{
    uint8_t greeting[8 + FV_RECEIVER_CHANNELS_MAX * (8 + 2 * FV_MESSAGE_CHANNEL_BYTES)];
    const struct fv_receiver_table *table = tcpq->stream.table;
    size_t used = put_number(greeting, MAGIC_OF_CLIENT);
    used += put_number(greeting + used, VERSION);
    for (uint32_t i = 0; i < table->count; i++)
        used += put_subscription(greeting + used, &table->rows[i]);
    return send(tcpq->tcp, greeting, used, MSG_NOSIGNAL) == (ssize_t)used;
}

static bool connected(struct fv_tcpq *tcpq)
{
    int failed = 0;
    socklen_t bytes = sizeof failed;
    if (getsockopt(tcpq->tcp, SOL_SOCKET, SO_ERROR, &failed, &bytes) != 0 || failed != 0)
        return false;
    if (tcpq->host_only && !server_is_here(tcpq->tcp)) {
        fv_say(
            "%s: the LCM server is on another host, so its messages are ignored; to receive them: "
            "listen: any",
            tcpq->url);
        tcpq->refused = true;
        return false;
    }
    tcpq->connecting = false;
    fv_tcpq_begin(&tcpq->stream, tcpq->stream.table, tcpq->stream.buffer, tcpq->stream.capacity);
    return greet(tcpq);
}

uint32_t fv_tcpq_ready(struct fv_tcpq *tcpq)
{
    uint8_t bytes[4096];
    uint32_t taken = 0;
    if (tcpq->connecting) {
        if (!connected(tcpq)) disconnect(tcpq);
        return 0;
    }
    for (int i = 0; i < 16; i++) {
        const ssize_t got = recv(tcpq->tcp, bytes, sizeof bytes, 0);
        if (got < 0 && (errno == EAGAIN || errno == EINTR)) break;
        if (got <= 0 || !fv_tcpq_feed(&tcpq->stream, bytes, (size_t)got, &taken)) {
            disconnect(tcpq);
            break;
        }
    }
    return taken;
}

void fv_tcpq_close(struct fv_tcpq *tcpq)
{
    if (tcpq->tcp >= 0) close(tcpq->tcp);
    tcpq->tcp = -1;
}
