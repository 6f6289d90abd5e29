#include "app/watch/bus.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/network/receiver_packet.h"
#include "app/network/transport_url.h"
#include "drivers/clock.h"
#include "support/say.h"

#define URL_DEFAULT "udpm://239.255.76.67:7667"

enum { FEED_LOOK_MS = 5, FEED_MESSAGES_PER_CALL = 100 };

static volatile sig_atomic_t ended;
static struct fv_receiver *_Atomic woken; /* by a signal */

/* A signal that comes between the question and the waiting is not missed: the wake stays. */
static void on_end(int signal)
{
    const int kept = errno;
    struct fv_receiver *receiver = atomic_load(&woken);
    (void)signal;
    ended = 1;
    if (receiver != NULL) fv_receiver_wake(receiver);
    errno = kept;
}

enum fovea_status fv_bus_row(const char *channel, struct fv_receiver_channel *row,
                             struct fovea_error *error)
{
    const size_t length = strlen(channel);
    if (length == 0 || length >= sizeof row->name)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "CHANNEL: found %zu bytes, expected 1 to %zu", length,
                               sizeof row->name - 1);
    memset(row, 0, sizeof *row);
    memcpy(row->name, channel, length + 1);
    row->bytes_max = FV_RECEIVER_BYTES_MAX;
    row->pattern = strpbrk(channel, "*?") != NULL;
    return FOVEA_OK;
}

static enum fovea_status feed_open(struct fv_bus *bus, const struct fv_receiver_channel *rows,
                                   uint32_t count, struct fovea_error *error)
{
    if (bus->url != NULL || bus->listen != NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found --feed beside %s, expected one of them",
                               bus->url != NULL ? "--lcm-url" : "--listen");
    bus->table = calloc(1, sizeof *bus->table);
    if (bus->table == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory");
    memcpy(bus->table->rows, rows, count * sizeof rows[0]);
    bus->table->count = count;
    return fv_feed_reader_open(bus->feed, bus->frames_per_1000_s, &bus->reader, error);
}

static enum fovea_status lcm_open(struct fv_bus *bus, const struct fv_receiver_channel *rows,
                                  uint32_t count, struct fovea_error *error)
{
    const struct fv_receiver_setup setup = {bus->url != NULL ? bus->url : URL_DEFAULT,
                                            bus->listen != NULL ? bus->listen : "any", rows, count};
    enum fovea_status status = fv_transport_url_check(setup.url, error);
    if (status == FOVEA_OK) status = fv_receiver_open(&setup, &bus->receiver, error);
    if (status == FOVEA_OK && bus->receiver == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "found --lcm-url %.200s and --listen %.40s, of which nothing can "
                                 "be heard; expected udpm:// or tcpq://, and not none",
                                 setup.url, setup.listen);
    if (status == FOVEA_OK) atomic_store(&woken, bus->receiver);
    return status;
}

enum fovea_status fv_bus_open(struct fv_bus *bus, const struct fv_receiver_channel *rows,
                              uint32_t count, struct fovea_error *error)
{
    struct sigaction action = {.sa_handler = on_end};
    const enum fovea_status status =
        bus->feed != NULL ? feed_open(bus, rows, count, error) : lcm_open(bus, rows, count, error);
    if (status != FOVEA_OK) return status;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    return FOVEA_OK;
}

void fv_bus_close(struct fv_bus *bus)
{
    atomic_store(&woken, NULL);
    fv_receiver_close(bus->receiver);
    bus->receiver = NULL;
    const uint64_t missed = bus->reader != NULL ? fv_feed_reader_missed(bus->reader) : 0;
    if (missed > 0)
        fv_say("%s: %" PRIu64 " messages were overwritten before they were read", bus->feed,
               missed);
    fv_feed_reader_close(bus->reader);
    bus->reader = NULL;
    free(bus->table);
    bus->table = NULL;
}

bool fv_bus_ended(void)
{
    return ended != 0;
}

/* Hand over what the feed has now, a hundred messages at most. */
static uint32_t feed_handle(struct fv_bus *bus)
{
    struct fv_feed_message message;
    uint32_t taken = 0;
    for (int i = 0; i < FEED_MESSAGES_PER_CALL; i++) {
        const enum fovea_status status = fv_feed_reader_next(bus->reader, &message);
        if (status == FOVEA_END) ended = 1; /* the run has ended, and so do we */
        if (status != FOVEA_OK) break;
        const struct fv_receiver_channel *row =
            fv_table_find(bus->table, message.channel, strlen(message.channel));
        const struct fv_received received = {message.channel, message.data, message.bytes, true};
        if (row != NULL) taken += fv_table_deliver(bus->table, row, &received);
    }
    return taken;
}

/* A feed cannot wake its readers: they look every few milliseconds. */
static uint32_t feed_wait(struct fv_bus *bus, int wait_ms)
{
    const int64_t until_ns =
        wait_ms < 0 ? INT64_MAX : fv_clock_ns(CLOCK_MONOTONIC) + wait_ms * 1000000LL;
    struct pollfd polled = {fv_feed_reader_socket(bus->reader), POLLIN, 0};
    uint32_t taken = 0;
    while ((taken = feed_handle(bus)) == 0 && !fv_bus_ended() &&
           fv_clock_ns(CLOCK_MONOTONIC) < until_ns)
        poll(&polled, 1, FEED_LOOK_MS);
    return taken;
}

uint32_t fv_bus_wait(struct fv_bus *bus, int64_t until_ns)
{
    uint32_t taken = 0;
    while (taken == 0 && !fv_bus_ended()) {
        int64_t wait_ms = -1;
        if (until_ns != 0) {
            const int64_t left_ns = until_ns - fv_clock_ns(CLOCK_MONOTONIC);
            if (left_ns <= 0) break;
            wait_ms = (left_ns + 999999) / 1000000;
        }
        const int most_ms = wait_ms < INT_MAX ? (int)wait_ms : INT_MAX;
        taken = bus->reader != NULL ? feed_wait(bus, most_ms)
                                    : fv_receiver_handle(bus->receiver, most_ms);
    }
    return taken;
}
