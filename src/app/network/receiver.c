#include "app/network/receiver.h"

#include <errno.h>
#include <linux/sock_diag.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "app/network/receiver_filter.h"
#include "app/network/receiver_groups.h"
#include "app/network/receiver_packet.h"
#include "app/network/receiver_tcpq.h"
#include "app/network/transport_url.h"
#include "drivers/clock.h"
#include "support/aligned.h"
#include "support/say.h"

enum { BURST = 64 }; /* packets of one socket before the others get their turn */

/* Packets of this host and of the network come in through sockets of their own: which socket it was
 * says where a packet is from, by the kernel's word. */
enum way { WAY_HOST, WAY_NETWORK, WAY_COUNT };

struct fv_receiver_channel
fv_receiver_channel_of(const char *name, const char *type, uint32_t bytes_max,
                       void (*take)(void *context, const struct fv_received *received),
                       void *context)
{
    struct fv_receiver_channel row = {
        .type = type, .bytes_max = bytes_max, .take = take, .context = context};
    snprintf(row.name, sizeof row.name, "%s", name);
    return row;
}

struct fv_receiver {
    struct fv_receiver_table table;
    char url[FV_TRANSPORT_URL_BYTES], listen[IF_NAMESIZE];
    int wake;  /* eventfd */
    int watch; /* netlink; -1: none */
    bool udpm, said;
    struct fv_groups groups[WAY_COUNT]; /* udp is -1 where there is none */
    struct fv_tcpq tcpq;                /* used unless udpm */
    size_t capacity;
    uint8_t buffer[]; /* capacity bytes */
};

/* ---- opening --------------------------------------------------------------------------------- */

bool fv_receiver_listen_valid(const char *listen)
{
    const size_t length = strlen(listen);
    if (length == 0 || length >= IF_NAMESIZE) return false;
    for (const char *at = listen; *at != '\0'; at++)
        if (*at == '/' || *at == ':' || (unsigned char)*at <= ' ') return false;
    return true;
}

/* The socket of one way, filtered before it is bound, and not yet joined. -1 and `*what`. */
static int open_udp(const struct fv_receiver *receiver, enum way way,
                    const struct sockaddr_in *address, const char **what)
{
    const int on = 1, off = 0;
    struct fv_filter filter;
    const unsigned lo = if_nametoindex("lo");
    const int udp = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    fv_filter_build(&filter, &receiver->table, way == WAY_HOST, lo != 0 ? lo : 1);
    *what = NULL;
    if (udp < 0)
        *what = "open a socket";
    else if (setsockopt(udp, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0)
        *what = "share the port";
    else if (setsockopt(udp, IPPROTO_IP, IP_MULTICAST_ALL, &off, sizeof off) != 0)
        *what = "keep to its own interfaces";
    else if (setsockopt(udp, IPPROTO_IP, IP_PKTINFO, &on, sizeof on) != 0)
        *what = "ask for a packet's interface";
    else if ((errno = fv_filter_attach(&filter, udp)) != 0)
        *what = "attach a filter";
    else if (bind(udp, (const struct sockaddr *)address, sizeof *address) != 0)
        *what = "bind to the group";
    if (*what == NULL) return udp;
    const int reason = errno;
    if (udp >= 0) close(udp);
    errno = reason;
    return -1;
}

/* Follow the machine's routes and interfaces. */
static void update_groups(struct fv_receiver *receiver)
{
    struct fv_interfaces wanted[WAY_COUNT];
    const struct in_addr group = receiver->groups[WAY_HOST].group;
    int failed = 0;
    fv_groups_wanted(receiver->listen, group, &wanted[WAY_HOST], &wanted[WAY_NETWORK]);
    for (int way = 0; way < WAY_COUNT; way++)
        if (receiver->groups[way].udp >= 0) {
            const int reason = fv_groups_update(&receiver->groups[way], &wanted[way]);
            failed = failed != 0 ? failed : reason;
        }
    if (receiver->said) return;
    const bool named =
        receiver->groups[WAY_NETWORK].udp >= 0 && strcmp(receiver->listen, "any") != 0;
    const bool absent = named && wanted[WAY_NETWORK].count == 0;
    receiver->said = failed != 0 || absent;
    if (failed != 0)
        fv_say("%s: cannot listen on an interface: %s", receiver->url, strerror(failed));
    else if (absent)
        fv_say("listen: %s: there is no such interface now; listening starts when it appears",
               receiver->listen);
}

static enum fovea_status open_udpm(struct fv_receiver *receiver, struct fovea_error *error)
{
    struct sockaddr_in address;
    const char *what = NULL;
    fv_transport_udpm(receiver->url, &address);
    receiver->udpm = true;
    for (int way = 0; way < WAY_COUNT; way++) {
        struct fv_groups *groups = &receiver->groups[way];
        groups->group = address.sin_addr;
        if (way == WAY_NETWORK && strcmp(receiver->listen, "loopback") == 0) continue;
        groups->udp = open_udp(receiver, (enum way)way, &address, &what);
        if (groups->udp < 0)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: a receiver cannot %s: %s",
                                   receiver->url, what, strerror(errno));
    }
    receiver->watch = fv_groups_watch();
    if (receiver->watch < 0)
        fv_say("%s: changes of routes and interfaces will not be followed: %s", receiver->url,
               strerror(errno));
    update_groups(receiver);
    return FOVEA_OK;
}

