/* LCM: messages out through a thread of its own (sender.h), commands in through another
 * (listener.h), and wait-free rings between these and the loop.
 *
 * The loop makes no system call, lock or heap call here. Every function takes NULL for "nothing is
 * sent". */
#ifndef FOVEA_APP_NETWORK_TRANSPORT_H
#define FOVEA_APP_NETWORK_TRANSPORT_H

#include <stdint.h>
#include <stdio.h>

#include "app/network/command_gate.h"
#include "app/network/wheel_odometry_gate.h"
#include "app/network/receiver.h"
#include "fovea/fovea.h"

enum { FV_TRANSPORT_URL_BYTES = 320 };

/* What makes multicast reach subscribers on a host without a network. */
#define FV_TRANSPORT_MEND                                                                          \
    "sudo ip link set lo up multicast on; sudo ip route replace 224.0.0.0/4 dev lo"

struct fv_transport;

/* Prepare for sending to `url` ("udpm://239.255.76.67:7667", "tcpq://...", any LCM URL; "":
 * *transport is NULL) with time-to-live `ttl` (0: this host), unless the URL states its own.
 * FOVEA_ERROR_INPUT: malformed URL; a log that cannot be written or that another program writes; an
 * earlier log is kept until the first message is written. FOVEA_ERROR_SYSTEM: the system has no way
 * to the address; `error` holds the command that mends it. Init-only. */
enum fovea_status fv_transport_open(const char *url, uint32_t ttl, struct fv_transport **transport,
                                    struct fovea_error *error);
/* The same for a run that goes on for weeks: where a udpm:// group has no route yet it is said, and
 * the transport opens all the same. Messages count as dropped until the route comes. */
enum fovea_status fv_transport_open_early(const char *url, uint32_t ttl,
                                          struct fv_transport **transport,
                                          struct fovea_error *error);

/* What a transport hears. */
struct fv_transport_ears {
    const char *listen;                 /* whom: receiver.h */
    const char *prefix;                 /* commands come on <prefix>_COMMAND */
    const char *wheel_odometry_channel; /* of bot_core.pose_t; NULL or "": none */
    struct fv_wheel_odometry_limits wheel_odometry_limits;
    struct fv_command_rules rules;
    const struct fv_receiver_channel *more; /* further channels; handlers run on the thread */
    uint32_t more_count;
};

/* Hear commands, wheel odometry and `ears->more` in a thread of its own. Init-only. */
enum fovea_status fv_transport_listen(struct fv_transport *transport,
                                      const struct fv_transport_ears *ears,
                                      struct fovea_error *error);

/* Say who sends: `data` goes out first on `channel`, and again every second; at most
 * FV_SENDER_REPEATED_BYTES. Before the first message, once. Init-only. */
void fv_transport_repeat(struct fv_transport *transport, const char *channel, const uint8_t *data,
                         uint32_t bytes);

/* Hand over the messages of a step or a work for sending. Loop thread, wait-free. */
void fv_transport_publish(struct fv_transport *transport, const struct fovea_outputs *outputs);

/* Threads that send beside the loop's, each on one channel: that of the inertial sensor poses
 * between frames, and the watching one health while a step hangs. */
enum fv_transport_thread { FV_TRANSPORT_SENSOR, FV_TRANSPORT_WATCHER, FV_TRANSPORT_THREADS };

/* `channel`, at most FV_TRANSPORT_CHANNEL_BYTES - 1 bytes, is that thread's. Before its first
 * message, once. */
void fv_transport_reserve(struct fv_transport *transport, enum fv_transport_thread thread,
                          const char *channel);
/* Hand over a message on that channel, whatever it names. That thread, wait-free. */
void fv_transport_put_from(struct fv_transport *transport, enum fv_transport_thread thread,
                           const struct fovea_message *message);

/* Whether there is room for an iteration, or it was asked for in vain for a second. Where frames do
 * not come by the clock: ask before an iteration. `settled`: and all is sent (fv_sender_room). Loop
 * thread. */
bool fv_transport_room(struct fv_transport *transport, bool settled);

/* Send what waits, for at most a second and a half, and end sending: counts are exact then.
 * Init-only. */
void fv_transport_finish(struct fv_transport *transport);

