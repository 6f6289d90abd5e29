/* LCM's udpm protocol, from sockets of our own: one per class, so that the send buffer of one never
 * refuses a message of another.
 *
 * A message is one datagram, "LC02", sequence number, channel, zero, data, if that fits
 * FV_LINK_DATAGRAM_BYTES; else several: "LC03", sequence number, bytes of data, offset, fragment,
 * fragments (both 16 bits), and in the first one channel and zero. All big-endian, as liblcm
 * expects. */
#include <arpa/inet.h>
#include <errno.h>
#include <linux/sockios.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "app/network/sender_link.h"
#include "app/network/sender_outlet.h"
#include "app/network/transport_url.h"
#include "message/message.h"

enum {
    MAGIC_WHOLE = 0x4c433032,
    MAGIC_FRAGMENT = 0x4c433033,
    WHOLE_HEADER = 8,
    FRAGMENT_HEADER = 20,
    PREVIEW_BUFFER = 1 << 16 /* bytes of the kernel's; it takes twice as many */
};

struct udp {
    struct fv_outlet outlet; /* first */
    struct sockaddr_in to;
    int sockets[FV_SENDER_CLASSES];
    uint32_t numbers[FV_SENDER_CLASSES];   /* of the class's next message */
    uint32_t offsets[FV_SENDER_CLASSES];   /* data that has gone, of a message in fragments */
    uint16_t fragments[FV_SENDER_CLASSES]; /* that have gone, likewise */
};

static int drop_for(int failed)
{
    switch (failed) {
    case EAGAIN:
        return FV_OUTLET_BUSY;
    case ENOBUFS:
    case ENOMEM:
        return FV_TRANSPORT_DROP_QUEUE;
    case EPERM:
    case EACCES:
        return FV_TRANSPORT_DROP_FIREWALL;
    case EMSGSIZE:
        return FV_TRANSPORT_DROP_LONG;
    default:
        return FV_TRANSPORT_DROP_ROUTE;
    }
}

/* Errors that routers reported of earlier datagrams would be returned by the next send instead of
 * sending: forget them. */
static void forget_errors(int socket)
{
    char byte, control[512];
    for (int i = 0; i < 16; i++) {
        struct iovec data = {&byte, 1};
        struct msghdr message = {.msg_iov = &data,
                                 .msg_iovlen = 1,
                                 .msg_control = control,
                                 .msg_controllen = sizeof control};
        if (recvmsg(socket, &message, MSG_ERRQUEUE | MSG_DONTWAIT) < 0) return;
    }
}

static int send_datagram(struct udp *udp, enum fv_sender_class class, struct iovec *parts,
                         size_t count)
{
    const struct msghdr datagram = {
        .msg_name = &udp->to, .msg_namelen = sizeof udp->to, .msg_iov = parts, .msg_iovlen = count};
    forget_errors(udp->sockets[class]);
    const ssize_t sent = sendmsg(udp->sockets[class], &datagram, MSG_DONTWAIT | MSG_NOSIGNAL);
    return sent >= 0 ? FV_OUTLET_SENT : drop_for(errno);
}

static void put_be32(uint8_t *at, uint32_t value)
{
    const uint32_t big = htonl(value);
    memcpy(at, &big, sizeof big);
}

static void put_be16(uint8_t *at, uint16_t value)
{
    const uint16_t big = htons(value);
    memcpy(at, &big, sizeof big);
}

static int send_fragments(struct udp *udp, const struct fv_outgoing *message)
{
    const enum fv_sender_class class = message->class;
    const uint32_t room = FV_LINK_DATAGRAM_BYTES - FRAGMENT_HEADER;
    const uint32_t named = (uint32_t)strlen(message->channel) + 1;
    const uint32_t count = (message->bytes + named + room - 1) / room;
    if (count > UINT16_MAX) return FV_TRANSPORT_DROP_LONG;
    int result = FV_OUTLET_SENT;
    while (udp->offsets[class] < message->bytes) {
        uint8_t header[FRAGMENT_HEADER];
        const uint32_t offset = udp->offsets[class], left = message->bytes - offset;
        const uint32_t most = room - (offset == 0 ? named : 0), bytes = left < most ? left : most;
        put_be32(header, MAGIC_FRAGMENT);
        put_be32(header + 4, udp->numbers[class]);
        put_be32(header + 8, message->bytes);
        put_be32(header + 12, offset);
        put_be16(header + 16, udp->fragments[class]);
        put_be16(header + 18, (uint16_t)count);
        struct iovec parts[] = {{header, sizeof header},
                                {(void *)(uintptr_t)message->channel, offset == 0 ? named : 0},
                                {(void *)(uintptr_t)(message->data + offset), bytes}};
        result = send_datagram(udp, class, parts, 3);
        if (result != FV_OUTLET_SENT) break;
        udp->offsets[class] += bytes;
        udp->fragments[class]++;
    }
    return result;
}

