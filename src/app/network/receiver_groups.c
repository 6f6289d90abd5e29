#include "app/network/receiver_groups.h"

#include <errno.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

int fv_groups_watch(void)
{
    const struct sockaddr_nl news = {
        .nl_family = AF_NETLINK,
        .nl_groups = RTMGRP_LINK | RTMGRP_IPV4_IFADDR | RTMGRP_IPV4_ROUTE | RTMGRP_IPV4_RULE,
    };
    const int watch = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
    if (watch < 0) return -1;
    if (bind(watch, (const struct sockaddr *)&news, sizeof news) == 0) return watch;
    const int reason = errno;
    close(watch);
    errno = reason;
    return -1;
}

bool fv_groups_tell_of_deletion(const uint8_t *news, size_t bytes)
{
    struct nlmsghdr header;
    for (size_t at = 0; at + sizeof header <= bytes; at += NLMSG_ALIGN((size_t)header.nlmsg_len)) {
        memcpy(&header, news + at, sizeof header);
        if (header.nlmsg_type == RTM_DELLINK || header.nlmsg_len < sizeof header ||
            header.nlmsg_len > bytes - at)
            return true;
    }
    return false;
}

bool fv_groups_changed(int watch, bool *deleted)
{
    uint8_t news[8192];
    bool changed = false;
    *deleted = false;
    for (int i = 0; i < 64; i++) {
        const ssize_t bytes = recv(watch, news, sizeof news, 0);
        if (bytes < 0 && errno != ENOBUFS && errno != EINTR) break;
        changed = true; /* ENOBUFS: news were lost, so anything may have changed */
        *deleted = *deleted || bytes < 0 || fv_groups_tell_of_deletion(news, (size_t)bytes);
    }
    return changed;
}

unsigned fv_groups_route_interface(const uint8_t *answer, size_t bytes)
{
    struct nlmsghdr header;
    struct rtattr attribute;
    size_t at = NLMSG_ALIGN(sizeof header) + NLMSG_ALIGN(sizeof(struct rtmsg));
    if (bytes < at) return 0;
    memcpy(&header, answer, sizeof header);
    if (header.nlmsg_type != RTM_NEWROUTE) return 0;
    while (at + sizeof attribute <= bytes) {
        memcpy(&attribute, answer + at, sizeof attribute);
        if (attribute.rta_len < sizeof attribute || attribute.rta_len > bytes - at) return 0;
        unsigned index;
        if (attribute.rta_type == RTA_OIF && attribute.rta_len >= RTA_LENGTH(sizeof index)) {
            memcpy(&index, answer + at + RTA_LENGTH(0), sizeof index);
            return index;
        }
        at += RTA_ALIGN(attribute.rta_len);
    }
    return 0;
}

/* The interface of the group's route, 0: it has none. */
static unsigned route(struct in_addr group)
{
    struct {
        struct nlmsghdr header;
        struct rtmsg route;
        struct rtattr attribute;
        struct in_addr group;
    } question = {
        .header = {.nlmsg_len = sizeof question,
                   .nlmsg_type = RTM_GETROUTE,
                   .nlmsg_flags = NLM_F_REQUEST},
        .route = {.rtm_family = AF_INET, .rtm_dst_len = 32},
        .attribute = {.rta_len = RTA_LENGTH(sizeof group), .rta_type = RTA_DST},
        .group = group,
    };
    uint8_t answer[4096];
    const struct timeval patience = {.tv_sec = 1};
    const int asking = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (asking < 0) return 0;
    setsockopt(asking, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ssize_t bytes = send(asking, &question, sizeof question, 0);
    if (bytes > 0) bytes = recv(asking, answer, sizeof answer, 0);
    close(asking);
    return bytes > 0 ? fv_groups_route_interface(answer, (size_t)bytes) : 0;
}

bool fv_interfaces_have(const struct fv_interfaces *interfaces, unsigned index)
{
    for (unsigned i = 0; i < interfaces->count; i++)
        if (interfaces->index[i] == index) return true;
    return false;
}

static void add(struct fv_interfaces *interfaces, unsigned index)
{
    if (index == 0 || interfaces->count == FV_GROUPS_MAX || fv_interfaces_have(interfaces, index))
        return;
    interfaces->index[interfaces->count++] = index;
}

/* Interfaces that are up and take multicast, `lo` aside. */
static void add_all(struct fv_interfaces *interfaces)
{
    struct if_nameindex *all = if_nameindex();
    const int asking = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    for (struct if_nameindex *i = all; asking >= 0 && i != NULL && i->if_index != 0; i++) {
        struct ifreq request = {0};
        snprintf(request.ifr_name, sizeof request.ifr_name, "%s", i->if_name);
        const bool known = ioctl(asking, SIOCGIFFLAGS, &request) == 0;
        const unsigned flags = known ? (unsigned short)request.ifr_flags : 0;
        if ((flags & IFF_UP) && (flags & IFF_MULTICAST) && !(flags & IFF_LOOPBACK))
            add(interfaces, i->if_index);
    }
    if (asking >= 0) close(asking);
    if (all != NULL) if_freenameindex(all);
}

void fv_groups_wanted(const char *listen, struct in_addr group, struct fv_interfaces *of_host,
                      struct fv_interfaces *of_network)
{
    of_host->count = of_network->count = 0;
    add(of_host, if_nametoindex("lo"));
    add(of_host, route(group));
    if (strcmp(listen, "any") == 0)
        add_all(of_network);
    else if (strcmp(listen, "loopback") != 0)
        add(of_network, if_nametoindex(listen));
    for (unsigned i = 0; i < of_network->count; i++)
        add(of_host, of_network->index[i]);
}

static int change(const struct fv_groups *groups, int option, unsigned index)
{
    const struct ip_mreqn request = {.imr_multiaddr = groups->group, .imr_ifindex = (int)index};
    return setsockopt(groups->udp, IPPROTO_IP, option, &request, sizeof request) == 0 ? 0 : errno;
}

void fv_groups_leave(struct fv_groups *groups)
{
    for (unsigned i = 0; i < groups->joined.count; i++)
        change(groups, IP_DROP_MEMBERSHIP, groups->joined.index[i]);
    groups->joined.count = 0;
}

int fv_groups_update(struct fv_groups *groups, const struct fv_interfaces *wanted)
{
    struct fv_interfaces kept = {0};
    int failed = 0;
    for (unsigned i = 0; i < groups->joined.count; i++) {
        const unsigned index = groups->joined.index[i];
        if (fv_interfaces_have(wanted, index))
            add(&kept, index);
        else
            change(groups, IP_DROP_MEMBERSHIP, index);
    }
    for (unsigned i = 0; i < wanted->count; i++) {
        if (fv_interfaces_have(&kept, wanted->index[i])) continue;
        const int reason = change(groups, IP_ADD_MEMBERSHIP, wanted->index[i]);
        if (reason == 0 || reason == EADDRINUSE)
            add(&kept, wanted->index[i]);
        else if (failed == 0)
            failed = reason;
    }
    groups->joined = kept;
    return failed;
}
