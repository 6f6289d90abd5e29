/* LCM's tcpq protocol: a connection to an LCM server, without ever waiting for it.
 *
 * Both sides begin with a magic number and a version; then a message is: 1 (publish), length of the
 * channel, channel, length of the data, data; 32 bits, big-endian. A lost connection is made again,
 * tried once a second; meanwhile messages are dropped. */
#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "app/network/sender_outlet.h"
#include "app/network/transport_url.h"
#include "drivers/clock.h"

enum {
    MAGIC_SERVER = 0x287617fa,
    MAGIC_CLIENT = 0x287617fb,
    VERSION = 0x0100,
    PUBLISH = 1,
    HELLO_BYTES = 8,
    NONE = -1,
    UNSENT_BYTES = 1 << 16
};

enum stage { AWAY, CONNECTING, GREETING, OPEN };

struct server {
    struct fv_outlet outlet; /* first */
    struct sockaddr_in to;
    int socket;
    enum stage stage;
    size_t greeted;   /* bytes of the server's first words */
    int64_t tried_ns; /* when the connection was last begun */
    int begun;        /* class of the message that has gone in part, or NONE */
    size_t gone;      /* bytes of it */
};

static void leave(struct server *server)
{
    if (server->socket >= 0) close(server->socket);
    server->socket = -1;
    server->stage = AWAY;
    server->begun = NONE;
    server->gone = server->greeted = 0;
}

static void put_be32(uint8_t *at, uint32_t value)
{
    const uint32_t big = htonl(value);
    memcpy(at, &big, sizeof big);
}

static void begin(struct server *server, int64_t now_ns)
{
    const int on = 1, unsent = UNSENT_BYTES;
    server->tried_ns = now_ns;
    server->socket = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (server->socket < 0) return;
    (void)setsockopt(server->socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    (void)setsockopt(server->socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof unsent);
    server->stage = CONNECTING;
    if (connect(server->socket, (const struct sockaddr *)&server->to, sizeof server->to) != 0 &&
        errno != EINPROGRESS)
        leave(server);
}

/* The server has answered the connection: say who we are. */
static void greet(struct server *server)
{
    uint8_t hello[HELLO_BYTES];
    struct pollfd ready = {.fd = server->socket, .events = POLLOUT};
    int failed = 0;
    socklen_t size = sizeof failed;
    if (poll(&ready, 1, 0) <= 0) return;
    put_be32(hello, MAGIC_CLIENT);
    put_be32(hello + 4, VERSION);
    if (getsockopt(server->socket, SOL_SOCKET, SO_ERROR, &failed, &size) != 0 || failed != 0 ||
        send(server->socket, hello, sizeof hello, MSG_NOSIGNAL) != (ssize_t)sizeof hello) {
        leave(server);
        return;
    }
    server->stage = GREETING;
}

static void hear(struct server *server)
{
    uint8_t words[HELLO_BYTES];
    const ssize_t got = recv(server->socket, words, HELLO_BYTES - server->greeted, 0);
    if (got == 0 || (got < 0 && errno != EAGAIN)) {
        leave(server);
        return;
    }
    if (got < 0) return;
    const uint32_t magic = htonl(MAGIC_SERVER);
    for (size_t i = 0; i < (size_t)got && server->greeted + i < sizeof magic; i++) {
        if (words[i] == ((const uint8_t *)&magic)[server->greeted + i]) continue;
        leave(server);
        return;
    }
    server->greeted += (size_t)got;
    if (server->greeted == HELLO_BYTES) server->stage = OPEN;
}

/* The connection one step on, if it can go on now. */
static void tend(struct server *server, int64_t now_ns)
{
    if (server->stage == AWAY && now_ns - server->tried_ns >= FV_SECOND_NS) begin(server, now_ns);
    if (server->stage == CONNECTING) greet(server);
    if (server->stage == GREETING) hear(server);
}

/* The parts of a message without the first `gone` bytes of all. */
static int cut(struct iovec *parts, int count, size_t gone)
{
    int first = 0;
    while (first < count && gone >= parts[first].iov_len)
        gone -= parts[first++].iov_len;
    if (first < count) {
        parts[first].iov_base = (uint8_t *)parts[first].iov_base + gone;
        parts[first].iov_len -= gone;
    }
    return first;
}

static int server_send(struct fv_outlet *outlet, const struct fv_outgoing *message, int64_t now_ns)
{
    struct server *server = (struct server *)outlet;
    uint8_t before[8], between[4];
    const uint32_t named = (uint32_t)strlen(message->channel);
    tend(server, now_ns);
    if (server->stage == AWAY) return FV_TRANSPORT_DROP_SERVER;
    if (server->stage != OPEN || (server->begun != NONE && server->begun != (int)message->class))
        return FV_OUTLET_BUSY;
    put_be32(before, PUBLISH);
    put_be32(before + 4, named);
    put_be32(between, message->bytes);
    struct iovec parts[] = {{before, sizeof before},
                            {(void *)(uintptr_t)message->channel, named},
                            {between, sizeof between},
                            {(void *)(uintptr_t)message->data, message->bytes}};
    const size_t whole = sizeof before + named + sizeof between + message->bytes;
    struct pollfd ready = {.fd = server->socket, .events = POLLOUT};
    if (server->gone == 0 && poll(&ready, 1, 0) == 0) return FV_OUTLET_BUSY;
    const int first = cut(parts, 4, server->gone);
    const struct msghdr rest = {.msg_iov = parts + first, .msg_iovlen = (size_t)(4 - first)};
    const ssize_t sent = sendmsg(server->socket, &rest, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent < 0 && errno == EAGAIN) return FV_OUTLET_BUSY;
    if (sent < 0) {
        leave(server);
        return FV_TRANSPORT_DROP_SERVER;
    }
    server->gone += (size_t)sent;
    server->begun = server->gone < whole ? (int)message->class : NONE;
    if (server->begun != NONE) return FV_OUTLET_BUSY;
    server->gone = 0;
    return FV_OUTLET_SENT;
}

static bool server_begun(const struct fv_outlet *outlet, enum fv_sender_class class)
{
    return ((const struct server *)outlet)->begun == (int)class;
}

static bool server_bulk_left(struct fv_outlet *outlet)
{
    (void)outlet;
    return true;
}

static bool server_close(struct fv_outlet *outlet)
{
    leave((struct server *)outlet);
    free(outlet);
    return true;
}

enum fovea_status fv_outlet_server(const char *url, struct fv_outlet **outlet,
                                   struct fovea_error *error)
{
    struct server *server = calloc(1, sizeof *server);
    if (server == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    server->outlet = (struct fv_outlet){.stalled = FV_TRANSPORT_DROP_SERVER,
                                        .send = server_send,
                                        .begun = server_begun,
                                        .bulk_left = server_bulk_left,
                                        .close = server_close};
    enum fovea_status status = fv_transport_server(url, &server->to, error);
    if (status != FOVEA_OK) {
        free(server);
        return status;
    }
    server->socket = -1;
    leave(server);
    begin(server, fv_clock_ns(CLOCK_MONOTONIC));
    *outlet = &server->outlet;
    return FOVEA_OK;
}
