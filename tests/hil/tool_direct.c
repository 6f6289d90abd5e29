/* hil-tool direct RECORDING FRAMES OUT
 * A recording of `fovea run` on a camera with its pictures taken from FRAMES (raw grey, as fed to
 * the camera) instead, in the same order: what the runtime would have recorded had these been fed
 * directly. Fails when a recorded picture is none of those, when other pictures lie between two of
 * them than the driver's numbers say (so also when they are out of order), or when more were passed
 * over than half of FRAMES holds. `fovea replay OUT --verify` then says whether the messages are
 * those of the camera. */
#include "tool.h"

#include <arpa/inet.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/lcmlog.h"
#include "fovea_frame_t.h"

/* The rows of the recorded frame are those of the picture. */
static bool same(const fovea_image_t *image, const uint8_t *data, const uint8_t *picture)
{
    for (int32_t y = 0; y < image->height; y++)
        if (memcmp(data + (ptrdiff_t)y * image->stride_bytes, picture + (ptrdiff_t)y * image->width,
                   (size_t)image->width) != 0)
            return false;
    return true;
}

static void put_event(FILE *out, const struct fv_lcmlog_event *event, const uint8_t *data)
{
    const uint32_t name_bytes = (uint32_t)strlen(event->channel);
    const uint64_t number = (uint64_t)event->number, time_us = (uint64_t)event->time_us;
    const uint32_t head[7] = {htonl(FV_LCMLOG_SYNC),    htonl((uint32_t)(number >> 32)),
                              htonl((uint32_t)number),  htonl((uint32_t)(time_us >> 32)),
                              htonl((uint32_t)time_us), htonl(name_bytes),
                              htonl(event->bytes)};
    if (fwrite(head, sizeof head, 1, out) != 1 || fwrite(event->channel, name_bytes, 1, out) != 1 ||
        fwrite(data, event->bytes, 1, out) != 1)
        tool_fail("cannot write");
}

int tool_direct(int argc, char **argv)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error = {.text = ""};
    struct tool_frames frames = {.data = NULL};
    if (argc != 4) tool_fail("usage: direct RECORDING FRAMES OUT");
    if (fv_lcmlog_open(argv[1], &log, &error) != FOVEA_OK) tool_fail("%s", error.text);
    FILE *out = fopen(argv[3], "wb");
    if (out == NULL) tool_fail("%s: cannot be written", argv[3]);
    size_t next = 0, replaced = 0, skipped = 0;
    int64_t last_number = 0;
    enum fovea_status status;
    while ((status = fv_lcmlog_next(log, &event, &error)) == FOVEA_OK) {
        uint8_t *data = malloc(event.bytes);
        memcpy(data, event.data, event.bytes);
        if (fv_lcmlog_channel_is(event.channel, "FRAME")) {
            fovea_frame_t frame;
            if (fovea_frame_t_decode(data, 0, (int)event.bytes, &frame) < 0)
                tool_fail("a frame cannot be decoded");
            const fovea_image_t *image = &frame.images[0]; /* of one camera */
            const size_t picture_bytes = (size_t)image->width * (size_t)image->height;
            if (frames.data == NULL) tool_frames_read(&frames, argv[2], picture_bytes);
            uint8_t *pixels = data + event.bytes - image->size_bytes;
            /* The camera begins anywhere in the circle of frames, and may lose some; the order
             * stays. */
            size_t k = 0;
            for (; k < frames.count; k++)
                if (same(image, pixels, frames.data + frames.at[(next + k) % frames.count])) break;
            if (k == frames.count) tool_fail("frame %zu is none of those fed", replaced);
            const size_t lost = (size_t)(frame.stamp.sequence - last_number - 1);
            /* v4l2loopback forgets the number of a frame that was there before the reader. */
            if (replaced > 1 && lost % frames.count != k)
                tool_fail("frame %zu: found %zu of those fed passed over, the driver says %zu",
                          replaced, k, lost);
            last_number = frame.stamp.sequence;
            if (replaced > 1) skipped += lost;
            next = (next + k) % frames.count;
            for (int32_t y = 0; y < image->height; y++)
                memcpy(pixels + (ptrdiff_t)y * image->stride_bytes,
                       frames.data + frames.at[next] + (ptrdiff_t)y * image->width,
                       (size_t)image->width);
            next = (next + 1) % frames.count;
            replaced++;
            fovea_frame_t_decode_cleanup(&frame);
        }
        put_event(out, &event, data);
        free(data);
    }
    if (status != FOVEA_END) tool_fail("%s", error.text);
    fclose(out);
    fv_lcmlog_close(log);
    printf("%zu frames replaced, %zu of those fed were not seen\n", replaced, skipped);
    return replaced > 0 && skipped <= frames.count / 2 ? 0 : 1;
}
