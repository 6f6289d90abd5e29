/* Does an LCM message reach a subscriber on this host? A packet goes to the group of the URL, on a
 * port of the check's own and with a time-to-live of 0, and the receiver of this program listens
 * for it there: nobody else hears anything of it. */
#include "app/network/transport.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "app/network/receiver.h"
#include "app/network/transport_url.h"
#include "support/files.h"

enum { TRIES = 10, TRY_MS = 50 };

static const char channel[] = "FOVEA_CHECK";

static void take(void *context, const struct fv_received *received)
{
    bool *came = context;
    *came = *came || received->from_host;
}

/* A socket to send from, which holds a free port of the group: `address` gets it. -1 and errno. */
static int open_sender(struct sockaddr_in *address)
{
    const int on = 1;
    const uint8_t this_host = 0;
    socklen_t bytes = sizeof *address;
    const int udp = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    address->sin_port = 0;
    if (udp >= 0 && setsockopt(udp, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
        setsockopt(udp, IPPROTO_IP, IP_MULTICAST_TTL, &this_host, sizeof this_host) == 0 &&
        bind(udp, (const struct sockaddr *)address, sizeof *address) == 0 &&
        getsockname(udp, (struct sockaddr *)address, &bytes) == 0)
        return udp;
    const int reason = errno;
    if (udp >= 0) close(udp);
    errno = reason;
    return -1;
}

static enum fovea_status open_receiver(const struct sockaddr_in *address, bool *came,
                                       struct fv_receiver **receiver, struct fovea_error *error)
{
    struct fv_receiver_channel row = {.bytes_max = 1, .take = take, .context = came};
    char group[INET_ADDRSTRLEN], url[64];
    memcpy(row.name, channel, sizeof channel);
    snprintf(url, sizeof url, "udpm://%s:%d",
             inet_ntop(AF_INET, &address->sin_addr, group, sizeof group), ntohs(address->sin_port));
    const struct fv_receiver_setup setup = {url, "loopback", &row, 1};
    return fv_receiver_open(&setup, receiver, error);
}

static enum fovea_status no_descriptor(const char *url, struct fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: no descriptor is left for a socket; 'ulimit -n 64' permits enough",
                           url);
}

/* The receiver makes do with the sockets that it gets. */
static bool descriptors_gone(int any)
{
    const int spare = dup(any);
    const bool gone = spare < 0 && (errno == EMFILE || errno == ENFILE);
    if (spare >= 0) close(spare);
    return gone;
}

static enum fovea_status check_multicast(const char *url, struct fovea_error *error)
{
    uint8_t packet[8 + sizeof channel] = {'L', 'C', '0', '2'};
    struct sockaddr_in address;
    struct fv_receiver *receiver = NULL;
    struct fovea_error reason = {0};
    bool came = false, sent = false;
    memcpy(packet + 8, channel, sizeof channel);
    fv_transport_udpm(url, &address);
    const int udp = open_sender(&address);
    if (udp < 0 && (errno == EMFILE || errno == ENFILE)) return no_descriptor(url, error);
    if (udp < 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: a program cannot bind to the group (%s); this remedies it: %s",
                               url, strerror(errno), FV_TRANSPORT_MEND);
    const bool open = open_receiver(&address, &came, &receiver, &reason) == FOVEA_OK;
    for (int i = 0; i < TRIES && open && !came; i++) {
        sent = sendto(udp, packet, sizeof packet, 0, (const struct sockaddr *)&address,
                      sizeof address) > 0 ||
               sent;
        fv_receiver_handle(receiver, TRY_MS);
    }
    const bool gone = descriptors_gone(udp);
    fv_receiver_close(receiver);
    close(udp);
    if (!came && gone) return no_descriptor(url, error);
    if (came) return FOVEA_OK;
    if (!open) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s", reason.text);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: messages %s; on a host without a network this remedies it: %s", url,
                           sent ? "are sent but do not reach a subscriber on this host"
                                : "cannot be sent",
                           FV_TRANSPORT_MEND);
}

enum fovea_status fv_transport_check(const char *url, uint32_t ttl, struct fovea_error *error)
{
    char log[FV_TRANSPORT_URL_BYTES];
    (void)ttl; /* the check stays on this host */
    if (url[0] == '\0') return FOVEA_OK;
    enum fovea_status status = fv_transport_url_check(url, error);
    if (status != FOVEA_OK) return status;
    if (fv_transport_file(url, log)) { /* LCM would cut it, or write into it */
        const char *blame;
        const struct fv_file written[] = {{"lcm_url", log}, {0}};
        return fv_files_writable(written, &blame, error);
    }
    status = fv_transport_reachable(url, error);
    if (status != FOVEA_OK || fv_transport_kind_of(url) != FV_TRANSPORT_UDPM) return status;
    return check_multicast(url, error);
}
