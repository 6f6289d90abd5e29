#include "web/heard.h"

#include <stdlib.h>
#include <string.h>

#include "app/network/transport_url.h"
#include "drivers/clock.h"
#include "support/decode.h"

#include "fovea_preview_t.h"
#include "fovea_run_t.h"

enum { SIDE_MAX = 4096 }; /* of a picture */
#define SILENT_NS (3 * FV_SECOND_NS)

/* ---- pictures -------------------------------------------------------------------------------- */

/* The preview at the size of the raw image, whose pixels messages speak of: each takes the
 * preview's nearest. False: no JPEG of that size, or no memory. */
static bool enlarge(const fovea_preview_t *preview, struct fovea_image *image)
{
    struct fv_decode_image small = {.width = preview->width, .height = preview->height};
    const double width = preview->width * preview->scale, height = preview->height * preview->scale;
    int32_t found_width, found_height;
    if (!(width >= 1 && width <= SIDE_MAX && height >= 1 && height <= SIDE_MAX) ||
        preview->width < 1 || preview->height < 1 || preview->width > SIDE_MAX ||
        preview->height > SIDE_MAX ||
        fv_decode_probe(preview->jpeg, (size_t)preview->size_bytes, &found_width, &found_height,
                        NULL) != FOVEA_OK ||
        found_width != preview->width || found_height != preview->height)
        return false;
    const int32_t columns = (int32_t)(width + 0.5), rows = (int32_t)(height + 0.5);
    small.stride_bytes = small.width;
    small.pixels = malloc((size_t)small.width * (size_t)small.height);
    uint8_t *pixels = malloc((size_t)columns * (size_t)rows);
    const bool decoded =
        small.pixels != NULL && pixels != NULL &&
        fv_decode(preview->jpeg, (size_t)preview->size_bytes, &small, NULL) == FOVEA_OK;
    for (int32_t y = 0; decoded && y < rows; y++) {
        const int32_t from_y = (int32_t)((int64_t)y * small.height / rows);
        for (int32_t x = 0; x < columns; x++)
            pixels[(size_t)y * (size_t)columns + (size_t)x] =
                small.pixels[(size_t)from_y * (size_t)small.width +
                             (size_t)((int64_t)x * small.width / columns)];
    }
    free(small.pixels);
    if (!decoded) {
        free(pixels);
        return false;
    }
    *image = (struct fovea_image){.data = pixels,
                                  .width = columns,
                                  .height = rows,
                                  .stride_bytes = columns,
                                  .format = FOVEA_PIXEL_GREY8,
                                  .size_bytes = (size_t)columns * (size_t)rows};
    return true;
}

static void show(struct fv_web_relay *relay, uint32_t camera, const fovea_preview_t *preview,
                 const struct fovea_image *image)
{
    const fovea_stamp_t *stamp = &preview->stamp;
    if (camera == 0)
        fv_web_relay_picture(relay, image, stamp->time_ns, stamp->sequence, -1);
    else
        fv_web_picture_take(fv_web_store_picture(relay->store, camera), image, stamp->time_ns,
                            stamp->sequence, -1);
}

/* A rig's cameras become known by their previews. */
static void take_preview(struct fv_web_heard *heard, const struct fv_received *received)
{
    fovea_preview_t preview;
    struct fovea_image image;
    if (fovea_preview_t_decode(received->data, 0, (int)received->bytes, &preview) < 0) return;
    struct fv_web_relay *relay = heard->relay;
    const uint32_t camera = (uint8_t)preview.camera, known = relay->store->cameras;
    if (camera < FOVEA_CAMERAS_MAX) {
        fv_web_relay_cameras(relay, camera < known ? known : camera + 1);
        const bool looked_at = camera == 0 || (relay->cameras >> camera & 1) != 0;
        if (looked_at && enlarge(&preview, &image)) show(relay, camera, &preview, &image);
    }
    fovea_preview_t_decode_cleanup(&preview);
}

