/* One page that looks: what it was sent, what it may be sent next, what it says. No sockets here
 * (server.c), so that all of it is tested without any.
 *
 * To the page go packets of four kinds. Text is JSON with a member "kind": hello, robots, camera,
 * playback, log, pong, sent, refused. Binary frames hold packets, each behind its length (4 bytes),
 * which begin with a byte; numbers are big-endian:
 *   1  a message: length of the channel's name (1 byte), name, the message as LCM encodes it; the
 *      page decodes it by the definitions of /types. It is sent as it is because the same bytes
 *      then serve all clients, take a fourth of their JSON, and no new message type needs code here
 *   2  a picture: fv_web_client_next says its head
 *   3  a piece of the path: epoch (4), number of the first place (8), count (4), x y z (4 each)
 *
 * The page says, in words:
 *   "ack N"               picture N is on the screen
 *   "ping TEXT"           the answer is "pong"
 *   "pictures 0|1"        whether it wants pictures
 *   "robot N"             show this robot
 *   "camera N"            show this camera; a reply "camera" comes before its pictures
 *   "command REQUEST WORD..."                      with the words of docs/messages.md
 *   "parameter REQUEST once|keep KEY [VALUE]"      without a value: asks for the one in force
 *   "map REQUEST [FILE]"                           loads a map; without a file: asks for the list
 *   "play REQUEST pause|resume|seek MS|speed FACTOR"   of a recording; its state is "playback"
 *
 * At most two pictures are on their way. Where the link is too slow for that, the class of size and
 * quality falls, then pictures are left out; messages go first. */
#ifndef FOVEA_WEB_CLIENT_H
#define FOVEA_WEB_CLIENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "web/access.h"
#include "web/robots.h"
#include "web/store.h"

enum {
    FV_WEB_UNACKED_MAX = 2,
    FV_WEB_REPLY_BYTES = 256,
    FV_WEB_REPLIES = 4,               /* that wait; one more takes the place of the oldest */
    FV_WEB_WORDS_BYTES = 400,         /* that a page may say at once */
    FV_WEB_PACKET_BYTES_MAX = 640000, /* a picture that is larger goes out in the next class */
};

struct fv_web_client {
    enum fv_web_role role;
    bool commands;                           /* may be sent: shown in hello */
    const struct fv_web_robots *robots;      /* NULL: there is one */
    uint32_t robot, robots_sent;             /* that is shown; version of the list that was sent */
    uint32_t news, run, playback;            /* of the store, as they were sent */
    uint32_t versions[FV_WEB_ROWS_MAX], row; /* the row that was sent last */
    uint32_t path_epoch;
    uint64_t path_sent, log_sent;
    char replies[FV_WEB_REPLIES][FV_WEB_REPLY_BYTES]; /* texts that wait: a ring */
    uint32_t reply_first, reply_count;

    bool hidden;     /* the page is, and wants no pictures */
    uint32_t camera; /* of the rig, whose pictures it gets */
    int picture_class;
    uint32_t sent, frame; /* pictures: last sent, last that was there */
    uint32_t unacked_count;
    struct {
        uint32_t number;
        int picture_class;
        int64_t sent_ns;
    } unacked[FV_WEB_UNACKED_MAX];
    int64_t ack_least_ns, ack_ns; /* from sending to acknowledgement: least; last of this class */
    int64_t class_ns, better_ns;  /* class changed; how long it must go well for a better one */
    uint64_t bytes_per_s;         /* that its link carries, the caller's; 0: not known */
};

void fv_web_client_init(struct fv_web_client *client, enum fv_web_role role, bool commands);

/* Show a robot from now on, from its beginning; `commands` as above. */
void fv_web_client_show(struct fv_web_client *client, uint32_t robot, bool commands);

/* The next packet, into `to`. Returns its bytes, 0: there is nothing to send now. `*text`: it is
 * text. */
size_t fv_web_client_next(struct fv_web_client *client, struct fv_web_store *store, uint8_t *to,
                          size_t capacity, int64_t now_ns, bool *text);

/* What a page said. */
enum fv_web_said {
    FV_WEB_SAID_NOTHING,
    FV_WEB_SAID_COMMAND,
    FV_WEB_SAID_PLAY,
    FV_WEB_SAID_ROBOT,
    FV_WEB_SAID_WRONG
};
struct fv_web_command {
    uint32_t request; /* the page's number of it; FV_WEB_SAID_ROBOT: that of the robot */
    int32_t bits;     /* of command_t; 0: it is a map_load_t or a parameter_t */
    bool loads;       /* a map_load_t, whose file is `key`; false: a parameter_t, as follows */
    bool keep;
    enum { FV_WEB_PAUSE, FV_WEB_RESUME, FV_WEB_SEEK, FV_WEB_SPEED } play; /* FV_WEB_SAID_PLAY */
    double play_to;                                                       /* milliseconds, factor */
    char key[FV_WEB_WORDS_BYTES + 1], value[FV_WEB_WORDS_BYTES + 1];
};
enum fv_web_said fv_web_client_hear(struct fv_web_client *client, const char *words, size_t length,
                                    int64_t now_ns, struct fv_web_command *command);

/* To be sent before all else. */
void fv_web_client_reply(struct fv_web_client *client, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
