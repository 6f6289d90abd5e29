#include "app/run/requests.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"
#include "support/aligned.h"

struct fv_requests_answer {
    uint32_t bytes;
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    uint8_t data[FV_REQUESTS_ANSWER_BYTES];
};

enum fovea_status fv_requests_open(struct fv_requests *requests,
                                   const struct fv_command_rules *rules, struct fovea_error *error)
{
    const size_t bytes = (FV_REQUESTS_ANSWERS_MAX + 1) * sizeof(struct fv_requests_answer);
    requests->memory = fv_aligned_zeroed(bytes);
    if (requests->memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for requests");
    fv_ring_init(&requests->ring, requests->memory, bytes);
    fv_command_gate_init(&requests->gate, rules);
    requests->run_id = rules->run_id;
    return FOVEA_OK;
}

void fv_requests_close(struct fv_requests *requests)
{
    free(requests->memory);
    requests->memory = NULL;
}

/* ---- the listener's -------------------------------------------------------------------------- */

enum fv_request_verdict fv_requests_judge_claim(struct fv_requests *requests,
                                                const struct fv_command_claim *claim, int64_t id,
                                                bool room, const char **reason)
{
    struct fv_command_gate *gate = &requests->gate;
    struct fv_judged_command judged = {
        .verdict = fv_command_gate_claim(gate, claim), .id = id, .sender = claim->sender};
    if (judged.verdict == FV_COMMAND_TAKEN && !room) judged.verdict = FV_COMMAND_BUSY;
    fv_command_gate_count(gate, judged.verdict);
    *reason = judged.verdict == FV_COMMAND_BUSY ? "the request before this one is not through"
                                                : fv_command_verdict_reason(judged.verdict);
    if (judged.verdict == FV_COMMAND_TAKEN) return FV_REQUEST_TAKEN;
    return fv_command_gate_answers(gate, &judged, fv_clock_ns(CLOCK_MONOTONIC))
               ? FV_REQUEST_REFUSED
               : FV_REQUEST_IGNORED;
}

void fv_requests_answer(struct fv_requests *requests, const char *channel, const uint8_t *data,
                        int bytes)
{
    struct fv_requests_answer *answer = NULL;
    if (bytes > 0 && bytes <= FV_REQUESTS_ANSWER_BYTES)
        answer = (void *)fv_ring_reserve(&requests->ring, sizeof *answer);
    if (answer == NULL) return;
    answer->bytes = (uint32_t)bytes;
    snprintf(answer->channel, sizeof answer->channel, "%s", channel);
    memcpy(answer->data, data, (size_t)bytes);
    fv_ring_commit(&requests->ring, sizeof *answer);
}

/* ---- the loop's ------------------------------------------------------------------------------ */

void fv_requests_step(struct fv_requests *requests, struct fv_transport *transport,
                      struct fv_feed *feed)
{
    size_t bytes;
    if (requests->memory == NULL) return; /* nothing is heard */
    for (int i = 0; i < FV_REQUESTS_ANSWERS_MAX; i++) {
        const struct fv_requests_answer *answer =
            (const void *)fv_ring_peek(&requests->ring, &bytes);
        if (answer == NULL) return;
        const struct fovea_message out = {answer->channel, answer->data, answer->bytes, true};
        fv_transport_put(transport, &out);
        fv_feed_put(feed, &out);
        fv_ring_release(&requests->ring, sizeof *answer);
    }
}
