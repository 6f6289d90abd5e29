#include "web/player.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"
#include "message/fields.h"

#include "fovea_recording_t.h"

#define LEAP_US INT64_C(5000000) /* a longer gap between stamps is not waited for */
#define STAMP_MOST_US (INT64_C(1) << 55)
static const double speed_most = 8.0;

struct place {
    int64_t time_us, offset;
};

struct fv_web_player {
    struct fv_lcmlog *log;
    char *path;
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    struct fv_feed_message run;
    uint8_t *run_data;

    uint32_t count, stride, seen; /* places; frames from one to the next; frames since the last */
    struct place places[FV_WEB_PLAYER_INDEX];
    int64_t last_us, end; /* time of the last frame; offset where what can be played ends */

    struct fv_lcmlog_event event;
    bool waits;         /* `event` was read, and is not yet due */
    bool jumped, shown; /* a jump is to be told; a paused player still shows one frame after it */
    bool paused;
    double speed;
    int64_t media_us, now_ns; /* position, and when it was there */
    char damage[160];
};

/* ---- opening --------------------------------------------------------------------------------- */

static enum fovea_status take_parts(struct fv_web_player *player, const fovea_recording_t *header)
{
    snprintf(player->prefix, sizeof player->prefix, "%s", header->channel_prefix);
    for (int32_t i = 0; i < header->part_count; i++) {
        const fovea_recording_part_t *part = &header->parts[i];
        if (strcmp(part->name, "run") != 0 || part->size_bytes <= 0) continue;
        player->run_data = malloc((size_t)part->size_bytes);
        if (player->run_data == NULL) return FOVEA_ERROR_MEMORY;
        memcpy(player->run_data, part->data, (size_t)part->size_bytes);
        fv_message_channel(player->prefix, FV_MESSAGE_RUN, player->run.channel);
        player->run.data = player->run_data;
        player->run.bytes = (uint32_t)part->size_bytes;
        break;
    }
    return FOVEA_OK;
}

static enum fovea_status read_header(struct fv_web_player *player, struct fovea_error *error)
{
    const char *problem = "it cannot be decoded";
    size_t at = 0;
    fovea_recording_t header;
    enum fovea_status status = fv_lcmlog_next(player->log, &player->event, error);
    if (status == FOVEA_END ||
        (status == FOVEA_OK && !fv_lcmlog_channel_is(player->event.channel, "RECORDING")))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte 0: found no recording of fovea run, expected one",
                               player->path);
    if (status != FOVEA_OK) return status;
    if (!fv_message_check("fovea.recording_t", player->event.data, player->event.bytes, &problem,
                          &at) ||
        fovea_recording_t_decode(player->event.data, 0, (int)player->event.bytes, &header) < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: header of the recording: byte %zu: %s", player->path, at,
                               problem);
    status = fv_lcmlog_check_format(player->path, player->event.offset + 8, header.format, error);
    if (status == FOVEA_OK) status = take_parts(player, &header);
    if (status == FOVEA_ERROR_MEMORY) fovea_error_set(error, status, "%s: no memory", player->path);
    fovea_recording_t_decode_cleanup(&header);
    return status;
}

/* Stamps of events are computed with: those of no year of a robot are damage. */
static enum fovea_status check_stamp(const struct fv_web_player *player,
                                     const struct fv_lcmlog_event *event, struct fovea_error *error)
{
    if (event->time_us <= STAMP_MOST_US && event->time_us >= -STAMP_MOST_US) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: byte %lld: found an event of the time %lld us, expected at most "
                           "2^55 on either side of 0",
                           player->path, (long long)event->offset + 12, (long long)event->time_us);
}

