/* What the halves of the server share: server.c with the websockets, server_http.c. */
#ifndef FOVEA_WEB_SERVER_INTERNAL_H
#define FOVEA_WEB_SERVER_INTERNAL_H

#include <stdatomic.h>

#include <libwebsockets.h>

#include "web/assets.h"
#include "web/client.h"
#include "web/server.h"

enum { FV_WEB_URI_BYTES = 64, FV_WEB_BODY_BYTES = 128, FV_WEB_COOKIE_BYTES = 1024 };

/* A request, from its headers to the end of its answer. */
struct fv_web_request {
    bool login;     /* a token comes in the body */
    char *settings; /* of malloc: they come in the body; NULL: none */
    size_t settings_bytes;
    const struct fv_web_relay *relay; /* of the robot that they are for */
    const char *refusal; /* the answer when the body, which nobody reads, is through; NULL: none */
    int refusal_status;
    char address[48];
    char body[FV_WEB_BODY_BYTES];
    size_t body_bytes;
    const uint8_t *data; /* of the answer that is being sent */
    size_t left;
    bool head;     /* HEAD: an answer without its body */
    uint8_t *made; /* of malloc, where the client takes no compression */
};

struct fv_web_server {
    struct fv_web_setup setup;
    struct fv_web_robots alone; /* where there is one */
    struct lws_context *context;
    struct lws_vhost *vhost;
    uint16_t port;
    atomic_bool stopped;
    lws_sorted_usec_list_t timer;
    bool changed;    /* the store, since the pages were last told */
    int64_t sent_ns; /* when that was */
    struct fv_web_tries tries;
    struct fv_web_place_of_client {
        struct lws *socket; /* NULL: free */
        struct fv_web_client client;
        int64_t sent_ns; /* last */
    } clients[FV_WEB_CLIENTS_MAX];
    uint8_t packet[LWS_PRE + FV_WEB_PACKET_BYTES_MAX];
};

/* Why nothing can be sent to the run of this relay for somebody of this role; NULL: it can. */
const char *fv_web_server_refusal(const struct fv_web_server *server,
                                  const struct fv_web_relay *relay, enum fv_web_role role);

/* Of the connection whose headers are there: 200, or the status to refuse it with. */
int fv_web_server_judge(struct fv_web_server *server, struct lws *wsi, bool of_page,
                        enum fv_web_role *role);

/* Callbacks of libwebsockets, after lws_callback_function. */
int fv_web_http(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                size_t length);

#endif
