/* Where the sending thread sends to: one outlet per kind of URL. Used by that thread alone; no call
 * but a file's write waits. */
#ifndef FOVEA_APP_NETWORK_SENDER_OUTLET_H
#define FOVEA_APP_NETWORK_SENDER_OUTLET_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/transport.h"

enum fv_sender_class {
    FV_SENDER_STATE = 0,
    FV_SENDER_REPEATED, /* one message, without a ring */
    FV_SENDER_WATCHER,  /* state of the watching thread */
    FV_SENDER_SENSOR,   /* poses between frames, of the sensor's thread */
    FV_SENDER_OBJECTS,  /* bulk from here on */
    FV_SENDER_FEATURES,
    FV_SENDER_PREVIEWS,
    FV_SENDER_CLASSES
};

/* What came of a message: one of these, or enum fv_transport_drop. */
enum { FV_OUTLET_SENT = -1, FV_OUTLET_BUSY = -2 };

struct fv_outgoing {
    enum fv_sender_class class;
    const char *channel;
    const uint8_t *data;
    uint32_t bytes;
};

struct fv_outlet {
    bool paced; /* by sender_link.h: nothing else says when the link is full */
    /* What a message counts as that is dropped while nothing has been taken for a second. */
    enum fv_transport_drop stalled;
    /* Try to send. FV_OUTLET_BUSY: try again with the same message later. */
    int (*send)(struct fv_outlet *outlet, const struct fv_outgoing *message, int64_t now_ns);
    /* A part of the class's message has gone: it must not be exchanged for another one. */
    bool (*begun)(const struct fv_outlet *outlet, enum fv_sender_class class);
    /* Nothing of the classes from FV_SENDER_OBJECTS on is on this host any more. */
    bool (*bulk_left)(struct fv_outlet *outlet);
    /* Free it. False: what was sent may not last; one line has said so. */
    bool (*close)(struct fv_outlet *outlet);
};

/* Each makes one for a checked URL of its kind, with no more than the open() of a log that could
 * wait. FOVEA_ERROR_SYSTEM: `error` names what the system refused. Init-only. */
enum fovea_status fv_outlet_udp(const char *url, struct fv_outlet **outlet,
                                struct fovea_error *error);
enum fovea_status fv_outlet_server(const char *url, struct fv_outlet **outlet,
                                   struct fovea_error *error);
enum fovea_status fv_outlet_file(const char *url, struct fv_outlet **outlet,
                                 struct fovea_error *error);
/* memq: nobody in this program listens, so messages end here. */
enum fovea_status fv_outlet_nowhere(struct fv_outlet **outlet, struct fovea_error *error);

#endif
