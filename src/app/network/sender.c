#include "app/network/sender.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "app/network/sender_link.h"
#include "app/network/sender_outlet.h"
#include "app/network/sender_preview.h"
#include "app/network/transport_url.h"
#include "base/ring.h"
#include "drivers/clock.h"
#include "drivers/thread.h"
#include "support/aligned.h"
#include "support/say.h"

enum {
    POLL_NS = 1000000,
    UDP_HEADER_BYTES = 8,
    REPEATED = 0, /* channel of the repeated message */
    THREADS,      /* and of the other threads */
    LOOP = THREADS + FV_TRANSPORT_THREADS
};

static const int64_t state_age_ns = 1000000000; /* a state that could not be sent is dropped then */
static const int64_t queue_age_ns = 100000000;  /* one that the interface's queue refused, then */
static const int64_t preview_age_ns = 1000000000; /* a preview is next then */
static const int64_t room_wait_ns = 1000000000;
static const int64_t stalled_ns = 1000000000; /* what takes nothing for so long has stalled */
static const int64_t repeat_ns = 1000000000;

/* Poses for a quarter of a second at 200 Hz, some messages of health, poses between frames for a
 * fifteenth at 1,000 Hz,
 * five messages of objects or of a network's results of the longest size, 60,000 bytes, 18
 * messages of 1,000 features. What waits longer is replaced by newer ones anyway. */
static const size_t ring_bytes[FV_SENDER_CLASSES] = {
    [FV_SENDER_STATE] = 128 << 10,    [FV_SENDER_WATCHER] = 8 << 10,
    [FV_SENDER_SENSOR] = 16 << 10,    [FV_SENDER_OBJECTS] = 320 << 10,
    [FV_SENDER_FEATURES] = 384 << 10, [FV_SENDER_PREVIEWS] = 128 << 10,
};

/* In a ring, before the data of a message; a multiple of 8 bytes in all. */
struct record {
    uint32_t size, bytes; /* with this and the padding; of the data */
    uint64_t channel;
    int64_t put_ns;
};

struct channel {
    char name[FV_TRANSPORT_CHANNEL_BYTES];
    enum fv_sender_class class;
    atomic_uint_fast64_t offered, sent, dropped[FV_TRANSPORT_DROPS];
};

struct fv_sender {
    struct fv_ring rings[FV_SENDER_CLASSES];
    void *memory[FV_SENDER_CLASSES];
    struct channel channels[FV_TRANSPORT_CHANNELS];
    atomic_uint channel_count;

    int64_t full_ns; /* the loop's: since when it finds no room; 0: it does */

    struct fv_outlet *outlet;       /* NULL: closed */
    enum fv_transport_drop stalled; /* the outlet's */
    atomic_int_fast64_t taken_ns;   /* when the outlet last took a message, or none waited for it */
    struct fv_link link;
    struct fv_preview_fit fit;
    uint8_t shrunk[FV_LINK_DATAGRAM_BYTES];
    int64_t preview_ns; /* since when one waits; 0: none does */
    bool said[FV_TRANSPORT_DROPS];

    uint8_t repeated[FV_SENDER_REPEATED_BYTES];
    uint32_t repeated_bytes;
    atomic_bool repeats;
    int64_t repeated_ns;
    bool repeat_due;

    pthread_t thread;
    atomic_bool stop, ended;
    bool joined, left_behind;
};

/* ---- channels -------------------------------------------------------------------------------- */

static bool ends_in(const char *name, const char *suffix)
{
    const size_t length = strlen(name), wanted = strlen(suffix);
    if (length < wanted || strcmp(name + length - wanted, suffix) != 0) return false;
    return length == wanted || name[length - wanted - 1] == '_';
}

static bool is_loops(enum fv_sender_class class)
{
    return class == FV_SENDER_STATE || class >= FV_SENDER_OBJECTS;
}

/* Sent late rather than never. */
static bool is_state(enum fv_sender_class class)
{
    return class == FV_SENDER_STATE || class == FV_SENDER_WATCHER;
}

static enum fv_sender_class class_of(const char *name)
{
    static const char *const states[] = {
        "POSE",           "CAMERA_STATUS",    "IMU_STATUS", "STATISTICS", "RUN",
        "COMMAND_RESULT", "PARAMETER_RESULT", "RECORDER",   "HEALTH"};
    for (size_t i = 0; i < sizeof states / sizeof states[0]; i++)
        if (ends_in(name, states[i])) return FV_SENDER_STATE;
    if (ends_in(name, "FEATURES")) return FV_SENDER_FEATURES;
    return ends_in(name, "PREVIEW") ? FV_SENDER_PREVIEWS : FV_SENDER_OBJECTS;
}