static enum fovea_status open_tcpq(struct fv_receiver *receiver, struct fovea_error *error)
{
    struct fv_tcpq *tcpq = &receiver->tcpq;
    tcpq->host_only = strcmp(receiver->listen, "any") != 0;
    tcpq->url = receiver->url;
    fv_tcpq_begin(&tcpq->stream, &receiver->table, receiver->buffer, receiver->capacity);
    return fv_transport_server(receiver->url, &tcpq->server, error);
}

enum fovea_status fv_receiver_open(const struct fv_receiver_setup *setup,
                                   struct fv_receiver **receiver, struct fovea_error *error)
{
    struct fv_receiver_table table = {.count = setup->channel_count};
    const enum fv_transport_kind kind = fv_transport_kind_of(setup->url);
    *receiver = NULL;
    if (strcmp(setup->listen, "none") == 0) return FOVEA_OK;
    if (kind != FV_TRANSPORT_UDPM && kind != FV_TRANSPORT_TCPQ) return FOVEA_OK;
    if (!fv_receiver_listen_valid(setup->listen) || setup->channel_count > FV_RECEIVER_CHANNELS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "listen: found \"%.40s\", expected none, loopback, any or the name "
                               "of an interface",
                               setup->listen);
    fv_message_prepare();
    memcpy(table.rows, setup->channels, setup->channel_count * sizeof table.rows[0]);
    const size_t capacity = fv_table_packet_bytes_max(&table) + 1; /* one more shows a longer one */
    struct fv_receiver *opened = fv_aligned_zeroed(sizeof *opened + capacity);
    if (opened == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for a receiver");
    memcpy(opened->table.rows, table.rows, sizeof table.rows);
    opened->table.count = table.count;
    opened->capacity = capacity;
    opened->watch = opened->tcpq.tcp = -1;
    opened->groups[WAY_HOST].udp = opened->groups[WAY_NETWORK].udp = -1;
    snprintf(opened->url, sizeof opened->url, "%s", setup->url);
    snprintf(opened->listen, sizeof opened->listen, "%s", setup->listen);
    opened->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    enum fovea_status status = opened->wake < 0 ? fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                                                  "no eventfd: %s", strerror(errno))
                               : kind == FV_TRANSPORT_UDPM ? open_udpm(opened, error)
                                                           : open_tcpq(opened, error);
    if (status == FOVEA_OK)
        *receiver = opened;
    else
        fv_receiver_close(opened);
    return status;
}

/* ---- running --------------------------------------------------------------------------------- */

/* Whether the packet came to the group, and in on an interface where this socket is joined. */
static bool came_rightly(const struct fv_groups *groups, struct msghdr *message)
{
    for (struct cmsghdr *control = CMSG_FIRSTHDR(message); control != NULL;
         control = CMSG_NXTHDR(message, control)) {
        struct in_pktinfo info;
        if (control->cmsg_level != IPPROTO_IP || control->cmsg_type != IP_PKTINFO) continue;
        memcpy(&info, CMSG_DATA(control), sizeof info);
        return info.ipi_addr.s_addr == groups->group.s_addr &&
               fv_interfaces_have(&groups->joined, (unsigned)info.ipi_ifindex);
    }
    return false;
}

