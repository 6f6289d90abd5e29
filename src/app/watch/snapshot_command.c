/* fovea snapshot: the newest preview of a running robot, or a raw frame of its feed, as a file. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "app/config/options.h"
#include "app/watch/bus.h"
#include "app/watch/commands.h"
#include "app/watch/frame_image.h"
#include "drivers/clock.h"
#include "support/decode.h"
#include "support/files.h"
#include "support/output.h"
#include "support/picture.h"

#include "fovea_preview_t.h"

enum { FRAMES_PER_1000_S = 20000 };

/* The first whole picture that came. */
struct snapshot {
    bool taken;
    uint64_t damaged;
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    fovea_stamp_t stamp;
    double scale;
    struct fovea_image image; /* grey levels, owned */
    uint8_t *jpeg;            /* as it came, owned */
    size_t jpeg_bytes;
};

/* Decoded before it is kept: what a network sends may be no picture. */
static bool decode(struct snapshot *snapshot, const fovea_preview_t *preview)
{
    struct fovea_error error;
    struct fv_decode_image to = {0};
    const size_t bytes = (size_t)preview->size_bytes;
    if (bytes < 2 || preview->jpeg[0] != 0xff || preview->jpeg[1] != 0xd8 ||
        fv_decode_probe(preview->jpeg, bytes, &to.width, &to.height, &error) != FOVEA_OK)
        return false;
    to.stride_bytes = to.width;
    to.pixels = malloc((size_t)to.width * (size_t)to.height);
    uint8_t *copy = malloc(bytes);
    if (to.pixels == NULL || copy == NULL ||
        fv_decode(preview->jpeg, bytes, &to, &error) != FOVEA_OK) {
        free(to.pixels);
        free(copy);
        return false;
    }
    memcpy(copy, preview->jpeg, bytes);
    snapshot->jpeg = copy;
    snapshot->jpeg_bytes = bytes;
    snapshot->image = (struct fovea_image){.data = to.pixels,
                                           .width = to.width,
                                           .height = to.height,
                                           .stride_bytes = to.stride_bytes,
                                           .format = FOVEA_PIXEL_GREY8,
                                           .size_bytes = (size_t)to.width * (size_t)to.height};
    return true;
}

static void take(void *context, const struct fv_received *received)
{
    struct snapshot *snapshot = context;
    fovea_preview_t preview;
    if (snapshot->taken ||
        fovea_preview_t_decode(received->data, 0, (int)received->bytes, &preview) < 0)
        return;
    snapshot->taken = decode(snapshot, &preview);
    if (snapshot->taken) {
        snprintf(snapshot->channel, sizeof snapshot->channel, "%s", received->channel);
        snapshot->stamp = preview.stamp;
        snapshot->scale = preview.scale;
    } else {
        snapshot->damaged++;
    }
    fovea_preview_t_decode_cleanup(&preview);
}

static bool ends_in(const char *path, const char *end)
{
    const size_t length = strlen(path), tail = strlen(end);
    return length > tail && strcasecmp(path + length - tail, end) == 0;
}

static enum fovea_status write_jpeg(const struct snapshot *snapshot, const char *path,
                                    struct fovea_error *error)
{
    struct fv_output output;
    enum fovea_status status = fv_output_open(&output, path, FV_OUTPUT_WHOLE, error);
    if (status != FOVEA_OK) return status;
    FILE *stream = fv_output_stream(&output);
    errno = stream != NULL ? 0 : ENOMEM;
    if (stream != NULL &&
        fwrite(snapshot->jpeg, 1, snapshot->jpeg_bytes, stream) == snapshot->jpeg_bytes)
        return fv_output_close(&output, error);
    const int reason = errno;
    fv_output_discard(&output);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: cannot be written: %s", path,
                           strerror(reason));
}

/* PNG where the name says so, else the JPEG as it was sent. */
static enum fovea_status write_picture(const struct snapshot *snapshot, const char *path,
                                       struct fovea_error *error)
{
    if (ends_in(path, ".png")) return fv_picture_write(path, &snapshot->image, error);
    return write_jpeg(snapshot, path, error);
}

static void tell(const struct snapshot *snapshot, const char *path)
{
    printf("%s: %d x %d pixels of %s, frame %" PRId64 " at %.3f s, %.3g raw pixels each\n", path,
           snapshot->image.width, snapshot->image.height, snapshot->channel,
           snapshot->stamp.sequence, (double)snapshot->stamp.time_ns * 1e-9, snapshot->scale);
}

/* A raw frame, where the feed has one. */
static enum fovea_status take_frame(struct fv_bus *bus, struct snapshot *snapshot,
                                    struct fovea_error *error)
{
    struct fv_feed_frame frame;
    const uint8_t *images;
    if (fv_feed_reader_frame(bus->reader, &frame, &images) != FOVEA_OK) return FOVEA_OK;
    snprintf(snapshot->channel, sizeof snapshot->channel, "%s", "cam0");
    snapshot->stamp.time_ns = frame.stamp_ns;
    snapshot->stamp.sequence = frame.sequence;
    snapshot->scale = 1;
    snapshot->taken = true;
    return fv_frame_image(&frame, images, 0, &snapshot->image, error);
}

