/* The server of the page: HTTP/1.1 and websockets by libwebsockets, in one thread,
 * over TLS (1.2 or later) where there is a certificate; and of Foxglove's protocol (foxglove.h) at
 * the same port.
 *
 * A request is answered only when its Host header names this server (access.h); a websocket is
 * opened only for our own page's origin; one of Foxglove's protocol also for the origins that the
 * caller names, and for programs that are no browser's page and state none. Where there are tokens,
 * everything but the login page needs one, in a cookie; of Foxglove's clients, which may have none,
 * in the header Authorization or in the query of the address, too. Connections, those of one
 * address, headers and what a page may say are bounded. */
#ifndef FOVEA_WEB_SERVER_H
#define FOVEA_WEB_SERVER_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/status.h"
#include "web/access.h"
#include "web/calibration.h"
#include "web/certificate.h"
#include "web/command.h"
#include "web/pages.h"
#include "web/relay.h"
#include "web/robots.h"

enum {
    FV_WEB_CLIENTS_MAX = 24,
    FV_WEB_FOXGLOVE_MAX = 8, /* clients of Foxglove's protocol */
    FV_WEB_CONNECTIONS_MAX = 96,
    FV_WEB_CONNECTIONS_OF_ADDRESS = 32 /* of another host */
};

struct fv_web_setup {
    const char *address; /* an IPv4 address of this host; 0.0.0.0: all */
    uint16_t port;       /* 0: one that is free */
    const char *const *names;
    int name_count;
    const char *origins; /* that Foxglove's clients may come from, spaces between; NULL: none */
    struct fv_web_certificate certificate; /* that was checked; its files stay; none: HTTP */
    const struct fv_web_tokens *tokens;    /* NULL: everybody who reaches the port may do all */
    /* Each page asks for one of them; the first is shown until then. NULL: as `pages`. */
    struct fv_web_robots *robots;
    const char *recordings; /* folder of recordings that can be downloaded; NULL: none */
    struct fv_web_calibration *calibration; /* of their cameras */
    struct fv_web_commander *commander;
    /* The page of another program; NULL: that of a run, which the two above are for. */
    const struct fv_web_pages_setup *pages;
};

struct fv_web_server;

/* Listen. FOVEA_ERROR_INPUT: not at this address and port. Init-only. */
enum fovea_status fv_web_server_open(const struct fv_web_setup *setup,
                                     struct fv_web_server **server, struct fovea_error *error);
uint16_t fv_web_server_port(const struct fv_web_server *server);
/* Say behind the name of the program, "fovea-web: " or "", that what it shows can be read on the
 * network, where that is so. */
void fv_web_server_warn(const struct fv_web_server *server, const char *program);

/* Serve until fv_web_server_stop. False: the server failed. */
bool fv_web_server_run(struct fv_web_server *server);
/* From a signal handler, too. */
void fv_web_server_stop(struct fv_web_server *server);

void fv_web_server_close(struct fv_web_server *server);

#endif
