#include "app/network/feed_source.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "app/network/feed_reader.h"
#include "drivers/clock.h"

static const int64_t look_ns = 10000000, first_ns = 10000000000;

struct fovea_source {
    struct fv_feed_reader *reader;
    struct fovea_source_info info;
    struct fv_feed_frame frame; /* the newest that was read */
    const uint8_t *images;
    bool waits; /* it has not been given out */
    bool held, ended;
    uint64_t delivered, frames_max; /* 0: no limit */
};

/* The next frame, looked for until then. */
static enum fovea_status await_frame(struct fovea_source *source, int64_t deadline_ns)
{
    const struct timespec pause = fv_clock_timespec(look_ns);
    struct fv_feed_message message;
    for (;;) {
        if (fv_feed_reader_frame(source->reader, &source->frame, &source->images) == FOVEA_OK)
            return FOVEA_OK;
        enum fovea_status status;
        do /* messages are not looked at; the end of the run comes behind them */
            status = fv_feed_reader_next(source->reader, &message);
        while (status == FOVEA_OK);
        if (status == FOVEA_END) return FOVEA_END;
        if (fv_clock_ns(CLOCK_MONOTONIC) >= deadline_ns) return FOVEA_AGAIN;
        nanosleep(&pause, NULL);
    }
}

/* False: it holds nothing that a source may give. */
static bool learn(struct fovea_source *source)
{
    const struct fv_feed_frame *frame = &source->frame;
    struct fovea_source_info *info = &source->info;
    if (frame->image_count < 1 || frame->image_count > FOVEA_CAMERAS_MAX) return false;
    info->rig.camera_count = frame->image_count;
    info->format = (enum fovea_pixel_format)frame->images[0].format;
    for (uint32_t i = 0; i < frame->image_count; i++) {
        if (frame->images[i].bytes == 0) return false;
        info->cameras[i] = (struct fovea_source_camera){.width = frame->images[i].width,
                                                        .height = frame->images[i].height};
    }
    info->live = true;
    info->rate_hz = FV_FEED_SOURCE_RATE_HZ;
    info->heap_bytes = sizeof *source;
    return true;
}

static void feed_close(struct fovea_source *source)
{
    fv_feed_reader_close(source->reader);
    free(source);
}

static enum fovea_status feed_open(const char *address,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_source **source, struct fovea_error *error)
{
    if (selection->start != 0 || selection->step != 1 || selection->reverse)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "feed: found start, step or reverse, expected none: a run gives its "
                               "frames as they come");
    struct fovea_source *made = calloc(1, sizeof *made);
    if (made == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "feed: out of memory");
    made->frames_max = selection->frames;
    enum fovea_status status =
        fv_feed_reader_open(address, 1000 * FV_FEED_SOURCE_RATE_HZ, &made->reader, error);
    if (status == FOVEA_OK) {
        const int64_t until_ns = fv_clock_ns(CLOCK_MONOTONIC) + first_ns;
        do
            status = await_frame(made, until_ns);
        while (status == FOVEA_OK && !learn(made));
        made->waits = status == FOVEA_OK;
        if (status != FOVEA_OK)
            status = fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                     "%s: found no picture of the run within 10 s, expected one "
                                     "(web.picture_rate)",
                                     address);
    }
    if (status != FOVEA_OK) {
        feed_close(made);
        return status;
    }
    *source = made;
    return FOVEA_OK;
}

static const struct fovea_source_info *feed_info(const struct fovea_source *source)
{
    return &source->info;
}

static enum fovea_status feed_start(struct fovea_source *source, struct fovea_error *error)
{
    (void)source;
    (void)error;
    return FOVEA_OK;
}

/* Cameras that gave no image, one of another size, or one that is none have none: what stands in
 * the feed is another program's. */
static void hand_out(const struct fovea_source *source, struct fovea_frame *to)
{
    const struct fv_feed_frame *frame = &source->frame;
    *to = (struct fovea_frame){.stamp_ns = frame->stamp_ns,
                               .clock = (enum fovea_clock)frame->clock,
                               .sequence = (uint64_t)frame->sequence,
                               .image_count = source->info.rig.camera_count};
    for (uint32_t i = 0; i < to->image_count && i < frame->image_count; i++) {
        const struct fv_feed_image *image = &frame->images[i];
        if (image->bytes == 0 || image->width != source->info.cameras[i].width ||
            image->height != source->info.cameras[i].height ||
            image->format != (int32_t)source->info.format)
            continue;
        const struct fovea_image seen = {.data = source->images + image->offset,
                                         .width = image->width,
                                         .height = image->height,
                                         .stride_bytes = image->stride_bytes,
                                         .format = source->info.format,
                                         .size_bytes = image->bytes};
        if (fovea_image_check(&seen) == FOVEA_OK) to->images[i] = seen;
    }
}

static enum fovea_status feed_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                      struct fovea_frame *frame)
{
    if (source->ended || (source->frames_max > 0 && source->delivered == source->frames_max))
        return FOVEA_END;
    if (source->held) return FOVEA_AGAIN;                            /* the reader has one copy */
    const int64_t soon_ns = fv_clock_ns(CLOCK_MONOTONIC) + first_ns; /* a signal is looked at */
    const enum fovea_status status =
        source->waits ? FOVEA_OK
                      : await_frame(source, deadline_ns < soon_ns ? deadline_ns : soon_ns);
    source->ended = status == FOVEA_END;
    if (status != FOVEA_OK) return status;
    source->waits = false;
    source->held = true;
    source->delivered++;
    hand_out(source, frame);
    return FOVEA_OK;
}

static void feed_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    (void)frame;
    source->held = false;
}

static void feed_stop(struct fovea_source *source)
{
    source->held = false;
}

const struct fovea_source_ops fv_source_feed = {
    .name = "feed",
    .help = "SOCKET  the pictures of a run on this host (its key web.socket)",
    .open = feed_open,
    .info = feed_info,
    .start = feed_start,
    .dequeue = feed_dequeue,
    .requeue = feed_requeue,
    .stop = feed_stop,
    .close = feed_close,
};