static void channel_name(struct channel *channel, const char *name)
{
    snprintf(channel->name, sizeof channel->name, "%s", name);
    channel->class = class_of(channel->name);
}

_Static_assert((int)FV_MESSAGE_SAMPLE + (int)LOOP <= (int)FV_TRANSPORT_CHANNELS,
               "raise FV_TRANSPORT_CHANNELS: each kind that goes out has a place");

/* The loop's: a channel is entered when it is first used. */
static uint32_t channel_find(struct fv_sender *sender, const char *name)
{
    const uint32_t count = atomic_load_explicit(&sender->channel_count, memory_order_relaxed);
    for (uint32_t i = LOOP; i < count; i++)
        if (strcmp(sender->channels[i].name, name) == 0) return i;
    if (count == FV_TRANSPORT_CHANNELS || strlen(name) >= FV_TRANSPORT_CHANNEL_BYTES)
        return FV_TRANSPORT_CHANNELS;
    channel_name(&sender->channels[count], name);
    atomic_store_explicit(&sender->channel_count, count + 1, memory_order_release);
    return count;
}

/* ---- the loop's side ------------------------------------------------------------------------- */

static void count(atomic_uint_fast64_t *counter)
{
    atomic_fetch_add_explicit(counter, 1, memory_order_relaxed);
}

/* Any thread. */
static bool stalled(const struct fv_sender *sender, int64_t now_ns)
{
    return now_ns - atomic_load_explicit(&sender->taken_ns, memory_order_relaxed) > stalled_ns;
}

static void taken(struct fv_sender *sender, int64_t now_ns)
{
    atomic_store_explicit(&sender->taken_ns, now_ns, memory_order_relaxed);
}

static void put(struct fv_sender *sender, uint32_t at, const struct fovea_message *message)
{
    struct channel *channel = &sender->channels[at];
    struct fv_ring *ring = &sender->rings[channel->class];
    const size_t size = (sizeof(struct record) + message->bytes + 7) / 8 * 8;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    count(&channel->offered);
    uint8_t *room = fv_ring_reserve(ring, size);
    if (room == NULL) {
        count(
            &channel->dropped[stalled(sender, now_ns) ? sender->stalled : FV_TRANSPORT_DROP_BUSY]);
        return;
    }
    const struct record record = {(uint32_t)size, message->bytes, at, now_ns};
    memcpy(room, &record, sizeof record);
    memcpy(room + sizeof record, message->data, message->bytes);
    fv_ring_commit(ring, size);
}

void fv_sender_put(struct fv_sender *sender, const struct fovea_message *message)
{
    const uint32_t at = channel_find(sender, message->channel);
    if (at != FV_TRANSPORT_CHANNELS) put(sender, at, message); /* else none that the runtime has */
}

void fv_sender_put_from(struct fv_sender *sender, enum fv_transport_thread thread,
                        const struct fovea_message *message)
{
    put(sender, THREADS + (uint32_t)thread, message);
}

static void sleep_ns(int64_t ns)
{
    const struct timespec pause = fv_clock_timespec(ns);
    nanosleep(&pause, NULL);
}

/* Of one of the loop's rings. */
static bool has_room(struct fv_sender *sender, enum fv_sender_class class, bool settled)
{
    struct fv_ring *ring = &sender->rings[class];
    return settled && class < FV_SENDER_FEATURES ? fv_ring_empty(ring)
                                                 : fv_ring_room(ring) >= ring_bytes[class] / 8 * 3;
}

bool fv_sender_room(struct fv_sender *sender, bool settled)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    bool room = true;
    for (int class = 0; class < FV_SENDER_CLASSES; class ++)
        room = room && (!is_loops((enum fv_sender_class) class) ||
                        has_room(sender, (enum fv_sender_class) class, settled));
    if (room) sender->full_ns = 0;
    if (!room && sender->full_ns == 0) sender->full_ns = now_ns;
    return room || now_ns - sender->full_ns > room_wait_ns;
}

/* ---- the thread ------------------------------------------------------------------------------ */

static const struct record *front_of(struct fv_sender *sender, enum fv_sender_class class,
                                     size_t *bytes)
{
    return (const struct record *)(const void *)fv_ring_peek(&sender->rings[class], bytes);
}

/* Whether a later message of the same channel waits behind this one. */
static bool newer_waits(const struct record *front, size_t bytes)
{
    const uint8_t *at = (const uint8_t *)front;
    for (size_t offset = front->size; offset < bytes;) {
        struct record record;
        memcpy(&record, at + offset, sizeof record);
        if (record.channel == front->channel) return true;
        offset += record.size;
    }
    return false;
}

