#include "app/watch/pairs.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "message/fields.h"

#include "fovea_lockstep_t.h"

/* A message that waits for the other run's. */
struct held {
    struct held *next;
    int64_t iteration, stamp_ns, sequence;
    uint32_t bytes;
    uint8_t data[];
};

struct run {
    struct held *first, **end; /* in the order of iterations */
    uint64_t count;            /* that are held */
    size_t bytes;
    int64_t heard;   /* the last iteration; -1: none */
    uint64_t lacked; /* iterations of the other one that this one did not send */
    uint64_t left;   /* that were not kept */
    bool again;      /* it began anew */
};

struct fv_pairs {
    size_t bytes_max;
    uint64_t iterations_max; /* 0: none */
    int64_t last;            /* the iteration that was compared last; -1: none */
    struct run runs[2];
    struct fv_compared found;
};

struct fv_pairs *fv_pairs_open(size_t bytes_max, uint64_t iterations)
{
    struct fv_pairs *pairs = calloc(1, sizeof *pairs);
    if (pairs == NULL) return NULL;
    pairs->bytes_max = bytes_max;
    pairs->iterations_max = iterations;
    pairs->last = -1;
    for (int i = 0; i < 2; i++) {
        pairs->runs[i].end = &pairs->runs[i].first;
        pairs->runs[i].heard = -1;
    }
    return pairs;
}

static void drop_first(struct run *run)
{
    struct held *held = run->first;
    run->first = held->next;
    if (run->first == NULL) run->end = &run->first;
    run->count--;
    run->bytes -= sizeof *held + held->bytes;
    free(held);
}

void fv_pairs_close(struct fv_pairs *pairs)
{
    if (pairs == NULL) return;
    for (int i = 0; i < 2; i++)
        while (pairs->runs[i].first != NULL)
            drop_first(&pairs->runs[i]);
    free(pairs);
}

bool fv_pairs_done(const struct fv_pairs *pairs)
{
    return pairs->found.different || pairs->runs[0].again || pairs->runs[1].again ||
           (pairs->iterations_max > 0 && pairs->found.iterations >= pairs->iterations_max);
}

/* Keep it behind those that wait. Without room it is left: what is kept are the earliest. */
static void hold(struct fv_pairs *pairs, struct run *run, const struct held *head,
                 const uint8_t *data)
{
    struct held *held = run->bytes + sizeof *held + head->bytes <= pairs->bytes_max
                            ? malloc(sizeof *held + head->bytes)
                            : NULL;
    if (held == NULL) {
        run->left++;
        return;
    }
    *held = *head;
    memcpy(held->data, data, head->bytes);
    *run->end = held;
    run->end = &held->next;
    run->count++;
    run->bytes += sizeof *held + held->bytes;
}

static void compare_two(struct fv_pairs *pairs, const struct held *a, const struct held *b)
{
    struct fv_compared *found = &pairs->found;
    if (a->stamp_ns != b->stamp_ns)
        snprintf(found->inputs, sizeof found->inputs,
                 "stamp.time_ns: found %" PRId64 ", expected %" PRId64, b->stamp_ns, a->stamp_ns);
    found->different = !fv_compare_lockstep(a->data, a->bytes, b->data, b->bytes, found) ||
                       a->stamp_ns != b->stamp_ns;
    if (found->different) {
        found->iteration = (uint64_t)a->iteration;
        found->sequence = a->sequence;
        found->stamp_ns = a->stamp_ns;
        found->unseen = (uint64_t)(a->iteration - pairs->last - 1);
    } else {
        found->iterations++;
        found->hashed++;
    }
    pairs->last = a->iteration;
}

/* Compare what both have. What one alone has before that, the other left out. */
static void compare_held(struct fv_pairs *pairs)
{
    struct run *a = &pairs->runs[0], *b = &pairs->runs[1];
    while (a->first != NULL && b->first != NULL && !fv_pairs_done(pairs)) {
        const int64_t ahead = a->first->iteration - b->first->iteration;
        if (ahead == 0) compare_two(pairs, a->first, b->first);
        a->lacked += ahead > 0;
        b->lacked += ahead < 0;
        if (ahead <= 0) drop_first(a);
        if (ahead >= 0) drop_first(b);
    }
}

void fv_pairs_take(struct fv_pairs *pairs, int run, const uint8_t *data, size_t bytes)
{
    struct run *own = &pairs->runs[run];
    const char *problem;
    size_t at;
    fovea_lockstep_t message;
    if (fv_pairs_done(pairs) || bytes > INT32_MAX ||
        !fv_message_check("fovea.lockstep_t", data, bytes, &problem, &at) ||
        fovea_lockstep_t_decode(data, 0, (int)bytes, &message) < 0)
        return;
    const struct held head = {.iteration = message.iteration,
                              .stamp_ns = message.stamp.time_ns,
                              .sequence = message.stamp.sequence,
                              .bytes = (uint32_t)bytes};
    fovea_lockstep_t_decode_cleanup(&message);
    own->again = head.iteration < own->heard;
    if (head.iteration <= own->heard || head.iteration < 0) return; /* by two ways, or again */
    own->heard = head.iteration;
    hold(pairs, own, &head, data);
    compare_held(pairs);
}

/* ---- words ----------------------------------------------------------------------------------- */

/* The run that is ahead, if any: one of them at most has what waits. */
static int ahead_of(const struct run runs[2])
{
    return runs[1].count > 0 ? 1 : 0;
}

/* Why not all was compared; "" where all was. */
static void tell_lack(const struct run runs[2], char *const names[2], bool silent, char *text,
                      size_t capacity)
{
    const int again = runs[1].again ? 1 : 0, fast = runs[1].left > runs[0].left ? 1 : 0,
              ahead = ahead_of(runs);
    const uint64_t lacked = runs[0].lacked + runs[1].lacked;
    /* The last one of a run that has ended may be lost without harm. */
    const uint64_t awaited = silent && runs[ahead].count > 1 ? runs[ahead].count : 0;
    const int quiet = lacked == 0 ? 1 - ahead : runs[1].lacked > runs[0].lacked;
    if (runs[again].again)
        snprintf(text, capacity, "%.100s began again after its iteration %" PRId64, names[again],
                 runs[again].heard);
    else if (runs[fast].left > 0)
        snprintf(text, capacity,
                 "%" PRIu64 " were not compared, since %.100s was too far ahead to keep them",
                 runs[fast].left, names[fast]);
    else if (lacked + awaited > 0)
        snprintf(text, capacity, "%" PRIu64 " were not compared, since %.100s did not send them",
                 lacked + awaited, names[quiet]);
}

struct fv_compared fv_pairs_found(const struct fv_pairs *pairs, char *const names[2], bool silent)
{
    struct fv_compared found = pairs->found;
    const int ahead = ahead_of(pairs->runs);
    const uint64_t awaited = pairs->runs[ahead].count;
    if (found.different) return found;
    tell_lack(pairs->runs, names, silent, found.ended, sizeof found.ended);
    found.incomplete = found.ended[0] != '\0';
    if (!found.incomplete && !silent && awaited > 0 && !fv_pairs_done(pairs))
        snprintf(found.ended, sizeof found.ended,
                 "%" PRIu64 " more of %.80s, to which %.80s had not come", awaited, names[ahead],
                 names[1 - ahead]);
    return found;
}
