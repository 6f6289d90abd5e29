/* One client of Foxglove's websocket protocol (github.com/foxglove/ws-protocol, docs/spec.md;
 * subprotocols foxglove.sdk.v1 and foxglove.websocket.v1, which differ in name): what it gets next,
 * what it says. No sockets here (server_foxglove.c).
 *
 * Each frame to it is one message: serverInfo, advertise, status, parameterValues as JSON; time and
 * messages as bytes. Like a page, a client costs numbers alone: it gets the newest of each channel
 * that it subscribed to, and who is slow gets fewer. Pictures fall in quality before they are left
 * out; their size stays, so that annotations fit.
 *
 * Keys of the configuration are its parameters, for who may operate: values are what the run
 * answers. What is refused is said in a `status` that names key and reason. */
#ifndef FOVEA_WEB_FOXGLOVE_H
#define FOVEA_WEB_FOXGLOVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "web/access.h"
#include "web/foxglove_hear.h"
#include "web/foxglove_parameters.h"
#include "web/foxglove_views.h"
#include "web/store.h"

enum {
    FV_FOXGLOVE_REPLIES = 8, /* that wait; one more takes the place of the oldest */
    FV_FOXGLOVE_REPLY_BYTES = 320,
    FV_FOXGLOVE_REQUESTS = 4, /* for parameters, that wait */
    FV_FOXGLOVE_SESSION_BYTES = 24
};

struct fv_foxglove_client {
    enum fv_web_role role;
    bool operates; /* it may ask for parameters and set them */
    bool greeted;
    char session[FV_FOXGLOVE_SESSION_BYTES]; /* of the server */
    uint32_t epoch, first_id, advertised;    /* of the views' channels, as they were sent */
    struct {
        bool is;
        uint32_t id;
    } subscribed[FV_FOXGLOVE_CHANNELS_MAX];
    uint32_t versions[FV_FOXGLOVE_VIEWS_MAX]; /* of views that were sent */
    uint32_t turns[2], smalls; /* who is next, of large ones and small ones; small ones in a row */
    uint64_t bytes_per_s;      /* that its link carries, the caller's; 0: not known */
    int64_t large_ns;          /* when it may get a large one again */
    uint64_t log_sent;
    int64_t time_ns;                        /* that was sent last */
    uint32_t pictures[FOVEA_CAMERAS_MAX];   /* numbers of those that were sent last */
    int quality;                            /* 0 is the best */
    int64_t quality_ns, lost_ns, better_ns; /* changed; a picture was lost; patience */

    struct {
        int level;
        char text[FV_FOXGLOVE_REPLY_BYTES];
    } replies[FV_FOXGLOVE_REPLIES]; /* a ring */
    uint32_t reply_first, reply_count;

    struct fv_foxglove_request {
        bool used, sets;
        char id[FV_FOXGLOVE_ID_BYTES];
        bool keys[FV_SETTINGS_KEYS_MAX], waits[FV_SETTINGS_KEYS_MAX];
        int64_t sent[FV_FOXGLOVE_SETS]; /* numbers of parameter_t that are not answered; 0: is */
        int64_t deadline_ns;
    } requests[FV_FOXGLOVE_REQUESTS];
    bool watched[FV_SETTINGS_KEYS_MAX];
    uint32_t watched_versions[FV_SETTINGS_KEYS_MAX];
};

/* What all clients are shown. */
struct fv_foxglove_shown {
    struct fv_web_store *store;
    struct fv_foxglove_views *views;
    struct fv_foxglove_parameters *parameters;
};

/* `session` is another one after each start of the server. */
void fv_foxglove_init(struct fv_foxglove_client *client, enum fv_web_role role, bool operates,
                      int64_t session, int64_t now_ns);

/* The cameras whose pictures it wants, as bits. */
uint32_t fv_foxglove_watches(const struct fv_foxglove_client *client,
                             const struct fv_foxglove_views *views);

/* The next message, into `to`. Returns its bytes, 0: there is nothing to send now. */
size_t fv_foxglove_next(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                        uint8_t *to, size_t capacity, int64_t now_ns, bool *text);

/* Do what a client said. `refusal`: why the run cannot be asked for it; NULL: it can. */
void fv_foxglove_do(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                    const struct fv_foxglove_said *said, const char *refusal, int64_t now_ns);

/* The run has answered. */
void fv_foxglove_answered(struct fv_foxglove_client *client,
                          const struct fv_foxglove_answer *answer);

#endif