static void say_once(struct fv_sender *sender, int result, const char *name)
{
    static const char *const lines[FV_TRANSPORT_DROPS] = {
        [FV_TRANSPORT_DROP_ROUTE] = "found no way to the network",
        [FV_TRANSPORT_DROP_FIREWALL] = "the system forbids it (a firewall?)",
        [FV_TRANSPORT_DROP_SERVER] = "the LCM server is away or does not read",
        [FV_TRANSPORT_DROP_FILE] = "the log cannot be written",
    };
    if (sender->said[result] || lines[result] == NULL) return;
    sender->said[result] = true;
    fv_say("%s: a message was not sent, since %s; more are counted", name, lines[result]);
}

static void account(struct fv_sender *sender, uint64_t at, int result)
{
    struct channel *channel = &sender->channels[at];
    count(result == FV_OUTLET_SENT ? &channel->sent : &channel->dropped[result]);
    if (result == FV_OUTLET_SENT)
        taken(sender, fv_clock_ns(CLOCK_MONOTONIC));
    else
        say_once(sender, result, channel->name);
}

/* Send, held against the link where that has no other bound. */
static int send_bulk(struct fv_sender *sender, struct fv_outgoing *message, int64_t now_ns)
{
    struct fv_link *link = &sender->link;
    const size_t around = UDP_HEADER_BYTES + strlen(message->channel) + 1;
    const size_t target = link->slow ? link->budget : FV_LINK_DATAGRAM_BYTES;
    const bool preview = message->class == FV_SENDER_PREVIEWS;
    size_t bytes = around + message->bytes;
    if (preview && bytes > target) {
        if (fv_link_ask(link, target) != FV_LINK_GO) return FV_OUTLET_BUSY;
        message->bytes = fv_preview_shrink(&sender->fit, message->data, message->bytes,
                                           sender->shrunk, target - around);
        if (message->bytes == 0) return FV_TRANSPORT_DROP_LONG;
        message->data = sender->shrunk;
        bytes = around + message->bytes;
    } else if (!sender->outlet->begun(sender->outlet, message->class)) {
        const enum fv_link_answer answer = fv_link_ask(link, bytes);
        if (answer == FV_LINK_TOO_LONG) return FV_TRANSPORT_DROP_LONG;
        if (answer == FV_LINK_WAIT) return FV_OUTLET_BUSY;
    }
    const int result = sender->outlet->send(sender->outlet, message, now_ns);
    if (result == FV_OUTLET_SENT) fv_link_sent(link, bytes, fv_clock_ns(CLOCK_MONOTONIC));
    if (result == FV_TRANSPORT_DROP_QUEUE) fv_link_refused(link, now_ns);
    return result;
}

/* What becomes of a message that cannot go now: FV_OUTLET_BUSY (it waits), or a reason. */
static int give_up(struct fv_sender *sender, enum fv_sender_class class, const struct record *front,
                   size_t bytes, int64_t now_ns)
{
    if (sender->outlet->begun(sender->outlet, class)) return FV_OUTLET_BUSY;
    const bool state = is_state(class);
    if (state ? now_ns - front->put_ns <= state_age_ns : !newer_waits(front, bytes))
        return FV_OUTLET_BUSY;
    if (sender->stalled != FV_TRANSPORT_DROP_BUSY && stalled(sender, now_ns))
        return (int)sender->stalled;
    return state ? FV_TRANSPORT_DROP_LATE : FV_TRANSPORT_DROP_NEWER;
}

/* The oldest message of a class, once. False: there is none, or it waits. */
static bool serve(struct fv_sender *sender, enum fv_sender_class class, int64_t now_ns)
{
    size_t bytes;
    const struct record *front = front_of(sender, class, &bytes);
    if (front == NULL) return false;
    struct fv_outgoing message = {class, sender->channels[front->channel].name,
                                  (const uint8_t *)(front + 1), front->bytes};
    int result = sender->outlet->paced && class >= FV_SENDER_OBJECTS
                     ? send_bulk(sender, &message, now_ns)
                     : sender->outlet->send(sender->outlet, &message, now_ns);
    if (is_state(class) && result == FV_TRANSPORT_DROP_QUEUE &&
        now_ns - front->put_ns < queue_age_ns)
        return false;
    if (result == FV_OUTLET_BUSY) result = give_up(sender, class, front, bytes, now_ns);
    if (result == FV_OUTLET_BUSY) return false;
    if (class == FV_SENDER_PREVIEWS && result == FV_OUTLET_SENT) sender->preview_ns = 0;
    account(sender, front->channel, result);
    fv_ring_release(&sender->rings[class], front->size);
    return true;
}

