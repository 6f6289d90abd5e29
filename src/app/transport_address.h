/* The multicast address inside an LCM URL. */
#ifndef FOVEA_APP_TRANSPORT_ADDRESS_H
#define FOVEA_APP_TRANSPORT_ADDRESS_H

#include <netinet/in.h>

/* 1: a well-formed udpm URL, `address` is its group and port. 0: another provider. -1: malformed. */
int fv_transport_udpm(const char *url, struct sockaddr_in *address);

#endif
