/* Videos, through a plug-in that is looked for beside the program, in ../lib/fovea of it, and first
 * of all in the folder that $FOVEA_PLUGINS names. Frames can only be read in order, so a start is
 * reached by skipping. In reverse the video is gone through once at open, for its length and
 * stamps, and then played by stretches: each is read forward and kept. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "kind.h"
#include "../plugin.h"
#include "support/decode.h"
#include "listing.h"
#include "player.h"
#include "video_plugin.h"

enum { KEPT_MAX = 64, KEPT_BYTES_MAX = 8 << 20 };

/* A frame of the stretch that is kept. */
struct kept {
    enum fovea_status status;
    struct fovea_error error;
    uint8_t *pixels; /* width x height */
};

struct recording {
    char *path;
    const struct fv_video_plugin *plugin;
    struct fv_video *video; /* NULL: it could not be opened again */
    uint64_t position;      /* of the next frame */
    int32_t width, height;

    /* In reverse only. */
    int64_t *stamps_ns;
    uint64_t count, capacity;
    uint64_t step;
    struct kept kept[KEPT_MAX];
    uint32_t room, kept_count;
    uint64_t first; /* kept: first, first + step, ... */
    uint8_t *pixels;
};

static void close_recording(void *argument)
{
    struct recording *recording = argument;
    if (recording->video != NULL) recording->plugin->close(recording->video);
    free(recording->stamps_ns);
    free(recording->pixels);
    free(recording->path);
    free(recording);
}

static enum fovea_status load(struct recording *recording, struct fovea_error *error)
{
    static const struct fv_plugin_name name = {.scheme = "video",
                                               .file = FV_VIDEO_PLUGIN_FILE,
                                               .symbol = FV_VIDEO_PLUGIN_SYMBOL,
                                               .package = "libopencv-videoio-dev",
                                               .version = FV_VIDEO_PLUGIN_VERSION};
    const void *table;
    const enum fovea_status status = fv_plugin_load(&name, &table, error);
    if (status == FOVEA_OK) recording->plugin = table;
    return status;
}

/* ---- frames ---------------------------------------------------------------------------------- */

static enum fovea_status open_video_file(struct recording *recording,
                                         struct fovea_source_info *info, struct fovea_error *error)
{
    recording->position = 0;
    return recording->plugin->open(recording->path, &recording->video, &info->cameras[0].width,
                                   &info->cameras[0].height, &info->rate_hz, error);
}

static enum fovea_status open_again(struct recording *recording, struct fovea_error *error)
{
    struct fovea_source_info again;
    if (recording->video != NULL) recording->plugin->close(recording->video);
    recording->video = NULL;
    return open_video_file(recording, &again, error);
}

/* Make frame `index` the next one. */
static enum fovea_status go_to(struct recording *recording, uint64_t index,
                               struct fovea_error *error)
{
    int64_t stamp_ns;
    if (index < recording->position || recording->video == NULL) {
        const bool sought = recording->video != NULL && recording->stamps_ns != NULL &&
                            recording->plugin->seek(recording->video, index,
                                                    recording->stamps_ns[index]) == FOVEA_OK;
        if (sought) recording->position = index;
        if (!sought && open_again(recording, error) != FOVEA_OK) return FOVEA_END;
    }
    for (; recording->position < index; recording->position++)
        if (recording->plugin->skip(recording->video, &stamp_ns) != FOVEA_OK) return FOVEA_END;
    return FOVEA_OK;
}

static void describe_frame(struct fovea_frame *frame, uint64_t index)
{
    frame->exposure_ns[0] = 0;
    frame->clock = FOVEA_CLOCK_RECORDED;
    frame->stamp_meaning = FOVEA_STAMP_UNKNOWN;
    frame->sequence = index;
}