static bool serve_repeated(struct fv_sender *sender, int64_t now_ns)
{
    if (!atomic_load_explicit(&sender->repeats, memory_order_acquire)) return false;
    if (!sender->repeat_due) {
        if (sender->repeated_ns != 0 && now_ns - sender->repeated_ns < repeat_ns) return false;
        sender->repeat_due = true;
        sender->repeated_ns = now_ns;
        count(&sender->channels[REPEATED].offered);
    }
    const struct fv_outgoing message = {FV_SENDER_REPEATED, sender->channels[REPEATED].name,
                                        sender->repeated, sender->repeated_bytes};
    int result = sender->outlet->send(sender->outlet, &message, now_ns);
    if (result == FV_OUTLET_BUSY && now_ns - sender->repeated_ns < repeat_ns) return false;
    account(sender, REPEATED, result == FV_OUTLET_BUSY ? FV_TRANSPORT_DROP_LATE : result);
    sender->repeat_due = false;
    return true;
}

static bool preview_overdue(struct fv_sender *sender, int64_t now_ns)
{
    size_t bytes;
    if (front_of(sender, FV_SENDER_PREVIEWS, &bytes) == NULL)
        sender->preview_ns = 0;
    else if (sender->preview_ns == 0)
        sender->preview_ns = now_ns;
    return sender->preview_ns != 0 && now_ns - sender->preview_ns > preview_age_ns;
}

/* One message, of the first class that has one which can go. */
static bool serve_one(struct fv_sender *sender, int64_t now_ns)
{
    if (sender->outlet->paced)
        fv_link_observe(&sender->link, sender->outlet->bulk_left(sender->outlet), now_ns);
    if (serve_repeated(sender, now_ns)) return true;
    for (int class = FV_SENDER_STATE; class < FV_SENDER_OBJECTS; class ++)
        if (serve(sender, (enum fv_sender_class) class, now_ns)) return true;
    if (sender->outlet->paced && preview_overdue(sender, now_ns))
        return serve(sender, FV_SENDER_PREVIEWS, now_ns);
    for (int class = FV_SENDER_OBJECTS; class < FV_SENDER_CLASSES; class ++)
        if (serve(sender, (enum fv_sender_class) class, now_ns)) return true;
    return false;
}

static bool any_waits(struct fv_sender *sender)
{
    size_t bytes;
    for (int class = 0; class < FV_SENDER_CLASSES; class ++)
        if (front_of(sender, (enum fv_sender_class) class, &bytes) != NULL) return true;
    return false;
}

static void drop_rest(struct fv_sender *sender)
{
    size_t bytes;
    const struct record *front;
    if (sender->repeat_due) account(sender, REPEATED, FV_TRANSPORT_DROP_END);
    for (int class = 0; class < FV_SENDER_CLASSES; class ++) {
        while ((front = front_of(sender, (enum fv_sender_class) class, &bytes)) != NULL) {
            account(sender, front->channel, FV_TRANSPORT_DROP_END);
            fv_ring_release(&sender->rings[class], front->size);
        }
    }
}

static void *send_all(void *context)
{
    struct fv_sender *sender = context;
    int64_t until_ns = INT64_MAX;
    for (;;) {
        int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
        const bool stop = atomic_load_explicit(&sender->stop, memory_order_acquire);
        if (stop && until_ns == INT64_MAX) until_ns = now_ns + FV_SENDER_FINISH_MS * 1000000LL;
        if (now_ns >= until_ns) break;
        if (serve_one(sender, now_ns)) continue;
        const bool waits = any_waits(sender);
        if (stop && !waits) break;
        if (!waits) taken(sender, now_ns);
        sleep_ns(POLL_NS);
    }
    drop_rest(sender);
    atomic_store_explicit(&sender->ended, true, memory_order_release);
    return NULL;
}

/* ---- opening and closing --------------------------------------------------------------------- */

static enum fovea_status outlet_open(const char *url, struct fv_outlet **outlet,
                                     struct fovea_error *error)
{
    switch (fv_transport_kind_of(url)) {
    case FV_TRANSPORT_UDPM:
        return fv_outlet_udp(url, outlet, error);
    case FV_TRANSPORT_TCPQ:
        return fv_outlet_server(url, outlet, error);
    case FV_TRANSPORT_FILE:
        return fv_outlet_file(url, outlet, error);
    case FV_TRANSPORT_MEMQ:
        return fv_outlet_nowhere(outlet, error);
    default:
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "lcm_url: found \"%.300s\", expected %s",
                               url, "an LCM URL like udpm://239.255.76.67:7667");
    }
}

