#include "common/own_network.h"

#include <arpa/inet.h>
#include <net/if.h>
#include <net/route.h>
#include <netinet/in.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

bool own_network_enter(void)
{
    return unshare(CLONE_NEWNET) == 0 || unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0;
}

static struct sockaddr address_of(const char *text)
{
    struct sockaddr_in address = {.sin_family = AF_INET};
    struct sockaddr plain;
    inet_pton(AF_INET, text, &address.sin_addr);
    memcpy(&plain, &address, sizeof plain);
    return plain;
}

bool own_network_mend(void)
{
    static char lo[] = "lo";
    int control = socket(AF_INET, SOCK_DGRAM, 0);
    struct ifreq device;
    struct rtentry route;
    memset(&device, 0, sizeof device);
    memset(&route, 0, sizeof route);
    snprintf(device.ifr_name, sizeof device.ifr_name, "%s", lo);
    bool done = control >= 0 && ioctl(control, SIOCGIFFLAGS, &device) == 0;
    device.ifr_flags |= IFF_UP | IFF_MULTICAST;
    done = done && ioctl(control, SIOCSIFFLAGS, &device) == 0;
    route.rt_dst = address_of("224.0.0.0");
    route.rt_genmask = address_of("240.0.0.0");
    route.rt_flags = RTF_UP;
    route.rt_dev = lo;
    done = done && ioctl(control, SIOCADDRT, &route) == 0;
    if (control >= 0) close(control);
    return done;
}

int own_network_receiver(const char *group, uint16_t port, const char *address)
{
    const int made = socket(AF_INET, SOCK_DGRAM, 0), room = 8 << 20;
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = inet_addr(group)};
    const struct ip_mreq joined = {.imr_multiaddr = to.sin_addr,
                                   .imr_interface.s_addr = inet_addr(address)};
    if (bind(made, (const struct sockaddr *)&to, sizeof to) != 0 ||
        setsockopt(made, IPPROTO_IP, IP_ADD_MEMBERSHIP, &joined, sizeof joined) != 0)
        return -1;
    (void)setsockopt(made, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
    return made;
}
