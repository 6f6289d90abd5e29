#include "app/watch/bus.h"

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "app/network/transport_url.h"
#include "drivers/clock.h"

#define URL_DEFAULT "udpm://239.255.76.67:7667"

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

enum fovea_status fv_bus_open(struct fv_bus *bus, const struct fv_receiver_channel *rows,
                              uint32_t count, struct fovea_error *error)
{
    struct sigaction action = {.sa_handler = on_end};
    const struct fv_receiver_setup setup = {bus->url != NULL ? bus->url : URL_DEFAULT,
                                            bus->listen != NULL ? bus->listen : "any", rows, count};
    enum fovea_status status = fv_transport_url_check(setup.url, error);
    if (status == FOVEA_OK) status = fv_receiver_open(&setup, &bus->receiver, error);
    if (status == FOVEA_OK && bus->receiver == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "found --lcm-url %.200s and --listen %.40s, of which nothing can "
                                 "be heard; expected udpm:// or tcpq://, and not none",
                                 setup.url, setup.listen);
    if (status != FOVEA_OK) return status;
    atomic_store(&woken, bus->receiver);
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
}

bool fv_bus_ended(void)
{
    return ended != 0;
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
        taken = fv_receiver_handle(bus->receiver, wait_ms < INT_MAX ? (int)wait_ms : INT_MAX);
    }
    return taken;
}