static int udp_send(struct fv_outlet *outlet, const struct fv_outgoing *message, int64_t now_ns)
{
    struct udp *udp = (struct udp *)outlet;
    const enum fv_sender_class class = message->class;
    const size_t named = strlen(message->channel) + 1;
    int result;
    (void)now_ns;
    if (WHOLE_HEADER + named + message->bytes > FV_LINK_DATAGRAM_BYTES) {
        result = send_fragments(udp, message);
    } else {
        uint8_t header[WHOLE_HEADER];
        put_be32(header, MAGIC_WHOLE);
        put_be32(header + 4, udp->numbers[class]);
        struct iovec parts[] = {{header, sizeof header},
                                {(void *)(uintptr_t)message->channel, named},
                                {(void *)(uintptr_t)message->data, message->bytes}};
        result = send_datagram(udp, class, parts, 3);
    }
    if (result == FV_OUTLET_BUSY) return result;
    udp->numbers[class]++;
    udp->offsets[class] = 0;
    udp->fragments[class] = 0;
    return result;
}

static bool udp_begun(const struct fv_outlet *outlet, enum fv_sender_class class)
{
    return ((const struct udp *)outlet)->fragments[class] > 0;
}

static bool udp_bulk_left(struct fv_outlet *outlet)
{
    const struct udp *udp = (const struct udp *)outlet;
    for (int class = FV_SENDER_OBJECTS; class < FV_SENDER_CLASSES; class ++) {
        int bytes = 0;
        if (ioctl(udp->sockets[class], SIOCOUTQ, &bytes) == 0 && bytes > 0) return false;
    }
    return true;
}

static bool udp_close(struct fv_outlet *outlet)
{
    struct udp *udp = (struct udp *)outlet;
    for (int class = 0; class < FV_SENDER_CLASSES; class ++)
        if (udp->sockets[class] >= 0) close(udp->sockets[class]);
    free(udp);
    return true;
}

static bool set(int socket, int level, int option, int value)
{
    return setsockopt(socket, level, option, &value, sizeof value) == 0;
}

static bool open_socket(struct udp *udp, enum fv_sender_class class, int ttl)
{
    const int made = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    udp->sockets[class] = made;
    /* Without IP_RECVERR Linux reports a datagram that the interface's queue dropped as sent. */
    return made >= 0 && set(made, IPPROTO_IP, IP_MULTICAST_TTL, ttl) &&
           set(made, IPPROTO_IP, IP_MULTICAST_LOOP, 1) && set(made, IPPROTO_IP, IP_RECVERR, 1) &&
           (class != FV_SENDER_PREVIEWS || set(made, SOL_SOCKET, SO_SNDBUF, PREVIEW_BUFFER));
}

enum fovea_status fv_outlet_udp(const char *url, struct fv_outlet **outlet,
                                struct fovea_error *error)
{
    struct udp *udp = calloc(1, sizeof *udp);
    if (udp == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    udp->outlet = (struct fv_outlet){.paced = true,
                                     .send = udp_send,
                                     .begun = udp_begun,
                                     .bulk_left = udp_bulk_left,
                                     .close = udp_close};
    fv_transport_udpm(url, &udp->to);
    for (int class = 0; class < FV_SENDER_CLASSES; class ++)
        udp->sockets[class] = -1;
    for (int class = 0; class < FV_SENDER_CLASSES; class ++) {
        if (open_socket(udp, (enum fv_sender_class) class, fv_transport_ttl(url))) continue;
        const int failed = errno;
        (void)udp_close(&udp->outlet);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: no socket to send from: %s", url,
                               strerror(failed));
    }
    *outlet = &udp->outlet;
    return FOVEA_OK;
}