static uint32_t handle_udp(struct fv_receiver *receiver, enum way way)
{
    const struct fv_groups *groups = &receiver->groups[way];
    _Alignas(struct cmsghdr) uint8_t control[CMSG_SPACE(sizeof(struct in_pktinfo))];
    uint32_t taken = 0;
    for (int i = 0; i < BURST; i++) {
        struct iovec room = {receiver->buffer, receiver->capacity};
        struct msghdr message = {.msg_iov = &room,
                                 .msg_iovlen = 1,
                                 .msg_control = control,
                                 .msg_controllen = sizeof control};
        const ssize_t bytes = recvmsg(groups->udp, &message, MSG_DONTWAIT);
        if (bytes < 0 && errno != EINTR) break;
        if (bytes < 0) continue;
        if (came_rightly(groups, &message))
            taken += fv_packet_take(&receiver->table, receiver->buffer, (size_t)bytes,
                                    (message.msg_flags & MSG_TRUNC) != 0, way == WAY_HOST);
        else
            fv_table_drop(&receiver->table, FV_DROP_INTERFACE);
    }
    return taken;
}

uint32_t fv_receiver_handle(struct fv_receiver *receiver, int timeout_ms)
{
    struct pollfd wait[] = {
        {.fd = receiver->groups[WAY_HOST].udp, .events = POLLIN},
        {.fd = receiver->groups[WAY_NETWORK].udp, .events = POLLIN},
        {.fd = receiver->wake, .events = POLLIN},
        {.fd = receiver->watch, .events = POLLIN},
        {.fd = -1},
    };
    uint32_t taken = 0;
    uint64_t woken;
    if (!receiver->udpm) {
        wait[4].fd = fv_tcpq_wait_for(&receiver->tcpq, &wait[4].events);
        if (wait[4].fd < 0 && (timeout_ms < 0 || timeout_ms > FV_TCPQ_RETRY_MS))
            timeout_ms = FV_TCPQ_RETRY_MS;
    }
    if (poll(wait, sizeof wait / sizeof wait[0], timeout_ms) <= 0) return 0;
    bool deleted;
    if (wait[3].revents != 0 && fv_groups_changed(receiver->watch, &deleted)) {
        for (int way = 0; deleted && way < WAY_COUNT; way++)
            if (receiver->groups[way].udp >= 0) fv_groups_leave(&receiver->groups[way]);
        update_groups(receiver);
    }
    for (int way = 0; way < WAY_COUNT; way++)
        if (wait[way].revents != 0) taken += handle_udp(receiver, (enum way)way);
    if (wait[4].revents != 0) taken += fv_tcpq_ready(&receiver->tcpq);
    if (wait[2].revents != 0 && read(receiver->wake, &woken, sizeof woken) < 0) return taken;
    return taken;
}

void fv_receiver_wake(struct fv_receiver *receiver)
{
    const uint64_t one = 1;
    while (write(receiver->wake, &one, sizeof one) < 0 && errno == EINTR)
        continue;
}

/* ---- counts and end -------------------------------------------------------------------------- */

/* The kernel counts in one number what its filter and a full socket drop. */
static uint64_t kernel_drops(int udp)
{
    uint32_t counts[SK_MEMINFO_VARS] = {0};
    socklen_t bytes = sizeof counts;
    if (udp < 0 || getsockopt(udp, SOL_SOCKET, SO_MEMINFO, counts, &bytes) != 0) return 0;
    return counts[SK_MEMINFO_DROPS];
}

void fv_receiver_counts(const struct fv_receiver *receiver, struct fv_receiver_counts *counts)
{
    memset(counts, 0, sizeof *counts);
    if (receiver == NULL) return;
    counts->taken = atomic_load(&receiver->table.taken);
    for (int i = 0; i < FV_DROP_COUNT; i++)
        counts->dropped[i] = atomic_load(&receiver->table.dropped[i]);
    for (int way = 0; way < WAY_COUNT; way++)
        counts->dropped[FV_DROP_KERNEL] += kernel_drops(receiver->groups[way].udp);
}

void fv_receiver_close(struct fv_receiver *receiver)
{
    if (receiver == NULL) return;
    for (int way = 0; way < WAY_COUNT; way++)
        if (receiver->groups[way].udp >= 0) close(receiver->groups[way].udp);
    if (receiver->watch >= 0) close(receiver->watch);
    if (receiver->wake >= 0) close(receiver->wake);
    fv_tcpq_close(&receiver->tcpq);
    free(receiver);
}
