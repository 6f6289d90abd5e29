/* A recording in the place of a feed, as a source of the relay. */
#include <stdlib.h>
#include <string.h>

#include "app/watch/frame_image.h"
#include "drivers/clock.h"
#include "web/relay.h"

enum { MESSAGES_PER_TICK = 200 };

static void drop_played(struct fv_web_relay *relay)
{
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++) {
        free((void *)(uintptr_t)relay->played[i].data);
        relay->played[i].data = NULL;
    }
}

/* A camera's picture of the frame, for when the messages that go with it have come. */
static void hold_picture(struct fv_web_relay *relay, const struct fovea_frame *frame,
                         uint32_t camera)
{
    const struct fovea_image *from = &frame->images[camera];
    struct fv_feed_frame head = {.stamp_ns = frame->stamp_ns, .image_count = frame->image_count};
    head.images[camera] = (struct fv_feed_image){
        from->width, from->height, from->stride_bytes, (int32_t)from->format, 0, from->size_bytes};
    if (from->data == NULL ||
        fv_frame_image(&head, from->data, camera, &relay->played[camera], NULL) != FOVEA_OK)
        relay->played[camera].data = NULL;
}

/* Its pictures of the cameras that somebody looks at, unless those before were shown a moment ago.
 */
static void hold_frame(struct fv_web_relay *relay, const struct fovea_frame *frame, bool watched)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    fv_web_relay_cameras(relay, frame->image_count);
    drop_played(relay);
    if (!watched || now_ns - relay->picture_ns < FV_SECOND_NS * 1000 / relay->rate_per_1000_s)
        return;
    for (uint32_t i = 0; i < frame->image_count && i < FOVEA_CAMERAS_MAX; i++)
        if (i == 0 || (relay->cameras >> i & 1) != 0) hold_picture(relay, frame, i);
    relay->picture_ns = now_ns;
    relay->played_stamp_ns = frame->stamp_ns;
    relay->played_sequence = (int64_t)frame->sequence;
}

/* They become the store's. */
static bool show_held(struct fv_web_relay *relay)
{
    bool any = false;
    for (uint32_t i = 0; i < FOVEA_CAMERAS_MAX; i++) {
        struct fovea_image *image = &relay->played[i];
        if (image->data == NULL) continue;
        if (i == 0)
            fv_web_relay_picture(relay, image, relay->played_stamp_ns, relay->played_sequence, -1);
        else
            fv_web_picture_take(fv_web_store_picture(relay->store, i), image,
                                relay->played_stamp_ns, relay->played_sequence, -1);
        image->data = NULL;
        any = true;
    }
    return any;
}

/* Somebody looks at another camera while the recording is paused: its picture of this position. */
static void look_again(struct fv_web_relay *relay)
{
    struct fv_web_playback state;
    const uint32_t more = relay->cameras & ~relay->played_cameras;
    relay->played_cameras = relay->cameras;
    if (more == 0) return;
    fv_web_player_state(relay->player, &state);
    if (state.paused) fv_web_player_seek(relay->player, state.position_ms);
}

static void tell_playback(struct fv_web_relay *relay)
{
    struct fv_web_playback state = {0};
    fv_web_player_state(relay->player, &state);
    if (state.damage[0] != '\0' && strcmp(state.damage, relay->store->playback.damage) != 0)
        fv_web_store_log(relay->store, fv_clock_ns(CLOCK_REALTIME) / 1000, "%s", state.damage);
    relay->store->playback = state;
    relay->store->playback_version++;
}

static bool tick(struct fv_web_relay *relay, bool watched)
{
    struct fv_web_player_out out;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    bool changed = false;
    look_again(relay);
    for (int i = 0; i < MESSAGES_PER_TICK; i++) {
        const enum fv_web_played played = fv_web_player_next(relay->player, now_ns, &out);
        if (played == FV_WEB_PLAYED_NOTHING) break;
        if (played == FV_WEB_PLAYED_MESSAGE) fv_web_relay_take(relay, &out.message, watched);
        if (played == FV_WEB_PLAYED_FRAME) hold_frame(relay, &out.frame, watched);
        if (played == FV_WEB_PLAYED_WORK) changed |= show_held(relay);
        if (played != FV_WEB_PLAYED_JUMP) continue;
        drop_played(relay);
        relay->picture_ns = 0;
        fv_web_relay_begin(relay, fv_web_player_prefix(relay->player));
        if (fv_web_player_run(relay->player)->bytes > 0)
            fv_web_relay_take(relay, fv_web_player_run(relay->player), watched);
        relay->told_ns = 0;
    }
    if (now_ns - relay->told_ns >= FV_SECOND_NS / 4) {
        relay->told_ns = now_ns;
        tell_playback(relay);
        changed = true;
    }
    return changed;
}

const struct fv_web_relay_source fv_web_relay_recording = {"the recording has ended", tick,
                                                           drop_played};
