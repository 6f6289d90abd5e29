/* Memberships of the receiver's sockets in the group, kept in step with the kernel's routes and
 * interfaces. Off the loop thread; updates make heap calls and give everything back. */
#ifndef FOVEA_APP_NETWORK_RECEIVER_GROUPS_H
#define FOVEA_APP_NETWORK_RECEIVER_GROUPS_H

#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FV_GROUPS_MAX = 20 }; /* net.ipv4.igmp_max_memberships, unless somebody raised it */

/* Interfaces by number. */
struct fv_interfaces {
    unsigned count, index[FV_GROUPS_MAX];
};

/* One socket and the interfaces on which it is joined. */
struct fv_groups {
    int udp;
    struct in_addr group;
    struct fv_interfaces joined;
};

/* A netlink socket that becomes readable when a route, an address or an interface changes; -1 and
 * errno. */
int fv_groups_watch(void);
/* Read all news there is. True: something may have changed. `deleted`: an interface may have gone,
 * and another may have come under its number, on which nothing is joined. */
bool fv_groups_changed(int watch, bool *deleted);

/* What both read. Whether an interface was deleted: news that were cut may hold that too. The
 * RTA_OIF of an answer to RTM_GETROUTE, 0: none. */
bool fv_groups_tell_of_deletion(const uint8_t *news, size_t bytes);
unsigned fv_groups_route_interface(const uint8_t *answer, size_t bytes);

/* Which interfaces `listen` (receiver.h) wants joined: for the socket that hears this host, and for
 * the one that hears the network. What does not exist now is left out. */
void fv_groups_wanted(const char *listen, struct in_addr group, struct fv_interfaces *of_host,
                      struct fv_interfaces *of_network);

bool fv_interfaces_have(const struct fv_interfaces *interfaces, unsigned index);

/* Leave all, to join again. */
void fv_groups_leave(struct fv_groups *groups);
/* Leave and join until `groups` is joined on `wanted`. 0, or the errno of the first join that
 * failed; the others are tried all the same. */
int fv_groups_update(struct fv_groups *groups, const struct fv_interfaces *wanted);

#endif