static enum fovea_status fetch(void *argument, uint64_t index, struct fv_slot *slot,
                               struct fovea_error *error)
{
    struct recording *recording = argument;
    if (go_to(recording, index, error) != FOVEA_OK) return FOVEA_END;
    recording->position++;
    describe_frame(&slot->frame, index);
    return recording->plugin->read(recording->video, slot->pixels[0],
                                   slot->frame.images[0].stride_bytes, &slot->frame.stamp_ns,
                                   error);
}

static void visit_file(const void *recording, void (*visit)(void *context, const char *path),
                       void *context)
{
    visit(context, ((const struct recording *)recording)->path);
}

static const struct fv_recording_ops video_ops = {
    .fetch = fetch, .close = close_recording, .reads = visit_file};

/* ---- in reverse ------------------------------------------------------------------------------ */

/* Stamps of the first `most` frames (0: of all), and how many there are. */
static enum fovea_status find_stamps(struct recording *recording, uint64_t most,
                                     struct fovea_error *error)
{
    int64_t stamp_ns;
    while ((most == 0 || recording->count < most) &&
           recording->plugin->skip(recording->video, &stamp_ns) == FOVEA_OK) {
        if (recording->count == recording->capacity) {
            const size_t larger = recording->capacity == 0 ? 1024 : 2 * recording->capacity;
            int64_t *moved = realloc(recording->stamps_ns, larger * sizeof *moved);
            if (moved == NULL)
                return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                       "%s: out of memory for the stamps of its frames",
                                       recording->path);
            recording->stamps_ns = moved;
            recording->capacity = larger;
        }
        recording->stamps_ns[recording->count++] = stamp_ns;
    }
    recording->position = recording->count;
    if (recording->count > 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found no frame, expected at least one",
                           recording->path);
}

static enum fovea_status prepare_reverse(struct recording *recording,
                                         const struct fovea_source_selection *selection,
                                         struct fovea_source_info *info, struct fovea_error *error)
{
    const size_t bytes = (size_t)recording->width * (size_t)recording->height;
    uint64_t most = 0;
    if (__builtin_mul_overflow(selection->frames - 1, selection->step, &most) ||
        selection->frames == 0 || __builtin_add_overflow(most, selection->start + 1, &most))
        most = 0;
    const enum fovea_status status = find_stamps(recording, most, error);
    if (status != FOVEA_OK) return status;
    recording->step = selection->step;
    recording->room =
        bytes * KEPT_MAX <= KEPT_BYTES_MAX ? KEPT_MAX : (uint32_t)(KEPT_BYTES_MAX / bytes);
    if (recording->room == 0) recording->room = 1;
    recording->pixels = malloc(recording->room * bytes);
    if (recording->pixels == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory for %u frames",
                               recording->path, recording->room);
    for (uint32_t i = 0; i < recording->room; i++)
        recording->kept[i].pixels = recording->pixels + i * bytes;
    info->heap_bytes +=
        recording->room * bytes + recording->capacity * sizeof recording->stamps_ns[0];
    return FOVEA_OK;
}

/* Keep the stretch that ends with frame `last`. */
static void keep(struct recording *recording, uint64_t last)
{
    const uint64_t before = last / recording->step;
    recording->kept_count = before + 1 < recording->room ? (uint32_t)before + 1 : recording->room;
    recording->first = last - (recording->kept_count - 1) * recording->step;
    for (uint32_t i = 0; i < recording->kept_count; i++) {
        struct kept *kept = &recording->kept[i];
        const uint64_t index = recording->first + i * recording->step;
        int64_t stamp_ns;
        kept->status = go_to(recording, index, &kept->error);
        if (kept->status == FOVEA_OK)
            kept->status = recording->plugin->read(recording->video, kept->pixels, recording->width,
                                                   &stamp_ns, &kept->error);
        if (kept->status != FOVEA_END) {
            recording->position++;
            continue;
        }
        recording->position = UINT64_MAX; /* nowhere: go back first */
        kept->status = fovea_error_set(&kept->error, FOVEA_ERROR_INPUT,
                                       "%s: frame %llu: found no way back to it, expected one",
                                       recording->path, (unsigned long long)index);
    }
}

