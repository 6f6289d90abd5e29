/* What the kernel knows of the way to a client. Without a limit TCP fills the queues on that way:
 * on a slow link the newest message then waits for half a second and more behind older ones. */
#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <stddef.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "web/server_internal.h"

enum {
    ROOM_BYTES_MIN = 12288, /* on the way, however slow it is: the start of a connection */
    QUEUED_MS_MAX = 50      /* in queues, beyond the way there and back */
};

void fv_web_server_link(struct lws *wsi, struct fv_web_link *link)
{
    struct tcp_info info = {0};
    socklen_t bytes = sizeof info;
    int unsent = 0;
    const int socket = lws_get_socket_fd(wsi);
    *link = (struct fv_web_link){0};
    if (getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &bytes) != 0 ||
        bytes < offsetof(struct tcp_info, tcpi_delivery_rate) + sizeof info.tcpi_delivery_rate ||
        info.tcpi_delivery_rate == 0)
        return;
    const double way_s = info.tcpi_min_rtt * 1e-6 + QUEUED_MS_MAX * 1e-3;
    const bool is_queued = info.tcpi_rtt > info.tcpi_min_rtt + 1000 * QUEUED_MS_MAX;
    if (info.tcpi_delivery_rate_app_limited == 0) link->bytes_per_s = info.tcpi_delivery_rate;
    if (ioctl(socket, SIOCOUTQ, &unsent) != 0 || unsent <= ROOM_BYTES_MIN) return;
    link->behind = unsent > way_s * (double)info.tcpi_delivery_rate;
    link->queued = is_queued;
}