/* Every stride-th frame; when the index is full, every second of its places goes. */
static void index_frame(struct fv_web_player *player, const struct fv_lcmlog_event *event)
{
    if (event->time_us > player->last_us) player->last_us = event->time_us;
    if (player->seen++ % player->stride != 0) return;
    if (player->count == FV_WEB_PLAYER_INDEX) {
        for (uint32_t i = 0; i < FV_WEB_PLAYER_INDEX / 2; i++)
            player->places[i] = player->places[2 * i];
        player->count = FV_WEB_PLAYER_INDEX / 2;
        player->stride *= 2;
    }
    player->places[player->count++] = (struct place){event->time_us, event->offset};
}

static enum fovea_status make_index(struct fv_web_player *player, struct fovea_error *damage,
                                    struct fovea_error *error)
{
    struct fv_lcmlog_event event;
    enum fovea_status status;
    bool ended = false;
    player->stride = 1;
    player->last_us = INT64_MIN;
    damage->text[0] = '\0';
    while ((status = fv_lcmlog_skim(player->log, &event, damage)) == FOVEA_OK) {
        if ((status = check_stamp(player, &event, damage)) != FOVEA_OK) break;
        if (fv_lcmlog_channel_is(event.channel, "FRAME")) index_frame(player, &event);
        ended = fv_lcmlog_channel_is(event.channel, "RECORDING_END");
    }
    player->end = status == FOVEA_END ? INT64_MAX : event.offset;
    if (status == FOVEA_END && !ended)
        fovea_error_set(damage, FOVEA_ERROR_INPUT,
                        "%s: found no end of the recording, expected one: it is cut off",
                        player->path);
    else if (status == FOVEA_END)
        damage->text[0] = '\0';
    if (player->count > 0) return fv_lcmlog_seek(player->log, player->places[0].offset, error);
    if (status != FOVEA_END) *error = *damage;
    return status != FOVEA_END
               ? status
               : fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%s: found no frame in the recording, expected one", player->path);
}

enum fovea_status fv_web_player_open(const char *path, struct fv_web_player **player,
                                     struct fovea_error *damage, struct fovea_error *error)
{
    struct fv_web_player *opened = calloc(1, sizeof *opened);
    *player = NULL;
    if (opened != NULL) opened->path = strdup(path);
    if (opened == NULL || opened->path == NULL) {
        free(opened);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory to play it", path);
    }
    enum fovea_status status = fv_lcmlog_open(path, &opened->log, error);
    if (status == FOVEA_OK) status = read_header(opened, error);
    if (status == FOVEA_OK) { /* the header may hold a state: its memory is given back */
        fv_lcmlog_close(opened->log);
        opened->log = NULL;
        status = fv_lcmlog_open(path, &opened->log, error);
    }
    if (status == FOVEA_OK) status = make_index(opened, damage, error);
    if (status != FOVEA_OK) {
        fv_web_player_close(opened);
        return status;
    }
    opened->speed = 1.0;
    opened->media_us = opened->places[0].time_us;
    opened->now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    opened->jumped = true;
    *player = opened;
    return FOVEA_OK;
}

void fv_web_player_close(struct fv_web_player *player)
{
    if (player == NULL) return;
    if (player->log != NULL) fv_lcmlog_close(player->log);
    free(player->run_data);
    free(player->path);
    free(player);
}

const char *fv_web_player_prefix(const struct fv_web_player *player)
{
    return player->prefix;
}

const struct fv_feed_message *fv_web_player_run(const struct fv_web_player *player)
{
    return &player->run;
}

/* ---- playing --------------------------------------------------------------------------------- */

static void advance(struct fv_web_player *player, int64_t now_ns)
{
    if (!player->paused)
        player->media_us += (int64_t)((double)(now_ns - player->now_ns) * 1e-3 * player->speed);
    player->now_ns = now_ns;
}

static void stop(struct fv_web_player *player, const char *why)
{
    player->paused = true;
    player->media_us = player->last_us;
    snprintf(player->damage, sizeof player->damage, "%.159s", why);
}

