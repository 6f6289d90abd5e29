/* The message by which a run says who it is (fovea.run_t on <prefix>_RUN), and noticing that
 * another one sends on the same prefix. An input of the run: made by the application, kept in a
 * recording, no part of results. */
#ifndef FOVEA_APP_NETWORK_IDENTITY_H
#define FOVEA_APP_NETWORK_IDENTITY_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/receiver.h"
#include "fovea/status.h"
#include "message/message.h"

enum { FV_IDENTITY_BYTES = 512, FV_IDENTITIES_KNOWN = 8 };

struct fv_identity {
    int64_t run_id; /* 0: there is none */
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    uint32_t bytes;
    uint8_t data[FV_IDENTITY_BYTES]; /* encoded fovea.run_t */
};

/* Of this process. Init-only. */
void fv_identity_make(struct fv_identity *identity, const char *prefix, int64_t run_id);

/* Take one from a recording. False: no well-formed fovea.run_t, or too long; identity->run_id is 0
 * then. Init-only. */
bool fv_identity_read(struct fv_identity *identity, const uint8_t *data, uint32_t bytes);

/* The other runs that were heard; zeroed, with `own` set. Of the thread that listens. */
struct fv_identity_watch {
    int64_t own, known[FV_IDENTITIES_KNOWN];
    uint32_t others; /* heard so far */
};

/* A row of the receiver's table that watches. */
struct fv_receiver_channel fv_identity_row(const char *prefix, struct fv_identity_watch *watch);

#endif