/* Listen until a picture has come. */
static enum fovea_status wait_for(struct fv_bus *bus, struct snapshot *snapshot, uint64_t timeout_s,
                                  struct fovea_error *error)
{
    const int64_t until_ns = fv_clock_ns(CLOCK_MONOTONIC) + (int64_t)timeout_s * FV_SECOND_NS;
    enum fovea_status status = FOVEA_OK;
    while (status == FOVEA_OK && !snapshot->taken && !fv_bus_ended() &&
           fv_clock_ns(CLOCK_MONOTONIC) < until_ns) {
        const int64_t look_ns = fv_clock_ns(CLOCK_MONOTONIC) + FV_SECOND_NS / 50;
        const bool raw = bus->frames_per_1000_s > 0;
        fv_bus_wait(bus, raw && look_ns < until_ns ? look_ns : until_ns);
        if (raw) status = take_frame(bus, snapshot, error);
    }
    return status != FOVEA_OK || snapshot->taken ? status : FOVEA_END;
}

static enum fovea_status prepare(struct fv_bus *bus, const char *prefix, const char *path,
                                 struct snapshot *snapshot, struct fovea_error *error)
{
    char channel[FV_MESSAGE_CHANNEL_BYTES + 1];
    struct fv_receiver_channel row;
    const struct fv_file written[] = {{"FILE", path}, {0}};
    const char *blame;
    if (!ends_in(path, ".jpg") && !ends_in(path, ".jpeg") && !ends_in(path, ".png"))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found %.300s, expected a name that ends in .jpg, .jpeg or .png",
                               path);
    snprintf(channel, sizeof channel, "%.55s_PREVIEW", prefix);
    enum fovea_status status = fv_bus_row(channel, &row, error);
    if (status == FOVEA_OK) status = fv_files_writable(written, &blame, error);
    if (status != FOVEA_OK) return status;
    row.type = "fovea.preview_t";
    row.take = take;
    row.context = snapshot;
    /* A feed has the frames themselves: a PNG is one of them, a JPEG the preview as it was sent. */
    const bool raw = bus->feed != NULL && ends_in(path, ".png");
    if (raw) bus->frames_per_1000_s = FRAMES_PER_1000_S;
    return fv_bus_open(bus, &row, raw ? 0 : 1, error);
}

int fv_command_snapshot(int argc, char **argv)
{
    struct fv_bus bus = {0};
    struct snapshot snapshot = {0};
    const char *prefix = "*";
    uint64_t timeout_s = 10;
    const struct fv_option options[] = {
        {"prefix", "PREFIX", FV_OPTION_TEXT, &prefix,
         "of the robot's channels, or a pattern with * and ? (default *, any)"},
        {"timeout", "SECONDS", FV_OPTION_POSITIVE, &timeout_s,
         "give up when no picture has come for so long (default 10)"},
        FV_BUS_OPTIONS(bus),
        {0},
    };
    int first;
    struct fovea_error error;
    const enum fv_options_result result =
        fv_options_parse(options, "FILE", 1, 1, argc, argv, &first);
    if (result != FV_OPTIONS_READ) return result == FV_OPTIONS_HELP ? FV_EXIT_OK : FV_EXIT_WRONG;
    if (timeout_s > 1000000) timeout_s = 1000000;
    enum fovea_status status = prepare(&bus, prefix, argv[first], &snapshot, &error);
    if (status == FOVEA_OK) status = wait_for(&bus, &snapshot, timeout_s, &error);
    fv_bus_close(&bus);
    if (status == FOVEA_END)
        return bus.feed != NULL
                   ? fv_say_failed("fovea snapshot: %s: no picture came (web.picture_rate and "
                                   "preview.period_frames: 0 send none)",
                                   bus.feed)
                   : fv_say_failed("fovea snapshot: no picture came, and %" PRIu64
                                   " that are none ('fovea check' says what keeps messages back; "
                                   "preview.period_frames: 0 sends none)",
                                   snapshot.damaged);
    if (status == FOVEA_OK) {
        status = write_picture(&snapshot, argv[first], &error);
        if (status == FOVEA_OK) tell(&snapshot, argv[first]);
    }
    free((void *)(uintptr_t)snapshot.image.data);
    free(snapshot.jpeg);
    if (status == FOVEA_OK) return FV_EXIT_OK;
    return status == FOVEA_ERROR_INPUT ? fv_say_wrong("fovea snapshot: %s", error.text)
                                       : fv_say_failed("fovea snapshot: %s", error.text);
}
