#include "app/network/sender_link.h"

static const int64_t span_ns = 60000000;     /* 80 less what a queue may pass at once, a burst */
static const int64_t growth_ns = 1000000000; /* a budget that nothing tries grows by a tenth */

static size_t clamp(size_t bytes, size_t least, size_t most)
{
    return bytes < least ? least : bytes > most ? most : bytes;
}

static void budget_set(struct fv_link *link, size_t bytes, int64_t now_ns)
{
    link->budget = clamp(bytes, FV_LINK_LEAST_BYTES, FV_LINK_DATAGRAM_BYTES);
    link->grown_ns = now_ns;
    if (link->budget == FV_LINK_DATAGRAM_BYTES) link->slow = false;
}

void fv_link_init(struct fv_link *link, int64_t now_ns)
{
    *link = (struct fv_link){.budget = FV_LINK_FIRST_BYTES, .grown_ns = now_ns};
}

enum fv_link_answer fv_link_ask(const struct fv_link *link, size_t bytes)
{
    const bool any = link->budget == FV_LINK_DATAGRAM_BYTES; /* longer ones go in fragments */
    if (link->batch > 0)
        return link->batch + bytes <= link->budget || any ? FV_LINK_GO : FV_LINK_WAIT;
    return link->slow && bytes > link->budget ? FV_LINK_TOO_LONG : FV_LINK_GO;
}

void fv_link_sent(struct fv_link *link, size_t bytes, int64_t now_ns)
{
    if (link->batch == 0) link->batch_ns = link->busy_ns = now_ns;
    link->batch += bytes;
}

static size_t in_span(size_t bytes, int64_t took_ns)
{
    if (took_ns <= 0) return SIZE_MAX;
    const double taken = (double)bytes * (double)span_ns / (double)took_ns;
    return taken < 1e9 ? (size_t)taken : SIZE_MAX;
}

/* What a batch says that has left: at the earliest after busy_ns, at the latest now. */
static void learn(struct fv_link *link, size_t batch, int64_t now_ns)
{
    const size_t most = in_span(batch, link->busy_ns - link->batch_ns);
    const size_t least = in_span(batch, now_ns - link->batch_ns);
    if (most < link->budget) {
        link->slow = true;
        budget_set(link, clamp(most, link->budget / 2, link->budget), now_ns);
    } else if (batch > link->budget / 4 * 3 && least > link->budget) {
        const size_t raised = link->slow ? link->budget + link->budget / 4 : 2 * link->budget;
        budget_set(link, clamp(least, link->budget, raised), now_ns);
    }
}

void fv_link_observe(struct fv_link *link, bool left, int64_t now_ns)
{
    if (link->batch == 0) {
        if (now_ns - link->grown_ns >= growth_ns)
            budget_set(link, link->budget + link->budget / 10, now_ns);
    } else if (!left) {
        link->busy_ns = now_ns;
    } else {
        const size_t batch = link->batch;
        link->batch = 0;
        learn(link, batch, now_ns);
    }
}

void fv_link_refused(struct fv_link *link, int64_t now_ns)
{
    link->slow = true;
    budget_set(link, link->budget / 2, now_ns);
}
