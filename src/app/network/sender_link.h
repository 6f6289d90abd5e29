/* How much a link takes, from what it took: sizes and times in, a budget out. No clock, no socket.
 *
 * The budget is the bytes that the link takes in 60 ms, at most one datagram: with what a queue
 * lets pass at once (a burst), and what state there is, that keeps the link busy for about 80 ms.
 * Bulk messages (all but state) are let go in batches: as many as fit the budget, then none until
 * the last byte has left the host. The time that this took corrects the budget: bytes * 60 ms /
 * time, at most halved, or raised by a quarter. So state never waits behind more than about 80 ms
 * of bulk.
 *
 * At first the link is unknown and taken for a fast one: the budget may double, and a message of
 * any length go alone. Only times at which a batch was seen on the host say that a link is slow: a
 * sender that had no processor proves nothing. From then on the budget is a hard limit, until it is
 * a whole datagram again. */
#ifndef FOVEA_APP_NETWORK_SENDER_LINK_H
#define FOVEA_APP_NETWORK_SENDER_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "message/message.h"

enum {
    FV_LINK_DATAGRAM_BYTES = FV_MESSAGE_PACKET_BYTES, /* channel and LCM header included */
    FV_LINK_FIRST_BYTES = 16000,
    FV_LINK_LEAST_BYTES = 2000
};

struct fv_link {
    size_t budget;             /* bytes */
    bool slow;                 /* the budget is a hard limit */
    size_t batch;              /* bytes let go and not yet seen to have left */
    int64_t batch_ns, busy_ns; /* when it began; when it was last seen not to have left */
    int64_t grown_ns;          /* when the budget was last changed */
};

enum fv_link_answer {
    FV_LINK_GO,
    FV_LINK_WAIT,    /* until the batch has left */
    FV_LINK_TOO_LONG /* for this link as it is now */
};

void fv_link_init(struct fv_link *link, int64_t now_ns);

/* May a bulk message of `bytes` go now? */
enum fv_link_answer fv_link_ask(const struct fv_link *link, size_t bytes);

/* It went. */
void fv_link_sent(struct fv_link *link, size_t bytes, int64_t now_ns);

/* `left`: nothing of the bulk is on the host any more. To be called often, every millisecond or so.
 */
void fv_link_observe(struct fv_link *link, bool left, int64_t now_ns);

/* The interface's queue had no room. */
void fv_link_refused(struct fv_link *link, int64_t now_ns);

#endif
