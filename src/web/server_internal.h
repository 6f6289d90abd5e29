/* What the halves of the server share: server.c with the websockets, server_http.c. */
#ifndef FOVEA_WEB_SERVER_INTERNAL_H
#define FOVEA_WEB_SERVER_INTERNAL_H

#include <arpa/inet.h>
#include <stdatomic.h>

#include <libwebsockets.h>

#include "web/assets.h"
#include "web/client.h"
#include "web/foxglove.h"
#include "web/server.h"

enum {
    FV_WEB_URI_BYTES = 64,
    FV_WEB_BODY_BYTES = 128,
    FV_WEB_COOKIE_BYTES = 1024,
    FV_WEB_HEADERS_BYTES = 4096 /* of a request, all together */
};

/* A request, from its headers to the end of its answer. */
struct fv_web_request {
    bool login;     /* a token comes in the body */
    char *settings; /* of malloc: they come in the body; NULL: none */
    size_t settings_bytes;
    bool calibrates;                  /* what comes there is a board, or the end of a calibration */
    const struct fv_web_relay *relay; /* of the robot that they are for */
    const char *refusal; /* the answer when the body, which nobody reads, is through; NULL: none */
    int refusal_status;
    char address[48];
    char body[FV_WEB_BODY_BYTES];
    size_t body_bytes;
    const uint8_t *data; /* of the answer that is being sent */
    uint64_t left;
    bool of_file; /* the answer is read from `file` */
    int file;
    bool head;     /* HEAD: an answer without its body */
    uint8_t *made; /* of malloc, where the client takes no compression */
};

struct fv_web_server {
    struct fv_web_setup setup;
    struct lws_context *context;
    struct lws_vhost *vhost;
    uint16_t port;
    atomic_bool stopped;
    lws_sorted_usec_list_t timer;
    bool changed;    /* a store, since the pages were last asked to take more */
    int64_t sent_ns; /* when that was */
    struct fv_web_tries tries;
    struct fv_web_place_of_client {
        struct lws *socket; /* NULL: free */
        struct fv_web_client client;
        int64_t sent_ns; /* last */
    } clients[FV_WEB_CLIENTS_MAX];
    struct fv_web_place_of_foxglove {
        struct lws *socket; /* NULL: free */
        uint32_t robot;     /* that it is shown */
        struct fv_foxglove_client client;
        uint8_t words[FV_FOXGLOVE_WORDS_BYTES]; /* that are coming */
        size_t words_bytes;
    } foxglove[FV_WEB_FOXGLOVE_MAX];
    struct fv_web_foxglove_robot {
        struct fv_web_server *server;
        struct fv_foxglove_views views;
        struct fv_foxglove_parameters parameters;
        struct fv_foxglove_shown shown;
    } * foxglove_robots;          /* what Foxglove's clients are shown of each robot: of malloc */
    struct fv_foxglove_said said; /* by one of them: no place for it is on the stack */
    int64_t session;              /* of this start of the server */
    uint8_t packet[LWS_PRE + FV_WEB_PACKET_BYTES_MAX];
};

/* Why nothing can be sent to the run of this relay for somebody of this role; NULL: it can. */
const char *fv_web_server_refusal(const struct fv_web_server *server,
                                  const struct fv_web_relay *relay, enum fv_web_role role);

/* A header of a request, as text. False: there is none, or it does not fit. */
bool fv_web_server_header(struct lws *wsi, enum lws_token_indexes which, char *to, size_t bytes);
/* The addresses of both ends. */
void fv_web_server_addresses(struct lws *wsi, char local[INET_ADDRSTRLEN],
                             char remote[INET_ADDRSTRLEN]);
/* Whether the address of a new connection has all that one may have, so that one host alone does
 * not keep the others out. All programs of this host have the loopback's address, so there is no
 * such bound for it. */
bool fv_web_server_is_crowd(const struct lws_filter_network_conn_args *arrived);
/* Cookies do not know ports: the server's port is in the name. */
void fv_web_server_cookie_name(const struct fv_web_server *server, char name[24]);

/* Of the connection whose headers are there: 200, or the status to refuse it with. */
int fv_web_server_judge(struct fv_web_server *server, struct lws *wsi, bool of_page,
                        enum fv_web_role *role);

/* The same of one that speaks Foxglove's protocol. Wrong tokens are limited as at the login. */
int fv_web_server_judge_foxglove(struct fv_web_server *server, struct lws *wsi,
                                 enum fv_web_role *role);
/* Refuse a websocket before it opens. Returns what the callback returns. */
int fv_web_server_refuse(struct fv_web_server *server, struct lws *wsi, int status);

/* The number of the robot that the address names by robot=N; 0: it names none. */
uint32_t fv_web_server_robot(struct lws *wsi);
/* Whether commands can be sent to this robot at all. */
bool fv_web_server_is_commanded(const struct fv_web_server *server, uint32_t robot);

/* Only what is new waits behind what is being sent, not what was to be sent before. */
void fv_web_server_hasten(struct lws *wsi);
struct fv_web_link {
    uint64_t bytes_per_s; /* that it carries; 0: not known, or more than there was to send */
    bool behind; /* more is on its way than it carries there and back: what is written now waits */
    bool queued; /* the way there and back takes longer than it did */
};
void fv_web_server_link(struct lws *wsi, struct fv_web_link *link);

/* Make what Foxglove's clients are shown, of each robot; false: no memory. */
bool fv_web_foxglove_open(struct fv_web_server *server);
void fv_web_foxglove_close(struct fv_web_server *server);
/* Send what is to be asked of the runs. */
void fv_web_foxglove_tick(struct fv_web_server *server);
/* Add the cameras that these clients look at to those of each relay. Whether there is a client. */
bool fv_web_foxglove_wish(struct fv_web_server *server);
/* There is something new to send. */
void fv_web_foxglove_changed(struct fv_web_server *server);

/* What a protocol of websockets does: of a request to open one, of one that is open, where more can
 * be sent, with what comes, and at its end. But for the last, each returns what the callback does.
 */
struct fv_web_protocol {
    int (*judge)(struct fv_web_server *server, struct lws *wsi);
    int (*arrive)(struct fv_web_server *server, struct lws *wsi);
    int (*send_next)(struct fv_web_server *server, struct lws *wsi);
    int (*hear)(struct fv_web_server *server, struct lws *wsi, const void *words, size_t length);
    void (*leave)(struct fv_web_server *server, struct lws *wsi);
};
int fv_web_websocket(const struct fv_web_protocol *protocol, struct lws *wsi,
                     enum lws_callback_reasons reason, void *in, size_t length);

/* Callbacks of libwebsockets, after lws_callback_function. */
int fv_web_foxglove(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                    size_t length);
int fv_web_http(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                size_t length);

#endif
