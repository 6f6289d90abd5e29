/* What requests of programs outside that are more than a word have in common (parameter_t,
 * settings_t, map_load_t): the gate that judges them, and the answers of those that it refuses.
 *
 * The listener's thread judges. Who is refused there, because of the sender or because one before
 * is not through, is answered at once, as far as command_gate.h lets refusals be: the encoded
 * answer goes to the loop's thread in a ring, and the next step sends it. */
#ifndef FOVEA_APP_RUN_REQUESTS_H
#define FOVEA_APP_RUN_REQUESTS_H

#include <stdbool.h>

#include "app/network/command_gate.h"
#include "app/network/feed.h"
#include "app/network/receiver.h"
#include "app/network/transport.h"
#include "base/ring.h"
#include "message/message.h"

enum { FV_REQUESTS_ANSWER_BYTES = 1536, FV_REQUESTS_ANSWERS_MAX = 16 };

struct fv_requests {
    struct fv_command_gate gate;
    int64_t run_id;
    struct fv_ring ring; /* of struct fv_requests_answer, from the listener to the loop */
    void *memory;
};

/* FOVEA_ERROR_MEMORY. Init-only. */
enum fovea_status fv_requests_open(struct fv_requests *requests,
                                   const struct fv_command_rules *rules, struct fovea_error *error);
void fv_requests_close(struct fv_requests *requests);

/* ---- the listener's -------------------------------------------------------------------------- */

enum fv_request_verdict { FV_REQUEST_TAKEN, FV_REQUEST_REFUSED, FV_REQUEST_IGNORED };

/* Judge a decoded request, whose members of these names say who sent it, and count it. `allowed`:
 * the network may send its kind. `room`: it could be taken now. `*reason`: of a refused one, which
 * is to be answered; an ignored one is not. */
#define fv_requests_judge(requests, request, received, allowed, room, reason)                      \
    fv_requests_judge_claim(requests,                                                              \
                            &(struct fv_command_claim){(received)->data, (received)->bytes,        \
                                                       (received)->from_host, (allowed),           \
                                                       (request)->run_id, (request)->sender,       \
                                                       (request)->counter, (request)->mac},        \
                            (request)->id, (room), (reason))
enum fv_request_verdict fv_requests_judge_claim(struct fv_requests *requests,
                                                const struct fv_command_claim *claim, int64_t id,
                                                bool room, const char **reason);

/* Hand over the encoded answer to one that is refused: of at most FV_REQUESTS_ANSWER_BYTES. With
 * FV_REQUESTS_ANSWERS_MAX that wait, it is lost. */
void fv_requests_answer(struct fv_requests *requests, const char *channel, const uint8_t *data,
                        int bytes);

/* ---- the loop's ------------------------------------------------------------------------------ */

/* Send what is there. Wait-free. */
void fv_requests_step(struct fv_requests *requests, struct fv_transport *transport,
                      struct fv_feed *feed);

#endif