/* Read the next event. False: the end, or damage. */
static bool read_event(struct fv_web_player *player)
{
    struct fovea_error error = {0};
    if (player->waits) return true;
    enum fovea_status status = fv_lcmlog_next(player->log, &player->event, &error);
    if (status == FOVEA_OK) status = check_stamp(player, &player->event, &error);
    const bool beyond = status == FOVEA_OK && player->event.offset >= player->end;
    if (status == FOVEA_OK && !beyond) return player->waits = true;
    stop(player, status == FOVEA_END || beyond ? "" : error.text);
    return false;
}

/* Whether the event is to be shown now: by the clock or, paused behind a jump, with its frame. */
static bool is_due(struct fv_web_player *player)
{
    const int64_t time_us = player->event.time_us;
    if (player->paused) return !player->shown;
    if (time_us - player->media_us > LEAP_US || player->media_us - time_us > LEAP_US)
        player->media_us = time_us;
    return time_us <= player->media_us;
}

enum fv_web_played fv_web_player_next(struct fv_web_player *player, int64_t now_ns,
                                      struct fv_web_player_out *out)
{
    struct fovea_error error;
    advance(player, now_ns);
    if (player->jumped) {
        player->jumped = false;
        return FV_WEB_PLAYED_JUMP;
    }
    if ((player->paused && player->shown) || !read_event(player) || !is_due(player))
        return FV_WEB_PLAYED_NOTHING;
    const struct fv_lcmlog_event *event = &player->event;
    player->waits = false;
    if (fv_lcmlog_channel_is(event->channel, "FRAME")) {
        if (fv_lcmlog_frame(player->path, event, &out->frame, &error) == FOVEA_OK)
            return FV_WEB_PLAYED_FRAME;
        stop(player, error.text);
        return FV_WEB_PLAYED_NOTHING;
    }
    if (fv_lcmlog_channel_is(event->channel, "GRANTS")) {
        player->shown = true;
        return FV_WEB_PLAYED_WORK;
    }
    memcpy(out->message.channel, event->channel, sizeof out->message.channel);
    out->message.data = event->data;
    out->message.bytes = event->bytes;
    return FV_WEB_PLAYED_MESSAGE;
}

void fv_web_player_state(const struct fv_web_player *player, struct fv_web_playback *state)
{
    const int64_t first_us = player->places[0].time_us;
    state->length_ms = (player->last_us - first_us) / 1000;
    state->position_ms = (player->media_us - first_us) / 1000;
    if (state->position_ms > state->length_ms) state->position_ms = state->length_ms;
    state->speed = player->speed;
    state->paused = player->paused;
    memcpy(state->damage, player->damage, sizeof state->damage);
}

void fv_web_player_pause(struct fv_web_player *player, bool paused)
{
    if (!paused && player->paused && player->media_us >= player->last_us)
        fv_web_player_seek(player, 0); /* at its end: from the start again */
    advance(player, fv_clock_ns(CLOCK_MONOTONIC));
    player->paused = paused;
}

void fv_web_player_speed(struct fv_web_player *player, double speed)
{
    advance(player, fv_clock_ns(CLOCK_MONOTONIC));
    player->speed = speed > speed_most          ? speed_most
                    : speed >= 1.0 / speed_most ? speed
                                                : 1.0 / speed_most;
}

void fv_web_player_seek(struct fv_web_player *player, int64_t position_ms)
{
    struct fovea_error error;
    struct fv_web_playback state;
    uint32_t at = 0;
    fv_web_player_state(player, &state);
    if (position_ms > state.length_ms) position_ms = state.length_ms;
    if (position_ms < 0) position_ms = 0;
    /* A position is in whole ms: the frame shown there may begin later within that ms. */
    const int64_t wanted_us = player->places[0].time_us + position_ms * 1000 + 999;
    for (uint32_t i = 0; i < player->count; i++)
        if (player->places[i].time_us <= wanted_us) at = i;
    if (fv_lcmlog_seek(player->log, player->places[at].offset, &error) != FOVEA_OK) {
        stop(player, error.text);
        return;
    }
    player->media_us = player->places[at].time_us;
    player->now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    player->jumped = true;
    player->waits = player->shown = false;
    player->damage[0] = '\0';
}
