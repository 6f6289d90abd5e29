/* A network of the test's own: nothing but a loopback, so that multicast can be taken away and
 * mended without touching the machine. Must be entered before any thread exists. */
#ifndef FOVEA_TESTS_OWN_NETWORK_H
#define FOVEA_TESTS_OWN_NETWORK_H

#include <stdbool.h>
#include <stdint.h>

/* Enter a new network namespace; its loopback is down. False: not permitted here. */
bool own_network_enter(void);

/* Loopback up, multicast on, route 224.0.0.0/4 through it: what the command does that `fovea check`
 * tells people. */
bool own_network_mend(void);

/* A socket for what is sent to a group by multicast, with room for 8 MB, on the interface of this
 * address; -1: there is none. */
int own_network_receiver(const char *group, uint16_t port, const char *address);

#endif