/* ---- messages -------------------------------------------------------------------------------- */

/* Whether it is of another run than the messages before it. */
static bool is_other_run(struct fv_web_heard *heard, const struct fv_received *received)
{
    fovea_run_t run;
    if (!fv_lcmlog_channel_is(received->channel, "RUN") ||
        fovea_run_t_decode(received->data, 0, (int)received->bytes, &run) < 0)
        return false;
    const bool other = heard->run_id != 0 && run.run_id != heard->run_id;
    heard->run_id = run.run_id;
    fovea_run_t_decode_cleanup(&run);
    return other;
}

static void take(void *context, const struct fv_received *received)
{
    struct fv_web_heard *heard = context;
    struct fv_feed_message message = {.data = received->data, .bytes = received->bytes};
    if (is_other_run(heard, received) || heard->heard_ns == 0)
        fv_web_relay_begin(heard->relay, heard->prefix);
    heard->heard_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (fv_lcmlog_channel_is(received->channel, "PREVIEW") && heard->watched)
        take_preview(heard, received);
    memcpy(message.channel, received->channel, strlen(received->channel) + 1);
    fv_web_relay_take(heard->relay, &message, heard->watched);
}

static bool hear(struct fv_web_heard *heard, bool watched)
{
    heard->watched = watched;
    const bool any = fv_receiver_handle(heard->receiver, 0) > 0;
    if (any || heard->heard_ns == 0 || fv_clock_ns(CLOCK_MONOTONIC) - heard->heard_ns < SILENT_NS)
        return any;
    heard->heard_ns = 0;
    heard->run_id = 0;
    fv_web_relay_silent(heard->relay);
    return true;
}

/* ---- opening --------------------------------------------------------------------------------- */

enum fovea_status fv_web_heard_open(struct fv_web_heard *heard, struct fv_web_relay *relay,
                                    const char *url, const char *listen, const char *prefix,
                                    struct fovea_error *error)
{
    struct fv_receiver_channel rows[FV_RECEIVER_CHANNELS_MAX];
    uint32_t count = 0;
    memset(heard, 0, sizeof *heard);
    if (strlen(prefix) > 31)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--prefix: found %zu bytes, expected at most 31", strlen(prefix));
    if (!fv_receiver_listen_valid(listen))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--listen: found \"%.40s\", expected loopback, an interface or any",
                               listen);
    enum fovea_status status = fv_transport_url_check(url, error);
    if (status != FOVEA_OK) return status;
    heard->relay = relay;
    memcpy(heard->prefix, prefix, strlen(prefix) + 1);
    const char *type;
    for (const char *name; (name = fv_web_relay_shows(count, &type)) != NULL; count++) {
        rows[count] = (struct fv_receiver_channel){
            .type = type, .bytes_max = FV_RECEIVER_BYTES_MAX, .take = take, .context = heard};
        snprintf(rows[count].name, sizeof rows[count].name, "%s%s%s", prefix,
                 prefix[0] != '\0' ? "_" : "", name);
    }
    const struct fv_receiver_setup setup = {url, listen, rows, count};
    status = fv_receiver_open(&setup, &heard->receiver, error);
    if (status == FOVEA_OK && heard->receiver == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "--lcm: found %.200s and --listen %.40s, of which nothing can be "
                                 "heard, expected udpm:// or tcpq://, and not none",
                                 url, listen);
    return status;
}

void fv_web_heard_close(struct fv_web_heard *heard)
{
    fv_receiver_close(heard->receiver);
    heard->receiver = NULL;
}

/* ---- as a source of the relay ---------------------------------------------------------------- */

static bool tick(struct fv_web_relay *relay, bool watched)
{
    return hear(relay->heard, watched);
}

static void nothing_to_close(struct fv_web_relay *relay)
{
    (void)relay; /* the caller's */
}

const struct fv_web_relay_source fv_web_relay_robot = {"the robot is silent", tick,
                                                       nothing_to_close};
