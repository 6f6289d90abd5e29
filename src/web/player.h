/* A recording, played at the pace of its stamps: what the relay takes in place of a feed. The file
 * is opened for reading alone, and held to be a stranger's: every event is checked by
 * support/lcmlog.h, messages by who decodes them.
 *
 * Positions are milliseconds since the first frame. An index of at most FV_WEB_PLAYER_INDEX frames,
 * made when the file is opened, leads to them. One thread. */
#ifndef FOVEA_WEB_PLAYER_H
#define FOVEA_WEB_PLAYER_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/feed_reader.h"
#include "fovea/status.h"
#include "support/lcmlog.h"

enum { FV_WEB_PLAYER_INDEX = 1 << 14 };

struct fv_web_player;

/* FOVEA_ERROR_INPUT, FOVEA_ERROR_UNSUPPORTED: `path` is no recording of this format, or has no
 * frame; one line says why. One that is cut off or damaged further on is played up to there, and
 * `damage` says where; "": it is whole. Init-only. */
enum fovea_status fv_web_player_open(const char *path, struct fv_web_player **player,
                                     struct fovea_error *damage, struct fovea_error *error);
void fv_web_player_close(struct fv_web_player *player);

/* Of the recorded run: the prefix of its channels, and its RUN message; bytes 0: none. */
const char *fv_web_player_prefix(const struct fv_web_player *player);
const struct fv_feed_message *fv_web_player_run(const struct fv_web_player *player);

/* What is to be shown at `now_ns` (CLOCK_MONOTONIC). */
enum fv_web_played {
    FV_WEB_PLAYED_NOTHING, /* nothing more now */
    FV_WEB_PLAYED_MESSAGE,
    FV_WEB_PLAYED_FRAME, /* its messages follow */
    FV_WEB_PLAYED_WORK,  /* they have all come */
    FV_WEB_PLAYED_JUMP   /* what comes does not follow on what came: forget that */
};
struct fv_web_player_out {
    struct fv_feed_message message;
    struct fovea_frame frame; /* likewise valid until the next call */
};
enum fv_web_played fv_web_player_next(struct fv_web_player *player, int64_t now_ns,
                                      struct fv_web_player_out *out);

/* What is done with it, and how it stands. */
struct fv_web_playback {
    int64_t position_ms, length_ms;
    double speed;
    bool paused;
    char damage[160]; /* where playing stopped; "": it did not */
};
void fv_web_player_state(const struct fv_web_player *player, struct fv_web_playback *state);
void fv_web_player_pause(struct fv_web_player *player, bool paused);
/* At most 8, at least 1/8; beyond that it is the nearest of them. */
void fv_web_player_speed(struct fv_web_player *player, double speed);
/* Go to the last indexed frame that begins before a position or within its millisecond; beyond the
 * ends to these. */
void fv_web_player_seek(struct fv_web_player *player, int64_t position_ms);

#endif
