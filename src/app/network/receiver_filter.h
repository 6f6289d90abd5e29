/* The part of the receiver that runs in the kernel: a classic BPF program for a UDP socket. */
#ifndef FOVEA_APP_NETWORK_RECEIVER_FILTER_H
#define FOVEA_APP_NETWORK_RECEIVER_FILTER_H

#include <linux/filter.h>
#include <stdbool.h>

#include "app/network/receiver_packet.h"

enum { FV_FILTER_CODE_MAX = 16 + FV_RECEIVER_CHANNELS_MAX * 40 };

struct fv_filter {
    struct sock_filter code[FV_FILTER_CODE_MAX];
    unsigned short length;
};

/* Pass LC02 packets on the table's channels that this host sent (`from_host`: looped back by the
 * kernel, or in on the interface with the number `lo`), or all the others that it did not send;
 * drop everything else. */
void fv_filter_build(struct fv_filter *filter, const struct fv_receiver_table *table,
                     bool from_host, unsigned lo);

/* Attach to a socket, for good. 0, or an errno value. */
int fv_filter_attach(const struct fv_filter *filter, int udp);

#endif
