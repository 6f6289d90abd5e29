/* What the commands that watch running robots share: options, a receiver that hears this host and
 * the network, or a reader of one run's feed, and an end by SIGINT or SIGTERM. Nothing is sent. One
 * at a time in a process. */
#ifndef FOVEA_APP_WATCH_BUS_H
#define FOVEA_APP_WATCH_BUS_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/feed_reader.h"
#include "app/network/receiver.h"

struct fv_bus {
    /* Of the command line; NULL: the default. */
    const char *url, *listen, *feed;
    uint32_t frames_per_1000_s; /* wished for from the feed; 0: none */
    struct fv_receiver *receiver;
    struct fv_feed_reader *reader;   /* of the feed, in place of the receiver */
    struct fv_receiver_table *table; /* of the feed's messages */
};

/* Rows of a command's table of options (app/config/options.h). */
#define FV_BUS_OPTIONS(bus)                                                                        \
    {"lcm-url", "URL", FV_OPTION_TEXT, &(bus).url,                                                 \
     "LCM URL that is heard, udpm:// or tcpq:// (default udpm://239.255.76.67:7667)"},             \
        {"listen", "WHOM", FV_OPTION_TEXT, &(bus).listen,                                          \
         "who is heard: loopback (this host), the name of an interface (and this host), or any "   \
         "(default)"},                                                                             \
    {                                                                                              \
        "feed", "SOCKET", FV_OPTION_TEXT, &(bus).feed,                                             \
            "in place of LCM: the run on this host whose key web.socket names this socket"         \
    }

/* The row of a channel, or of many where the name has a star or a question mark.
 * FOVEA_ERROR_INPUT: longer than names of channels are. */
enum fovea_status fv_bus_row(const char *channel, struct fv_receiver_channel *row,
                             struct fovea_error *error);

/* Listen. FOVEA_ERROR_INPUT: an option is wrong. */
enum fovea_status fv_bus_open(struct fv_bus *bus, const struct fv_receiver_channel *rows,
                              uint32_t count, struct fovea_error *error);
void fv_bus_close(struct fv_bus *bus);

/* Whether the program was told to end. */
bool fv_bus_ended(void);

/* Hand over what comes until `until_ns` (CLOCK_MONOTONIC; 0: without end), the end, or a first
 * message. Returns messages handed over. */
uint32_t fv_bus_wait(struct fv_bus *bus, int64_t until_ns);

#endif
