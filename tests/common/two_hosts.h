/* Two hosts of the test's own: this process is in one, a child in the other, and a veth pair named
 * eth0 on both ends joins them. This one is 10.9.0.1, the other 10.9.0.2; multicast is routed to
 * eth0 on this one. Nothing outside of the two can be reached. Needs root (or a user namespace) and
 * the program ip. */
#ifndef FOVEA_TESTS_TWO_HOSTS_H
#define FOVEA_TESTS_TWO_HOSTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define TWO_HOSTS_HERE "10.9.0.1"
#define TWO_HOSTS_OTHER "10.9.0.2"

/* Once, before any thread exists. False: not possible here. */
bool two_hosts_enter(void);

/* A UDP packet from the other host, made by hand: any source and time-to-live. */
struct two_hosts_packet {
    const char *from, *to; /* IPv4 addresses; `to` a group or TWO_HOSTS_HERE */
    uint16_t port;
    uint8_t ttl;
    const void *data;
    size_t bytes; /* at most 1400 */
};
void two_hosts_send(const struct two_hosts_packet *packet);

/* End the other host. */
void two_hosts_leave(void);

#endif