static enum fovea_status fetch_reverse(void *argument, uint64_t index, struct fv_slot *slot,
                                       struct fovea_error *error)
{
    struct recording *recording = argument;
    const uint64_t end = recording->first + recording->kept_count * recording->step;
    if (recording->kept_count == 0 || index < recording->first || index >= end)
        keep(recording, index);
    const struct kept *kept = &recording->kept[(index - recording->first) / recording->step];
    if (kept->status != FOVEA_OK) {
        *error = kept->error;
        return kept->status;
    }
    for (int32_t y = 0; y < recording->height; y++)
        memcpy(slot->pixels[0] + (size_t)y * (size_t)slot->frame.images[0].stride_bytes,
               kept->pixels + (size_t)y * (size_t)recording->width, (size_t)recording->width);
    describe_frame(&slot->frame, index);
    slot->frame.stamp_ns = recording->stamps_ns[index];
    return FOVEA_OK;
}

static enum fovea_status stamp(void *argument, uint64_t index, int64_t *stamp_ns)
{
    *stamp_ns = ((struct recording *)argument)->stamps_ns[index];
    return FOVEA_OK;
}

static const struct fv_recording_ops reverse_ops = {
    .fetch = fetch_reverse, .stamp = stamp, .close = close_recording, .reads = visit_file};

/* ---- opening --------------------------------------------------------------------------------- */

/* Skip what comes before the start now: where there is nothing left, that is said. */
static enum fovea_status go_to_start(struct recording *recording, uint64_t start,
                                     struct fovea_error *error)
{
    int64_t stamp_ns;
    bool there = true;
    while (there && recording->position < start) {
        there = recording->plugin->skip(recording->video, &stamp_ns) == FOVEA_OK;
        recording->position += there;
    }
    if (there && recording->plugin->more(recording->video)) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_ARGUMENT, "%s: start: found %llu, expected less than its %llu frames",
        recording->path, (unsigned long long)start, (unsigned long long)recording->position);
}

static enum fovea_status open_video(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    struct fovea_source_info info = {.format = FOVEA_PIXEL_GREY8};
    struct recording *recording = calloc(1, sizeof *recording);
    if (recording == NULL || (recording->path = strdup(address)) == NULL) {
        free(recording);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", address);
    }
    enum fovea_status status = FOVEA_OK;
    struct stat about;
    if (stat(address, &about) != 0)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: cannot be opened: %s", address,
                                 strerror(errno));
    else if (!S_ISREG(about.st_mode)) /* OpenCV takes folders and pipes for anything at all */
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%s: found no regular file, expected a video", address);
    if (status == FOVEA_OK) status = load(recording, error);
    if (status == FOVEA_OK && recording->plugin != NULL)
        status = open_video_file(recording, &info, error);
    struct fovea_error reason = {.text = ""};
    if (status == FOVEA_OK &&
        (status = fv_decode_check_size(info.cameras[0].width, info.cameras[0].height, &reason)) !=
            FOVEA_OK)
        fovea_error_set(error, status, "%s: %.256s", address, reason.text);
    recording->width = info.cameras[0].width;
    recording->height = info.cameras[0].height;
    info.heap_bytes = sizeof *recording;
    if (status == FOVEA_OK && recording->plugin != NULL && selection->step > 0)
        status = selection->reverse ? prepare_reverse(recording, selection, &info, error)
                                    : go_to_start(recording, selection->start, error);
    if (status != FOVEA_OK) {
        close_recording(recording);
        return fv_kind_hint("video", address, status, error);
    }
    if (selection->step > 1) info.rate_hz /= (double)selection->step;
    return fv_player_open(selection->reverse ? &reverse_ops : &video_ops, recording,
                          recording->count, NULL, address, selection, &info, source, error);
}

const struct fovea_source_ops fv_source_video =
    FV_PLAYER_OPS("video", "FILE  video, through the OpenCV plug-in", open_video);
