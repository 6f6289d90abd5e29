/* The feed of a run of this host, as a source of the relay. */
#include <stdio.h>
#include <string.h>

#include "app/watch/frame_image.h"
#include "drivers/clock.h"
#include "support/say.h"
#include "web/relay.h"

enum {
    MESSAGES_PER_TICK = 200,
    TRIES_SAID = 20 /* a run that begins needs some seconds */
};
#define TRY_NS (FV_SECOND_NS / 2)

/* ---- frames ---------------------------------------------------------------------------------- */

/* Nanoseconds since the frame's stamp; -1: its clock is none of this host. */
static int64_t age_of(const struct fv_feed_frame *frame)
{
    const clockid_t clocks[] = {CLOCK_MONOTONIC, CLOCK_BOOTTIME, CLOCK_REALTIME};
    if (frame->clock < 0 || frame->clock >= (int32_t)(sizeof clocks / sizeof clocks[0])) return -1;
    const int64_t age_ns = fv_clock_ns(clocks[frame->clock]) - frame->stamp_ns;
    return age_ns >= 0 && age_ns < 60 * FV_SECOND_NS ? age_ns : -1; /* one that is played */
}

/* The pictures of the further cameras that somebody looks at. */
static void take_others(struct fv_web_relay *relay, const struct fv_feed_frame *frame,
                        const uint8_t *images)
{
    struct fv_web_store *store = relay->store;
    for (uint32_t camera = 1; camera < frame->image_count && camera < FOVEA_CAMERAS_MAX; camera++) {
        struct fovea_image image;
        if ((relay->cameras >> camera & 1) == 0 ||
            fv_frame_image(frame, images, camera, &image, NULL) != FOVEA_OK)
            continue;
        fv_web_picture_take(fv_web_store_picture(store, camera), &image, frame->stamp_ns,
                            frame->sequence, age_of(frame));
    }
}

static bool take_frame(struct fv_web_relay *relay)
{
    struct fv_feed_frame frame;
    const uint8_t *images;
    struct fovea_image image;
    if (fv_feed_reader_frame(relay->reader, &frame, &images) != FOVEA_OK) return false;
    fv_web_relay_cameras(relay, frame.image_count);
    take_others(relay, &frame, images);
    if (fv_frame_image(&frame, images, 0, &image, NULL) != FOVEA_OK) return relay->cameras > 1;
    fv_web_relay_picture(relay, &image, frame.stamp_ns, frame.sequence, age_of(&frame));
    return true;
}

/* ---- the run --------------------------------------------------------------------------------- */

/* Once, when it lasts: there may be a run whose feed this user may not read. Whether it was said.
 */
static bool say_why_not(struct fv_web_relay *relay, const char *text)
{
    char why_not[sizeof relay->why_not];
    snprintf(why_not, sizeof why_not, "%.*s", (int)sizeof why_not - 1, text);
    if (strcmp(why_not, relay->why_not) != 0) relay->tries = 0;
    memcpy(relay->why_not, why_not, sizeof why_not);
    if (relay->tries > TRIES_SAID || ++relay->tries != TRIES_SAID) return false;
    fv_say("fovea-web: %s", why_not);
    fv_web_store_log(relay->store, fv_clock_ns(CLOCK_REALTIME) / 1000, "%s", why_not);
    return true;
}

/* Whether the store has changed. */
static bool connect_run(struct fv_web_relay *relay)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    struct fovea_error error;
    if (now_ns < relay->next_try_ns) return false;
    relay->next_try_ns = now_ns + TRY_NS;
    if (fv_feed_reader_open(relay->path, 0, &relay->reader, &error) != FOVEA_OK)
        return say_why_not(relay, error.text);
    relay->wished = relay->tries = 0;
    relay->why_not[0] = '\0';
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    fv_feed_reader_prefix(relay->reader, prefix);
    fv_web_relay_begin(relay, prefix);
    fv_web_store_log(relay->store, fv_clock_ns(CLOCK_REALTIME) / 1000, "run %016llx found",
                     (unsigned long long)fv_feed_reader_run(relay->reader));
    return true;
}

static void wish(struct fv_web_relay *relay, bool watched)
{
    const uint32_t wished = watched ? relay->rate_per_1000_s : 0;
    if (wished == relay->wished) return;
    if (fv_feed_reader_wish(relay->reader, wished)) relay->wished = wished;
}

static void close_run(struct fv_web_relay *relay)
{
    fv_feed_reader_close(relay->reader);
    relay->reader = NULL;
}

static bool tick(struct fv_web_relay *relay, bool watched)
{
    struct fv_feed_message message;
    bool changed = false;
    if (relay->reader == NULL) {
        changed = connect_run(relay);
        if (relay->reader == NULL) return changed;
    }
    wish(relay, watched);
    for (int i = 0; i < MESSAGES_PER_TICK; i++) {
        const enum fovea_status status = fv_feed_reader_next(relay->reader, &message);
        if (status == FOVEA_OK) fv_web_relay_take(relay, &message, watched);
        if (status == FOVEA_END) {
            fv_web_relay_silent(relay);
            close_run(relay);
            return true;
        }
        if (status != FOVEA_OK) break;
    }
    return (watched && take_frame(relay)) || changed;
}

const struct fv_web_relay_source fv_web_relay_feed = {"the run has ended", tick, close_run};