/* Hand over one more message, such as the answer to a command. As fv_transport_publish; after the
 * loop has ended, from one thread. */
void fv_transport_put(struct fv_transport *transport, const struct fovea_message *message);

/* The next command that has come, oldest first: those taken, and those refused that are to be
 * answered. False: there is none. Loop thread, wait-free. */
bool fv_transport_command(struct fv_transport *transport, struct fv_judged_command *command);

/* Odometry that has come since the last call, oldest first, at most `count_max`; what there is no
 * room for waits. Stamps are those of the messages in nanoseconds. Returns the number. Loop thread,
 * wait-free. */
uint32_t fv_transport_wheel_odometry(struct fv_transport *transport,
                                     struct fovea_wheel_odometry_sample *samples,
                                     uint32_t count_max);

/* Why a message was not sent. */
enum fv_transport_drop {
    FV_TRANSPORT_DROP_BUSY = 0, /* no room in its ring: the sending thread was behind */
    FV_TRANSPORT_DROP_NEWER,    /* the link was busy until a newer one of the channel came */
    FV_TRANSPORT_DROP_LONG,     /* longer than what the link takes in 80 ms */
    FV_TRANSPORT_DROP_LATE,     /* it could not be sent for a second */
    FV_TRANSPORT_DROP_QUEUE,    /* the interface's queue was full */
    FV_TRANSPORT_DROP_ROUTE,    /* no route, interface down */
    FV_TRANSPORT_DROP_FIREWALL, /* forbidden by the system */
    FV_TRANSPORT_DROP_SERVER,   /* tcpq: no connection, or the server took nothing for a second */
    FV_TRANSPORT_DROP_FILE,     /* file: could not be written, or the disk took nothing for one */
    FV_TRANSPORT_DROP_END,      /* was left when the program ended */
    FV_TRANSPORT_DROPS
};

/* One word, for JSON. */
const char *fv_transport_drop_name(enum fv_transport_drop reason);

enum { FV_TRANSPORT_CHANNELS = 44, FV_TRANSPORT_CHANNEL_BYTES = 64 };

/* offered == sent + all dropped, after fv_transport_finish. */
struct fv_transport_sent {
    uint32_t count;
    struct fv_transport_channel {
        char name[FV_TRANSPORT_CHANNEL_BYTES];
        uint64_t offered, sent, dropped[FV_TRANSPORT_DROPS];
    } channels[FV_TRANSPORT_CHANNELS];
};
void fv_transport_sent(const struct fv_transport *transport, struct fv_transport_sent *sent);

/* How many messages the log of a file URL does not hold, of `*offered` in all; 0 for other URLs,
 * which promise nothing. After fv_transport_finish. */
uint64_t fv_transport_lost(const struct fv_transport *transport, uint64_t *offered);

/* Sync and close the log of a file URL. False: it may not last; one line has said so. After
 * fv_transport_finish, once; it waits for the disk. */
bool fv_transport_sync(struct fv_transport *transport);

struct fv_transport_counts {
    uint64_t sent, dropped;                          /* messages of all channels */
    uint64_t commands, commands_refused;             /* taken; refused, whatever the reason */
    uint64_t wheel_odometry, wheel_odometry_refused; /* likewise */
    uint64_t command_verdicts[FV_COMMAND_VERDICTS],
        wheel_odometry_verdicts[FV_WHEEL_ODOMETRY_VERDICTS];
    struct fv_receiver_counts received;
};
void fv_transport_counts(const struct fv_transport *transport, struct fv_transport_counts *counts);

/* Lines of what was not sent, by channel and reason, and what was refused; nothing where all went
 * well. Init-only. */
void fv_transport_tell(FILE *out, const struct fv_transport *transport);

void fv_transport_close(struct fv_transport *transport);

/* The file of a well-formed file URL; false, and "", for the others. */
bool fv_transport_file(const char *url, char path[FV_TRANSPORT_URL_BYTES]);

/* Does a message reach a subscriber on this host? Sends to the group on a port of its own, which
 * nobody else hears, and listens, at most about a second. For a log file: can it be written? It is
 * left as it is, or unmade. FOVEA_OK, or an error whose text says what failed and the command that
 * mends it. Init-only. */
enum fovea_status fv_transport_check(const char *url, uint32_t ttl, struct fovea_error *error);

#endif