static void release(struct fv_sender *sender)
{
    if (sender->outlet != NULL) (void)sender->outlet->close(sender->outlet);
    for (int class = 0; class < FV_SENDER_CLASSES; class ++)
        free(sender->memory[class]);
    free(sender);
}

static enum fovea_status rings_make(struct fv_sender *sender, struct fovea_error *error)
{
    for (int class = 0; class < FV_SENDER_CLASSES; class ++) {
        if (ring_bytes[class] == 0) continue;
        sender->memory[class] = fv_aligned_zeroed(ring_bytes[class]);
        if (sender->memory[class] == NULL)
            return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
        fv_ring_init(&sender->rings[class], sender->memory[class], ring_bytes[class]);
    }
    return FOVEA_OK;
}

enum fovea_status fv_sender_open(const char *url, struct fv_sender **sender,
                                 struct fovea_error *error)
{
    struct fv_sender *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    atomic_store(&opened->channel_count, LOOP);
    fv_link_init(&opened->link, fv_clock_ns(CLOCK_MONOTONIC));
    enum fovea_status status = rings_make(opened, error);
    if (status == FOVEA_OK) status = outlet_open(url, &opened->outlet, error);
    int failed = 0;
    if (status == FOVEA_OK) opened->stalled = opened->outlet->stalled;
    taken(opened, fv_clock_ns(CLOCK_MONOTONIC));
    if (status == FOVEA_OK) failed = fv_thread_start(&opened->thread, send_all, opened);
    if (failed != 0)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "no thread to send LCM messages: %s",
                                 strerror(failed));
    if (status != FOVEA_OK) {
        release(opened);
        return status;
    }
    *sender = opened;
    return FOVEA_OK;
}

void fv_sender_repeat(struct fv_sender *sender, const char *channel, const uint8_t *data,
                      uint32_t bytes)
{
    if (bytes > sizeof sender->repeated) return;
    channel_name(&sender->channels[REPEATED], channel);
    memcpy(sender->repeated, data, bytes);
    sender->repeated_bytes = bytes;
    atomic_store_explicit(&sender->repeats, true, memory_order_release);
}

void fv_sender_reserve(struct fv_sender *sender, enum fv_transport_thread thread,
                       const char *channel)
{
    struct channel *of = &sender->channels[THREADS + (uint32_t)thread];
    channel_name(of, channel);
    of->class = thread == FV_TRANSPORT_SENSOR ? FV_SENDER_SENSOR : FV_SENDER_WATCHER;
}

bool fv_sender_finish(struct fv_sender *sender)
{
    if (sender->joined) return true;
    if (sender->left_behind) return false;
    atomic_store_explicit(&sender->stop, true, memory_order_release);
    const int64_t until = fv_clock_ns(CLOCK_MONOTONIC) + (FV_SENDER_FINISH_MS + 500) * 1000000LL;
    while (!(sender->joined = pthread_tryjoin_np(sender->thread, NULL) == 0) &&
           fv_clock_ns(CLOCK_MONOTONIC) < until)
        sleep_ns(1000000);
    sender->left_behind = !sender->joined;
    return sender->joined;
}

bool fv_sender_sync(struct fv_sender *sender)
{
    if (!fv_sender_finish(sender) || sender->outlet == NULL) return true;
    const bool lasts = sender->outlet->close(sender->outlet);
    sender->outlet = NULL;
    return lasts;
}

void fv_sender_counts(const struct fv_sender *sender, struct fv_transport_sent *counts)
{
    const uint32_t used = atomic_load_explicit(&sender->channel_count, memory_order_acquire);
    memset(counts, 0, sizeof *counts);
    for (uint32_t i = 0; i < used; i++) {
        const struct channel *channel = &sender->channels[i];
        struct fv_transport_channel *to = &counts->channels[counts->count];
        to->offered = atomic_load(&channel->offered);
        if (to->offered == 0) continue;
        memcpy(to->name, channel->name, sizeof to->name);
        to->sent = atomic_load(&channel->sent);
        uint64_t known = to->sent;
        for (int reason = 0; reason < FV_TRANSPORT_DROPS; reason++)
            known += to->dropped[reason] = atomic_load(&channel->dropped[reason]);
        if (sender->left_behind) to->dropped[FV_TRANSPORT_DROP_END] += to->offered - known;
        counts->count++;
    }
}

void fv_sender_close(struct fv_sender *sender)
{
    if (fv_sender_finish(sender))
        release(sender);
    else
        fv_say("LCM: a write does not return; %s", "messages that waited for it are lost");
}
