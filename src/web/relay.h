/* From the feed of a run into the store: what the page shows of each message and frame. Reconnects
 * when a run ends and another begins. One thread. */
#ifndef FOVEA_WEB_RELAY_H
#define FOVEA_WEB_RELAY_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/feed_reader.h"
#include "web/player.h"
#include "web/store.h"

enum {
    FV_WEB_OVERLAYS = 8,
    FV_WEB_OVERLAY_BYTES = 1 << 16,
    FV_WEB_SHOWN_MAX = 24, /* kinds of messages */
    FV_WEB_PIECES_MAX = 32 /* of one grid or mask */
};

struct fv_web_heard;
struct fv_foxglove_shown;
struct fv_web_relay;

/* Where a robot's messages and pictures come from. */
struct fv_web_relay_source {
    const char *silence; /* what the log says when nothing comes any more */
    /* Take what has come, into the relay; whether there was anything new. */
    bool (*tick)(struct fv_web_relay *relay, bool watched);
    void (*close)(struct fv_web_relay *relay);
};
/* The feed of a run, relay_feed.c; a recording, relay_recording.c; a robot on another host,
 * heard.c.
 */
extern const struct fv_web_relay_source fv_web_relay_feed, fv_web_relay_recording,
    fv_web_relay_robot;

struct fv_web_relay {
    const struct fv_web_relay_source *source;
    const char *path; /* of the feed's socket */
    struct fv_web_store *store;
    struct fv_foxglove_shown *foxglove; /* takes the same messages, the caller's; NULL: none */
    struct fv_feed_reader *reader;      /* NULL: there is no run now */
    struct fv_web_player *player;       /* plays in place of a feed, the caller's; NULL: none */
    struct fv_web_heard *heard;         /* a robot heard over LCM, likewise */
    /* Of malloc: a recorded frame whose messages follow, by camera; data NULL: none. */
    struct fovea_image played[FOVEA_CAMERAS_MAX];
    uint32_t played_cameras; /* `cameras` when it was looked at last */
    int64_t played_stamp_ns, played_sequence, picture_ns, told_ns;
    uint32_t rate_per_1000_s, wished;
    uint32_t cameras; /* bits: those whose pictures somebody looks at */
    int64_t next_try_ns;
    uint32_t tries; /* to reach the run, that ended as follows */
    char why_not[FV_WEB_LOG_BYTES];
    char prefix[FV_MESSAGE_CHANNEL_BYTES];

    /* Of the last pose, whose changes are logged. */
    int state, scale_state, map_id, reset_counter, change_count, camera_state;
    int64_t state_since_ns, path_ns;
    uint32_t faults; /* bits of the parts of health */
    bool records;    /* a recording that a command began is being written */

    /* The last messages of features, of which the one with a picture's stamp goes with it. */
    struct {
        int64_t stamp_ns;
        uint32_t count;
        struct fv_web_point points[FV_WEB_POINTS_MAX];
    } overlays[FV_WEB_OVERLAYS];
    uint32_t overlay_next;
    int32_t pieces[FV_WEB_SHOWN_MAX]; /* the last one of each kind */
};

void fv_web_relay_init(struct fv_web_relay *relay, const char *path, uint32_t rate_hz,
                       struct fv_web_store *store);

/* Play a recording in place of a feed; NULL: none. It stays the caller's. */
void fv_web_relay_play(struct fv_web_relay *relay, struct fv_web_player *player);

/* Give views for Foxglove's clients what comes; likewise. */
void fv_web_relay_show(struct fv_web_relay *relay, struct fv_foxglove_shown *foxglove);

/* Hear a robot over LCM in place of a feed; likewise. */
void fv_web_relay_hear(struct fv_web_relay *relay, struct fv_web_heard *heard);

/* For what stands in the place of a feed. The channels that are shown, without prefix, and their
 * types, by index; NULL: no more. */
const char *fv_web_relay_shows(uint32_t index, const char **type);
/* Another run, or what comes does not follow on what came; nothing comes any more. */
void fv_web_relay_begin(struct fv_web_relay *relay, const char *prefix);
void fv_web_relay_silent(struct fv_web_relay *relay);
void fv_web_relay_take(struct fv_web_relay *relay, const struct fv_feed_message *message,
                       bool watched);
/* A picture, of malloc, which becomes the store's, with the features of this very stamp. `age_ns`:
 * of the frame; -1: not known. */
void fv_web_relay_picture(struct fv_web_relay *relay, const struct fovea_image *image,
                          int64_t stamp_ns, int64_t sequence, int64_t age_ns);

/* So many cameras have come: pages choose from them. */
void fv_web_relay_cameras(struct fv_web_relay *relay, uint32_t count);

/* Take what has come; `watched`: somebody wants pictures. Returns whether the store has changed. */
bool fv_web_relay_tick(struct fv_web_relay *relay, bool watched);

void fv_web_relay_close(struct fv_web_relay *relay);

#endif
