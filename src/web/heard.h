/* A robot that is heard over LCM, in place of a feed: every message that the page shows, and as
 * pictures its previews, at their rate and size. Received by our own receiver, which checks each
 * message as its type before it is taken (app/network/receiver.h); bounded as that is. Nothing is
 * sent. One thread. */
#ifndef FOVEA_WEB_HEARD_H
#define FOVEA_WEB_HEARD_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/receiver.h"
#include "web/relay.h"

struct fv_web_heard {
    struct fv_web_relay *relay;
    struct fv_receiver *receiver;
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    bool watched;
    int64_t run_id;   /* of the last RUN; 0: none */
    int64_t heard_ns; /* last message; 0: none, or the robot is silent */
};

/* Hear the robot whose channels begin with `prefix`; `listen` as the receiver has it.
 * FOVEA_ERROR_INPUT: the URL, `listen` or `prefix` is wrong, or nothing can be heard. Init-only. */
enum fovea_status fv_web_heard_open(struct fv_web_heard *heard, struct fv_web_relay *relay,
                                    const char *url, const char *listen, const char *prefix,
                                    struct fovea_error *error);
void fv_web_heard_close(struct fv_web_heard *heard);

#endif
