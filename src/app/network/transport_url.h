/* LCM URLs: what is accepted, and what can be refused before LCM is asked, which prints lines of
 * its own. Init-only. */
#ifndef FOVEA_APP_NETWORK_TRANSPORT_URL_H
#define FOVEA_APP_NETWORK_TRANSPORT_URL_H

#include <netinet/in.h>
#include <stdint.h>

#include "app/network/transport.h"
#include "app/network/url_check.h"

enum fv_transport_kind {
    FV_TRANSPORT_UDPM, /* udpm://[GROUP[:PORT]][?ttl=N&recv_buf_size=N] */
    FV_TRANSPORT_TCPQ, /* tcpq://[HOST[:PORT]]: an LCM server */
    FV_TRANSPORT_FILE, /* file://PATH?mode=w or mode=a: a log without subscribers */
    FV_TRANSPORT_MEMQ, /* memq://: within this program */
    FV_TRANSPORT_UNKNOWN
};

enum fv_transport_kind fv_transport_kind_of(const char *url);

/* Group and port of a well-formed udpm URL. */
void fv_transport_udpm(const char *url, struct sockaddr_in *address);

/* Time-to-live of a complete udpm URL. */
int fv_transport_ttl(const char *url);

/* Whether a well-formed file URL appends to the log (mode=a) instead of replacing it. */
bool fv_transport_appends(const char *url);

/* Address of the server that a well-formed tcpq URL names. FOVEA_ERROR_SYSTEM: its name is not
 * known. */
enum fovea_status fv_transport_server(const char *url, struct sockaddr_in *address,
                                      struct fovea_error *error);

/* Is there a route to the group, a server that answers within 2 s? Opening a log shows the rest.
 * FOVEA_ERROR_SYSTEM: no, and `error` holds what mends it. */
enum fovea_status fv_transport_reachable(const char *url, struct fovea_error *error);

/* The URL with the time-to-live, unless it states one. */
void fv_transport_url_complete(const char *url, uint32_t ttl,
                               char complete[FV_TRANSPORT_URL_BYTES]);

#endif
