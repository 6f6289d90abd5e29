/* Does an LCM message reach a subscriber on this host? A message goes out through LCM itself; a
 * socket that is set up as LCM's subscribers set up theirs listens for it. (LCM's own self test
 * blocks for ten seconds where it fails.) */
#include "app/transport.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "app/files.h"
#include "app/transport_url.h"

enum { TRIES = 10, TRY_MS = 50 };

static int open_listener(const struct sockaddr_in *address, const char **what)
{
    int on = 1, listener = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const struct ip_mreq group = {.imr_multiaddr = address->sin_addr,
                                  .imr_interface.s_addr = htonl(INADDR_ANY)};
    struct sockaddr_in any = *address;
    any.sin_addr.s_addr = htonl(INADDR_ANY);
    *what = listener < 0                                                          ? "open a socket"
            : setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ? "share the port"
            : setsockopt(listener, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) != 0 ? "share the port"
            : bind(listener, (const struct sockaddr *)&any, sizeof any) != 0 ? "bind to the port"
            : setsockopt(listener, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) != 0
                ? "join the group"
                : NULL;
    if (*what == NULL) return listener;
    int reason = errno;
    if (listener >= 0) close(listener);
    errno = reason;
    return -1;
}

/* Whether a datagram that holds `channel` comes within TRY_MS. LCM puts the channel's name after 8
 * bytes. */
static bool arrives(int listener, const char *channel)
{
    char datagram[2048];
    struct pollfd wait = {.fd = listener, .events = POLLIN};
    for (int i = 0; i < 64 && poll(&wait, 1, TRY_MS) == 1; i++) {
        ssize_t bytes = recv(listener, datagram, sizeof datagram, MSG_DONTWAIT);
        if (bytes > 8 && (size_t)bytes > 8 + strlen(channel) && strcmp(datagram + 8, channel) == 0)
            return true;
    }
    return false;
}

static enum fovea_status try_multicast(struct fv_transport *transport, const char *url,
                                       int listener, struct fovea_error *error)
{
    char channel[64];
    const uint8_t nothing[1] = {0};
    struct fovea_outputs outputs = {.message_count = 1};
    struct fv_transport_counts counts;
    snprintf(channel, sizeof channel, "FOVEA_CHECK_%ld", (long)getpid());
    outputs.messages[0] =
        (struct fovea_message){.channel = channel, .data = nothing, .bytes = sizeof nothing};
    for (int i = 0; i < TRIES; i++) {
        fv_transport_publish(transport, &outputs);
        if (arrives(listener, channel)) return FOVEA_OK;
    }
    fv_transport_counts(transport, &counts);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: messages %s; this mends it where there is no network: %s", url,
                           counts.failed > 0
                               ? "cannot be sent"
                               : "are sent but do not reach a subscriber on this host",
                           FV_TRANSPORT_MEND);
}

enum fovea_status fv_transport_check(const char *url, uint32_t ttl, struct fovea_error *error)
{
    struct fv_transport *transport;
    struct sockaddr_in address;
    char log[FV_TRANSPORT_URL_BYTES];
    enum fovea_status status = fv_transport_url_check(url, error);
    if (status == FOVEA_OK &&
        fv_transport_file(url, log)) { /* LCM would cut it, or write into it */
        const char *blame;
        const struct fv_file written[] = {{"lcm_url", log}, {0}};
        return fv_files_writable(written, &blame, error);
    }
    if (status == FOVEA_OK) status = fv_transport_open(url, ttl, &transport, error);
    if (status != FOVEA_OK || transport == NULL) return status;
    if (fv_transport_kind_of(url) ==
        FV_TRANSPORT_UDPM) { /* what can be known of the others, opening has found */
        fv_transport_udpm(url, &address);
        const char *what;
        int listener = open_listener(&address, &what);
        if (listener < 0) {
            status = fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                     "%s: a subscriber cannot %s (%s); this mends it: %s", url,
                                     what, strerror(errno), FV_TRANSPORT_MEND);
        } else {
            status = try_multicast(transport, url, listener, error);
            close(listener);
        }
    }
    fv_transport_close(transport);
    return status;
}
