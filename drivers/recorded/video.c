/* Videos, through a plug-in that is looked for beside the program, in ../lib/fovea of it, and first of all in
 * the folder that $FOVEA_PLUGINS names. Frames can only be read in order, so a start is reached by skipping.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "../plugin.h"
#include "decode.h"
#include "listing.h"
#include "player.h"
#include "video_plugin.h"

struct recording {
    char *path;
    const struct fovea_video_plugin *plugin;
    struct fovea_video *video;
    uint64_t position; /* of the next frame */
};

static void close_recording(void *argument)
{
    struct recording *recording = argument;
    if (recording->video != NULL) recording->plugin->close(recording->video);
    free(recording->path);
    free(recording);
}

static enum fovea_status load(struct recording *recording, struct fovea_error *error)
{
    static const struct fv_plugin_name name = {.scheme = "video",
                                               .file = FOVEA_VIDEO_PLUGIN_FILE,
                                               .symbol = FOVEA_VIDEO_PLUGIN_SYMBOL,
                                               .package = "libopencv-videoio-dev",
                                               .version = FOVEA_VIDEO_PLUGIN_VERSION};
    const void *table;
    const enum fovea_status status = fv_plugin_load(&name, &table, error);
    if (status == FOVEA_OK) recording->plugin = table;
    return status;
}

/* ---- frames ------------------------------------------------------------------------------------------ */

static enum fovea_status open_video_file(struct recording *recording, struct fovea_source_info *info,
                                         struct fovea_error *error)
{
    recording->position = 0;
    return recording->plugin->open(recording->path, &recording->video, &info->width, &info->height,
                                   &info->rate_hz, error);
}

static enum fovea_status fetch(void *argument, uint64_t index, struct fv_slot *slot,
                               struct fovea_error *error)
{
    struct recording *recording = argument;
    if (index < recording->position) { /* played again */
        struct fovea_source_info again;
        recording->plugin->close(recording->video);
        recording->video = NULL;
        if (open_video_file(recording, &again, error) != FOVEA_OK) return FOVEA_END;
    }
    if (recording->video == NULL) return FOVEA_END;
    for (; recording->position < index; ++recording->position)
        if (recording->plugin->skip(recording->video) != FOVEA_OK) return FOVEA_END;
    recording->position++;
    slot->frame.exposure_ns = 0;
    slot->frame.clock = FOVEA_CLOCK_RECORDED;
    slot->frame.stamp_meaning = FOVEA_STAMP_UNKNOWN;
    slot->frame.sequence = index;
    return recording->plugin->read(recording->video, slot->pixels, slot->frame.image.stride_bytes,
                                   &slot->frame.stamp_ns, error);
}

static const struct fv_recording_ops video_ops = {.fetch = fetch, .close = close_recording};

static enum fovea_status open_video(const char *address, const struct fovea_source_selection *selection,
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
        status =
            fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: cannot be opened: %s", address, strerror(errno));
    else if (!S_ISREG(about.st_mode)) /* OpenCV takes folders and pipes for anything at all */
        status =
            fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found no regular file, expected a video", address);
    if (status == FOVEA_OK) status = load(recording, error);
    if (status == FOVEA_OK && recording->plugin != NULL) status = open_video_file(recording, &info, error);
    struct fovea_error reason = {.text = ""};
    if (status == FOVEA_OK && (status = fv_decode_check_size(info.width, info.height, &reason)) != FOVEA_OK)
        fovea_error_set(error, status, "%s: %.256s", address, reason.text);
    if (status != FOVEA_OK) {
        close_recording(recording);
        return status;
    }
    if (selection->step > 1) info.rate_hz /= (double)selection->step;
    info.heap_bytes = sizeof *recording;
    return fv_player_open(&video_ops, recording, 0, 0, address, selection, &info, source, error);
}

const struct fovea_source_ops fovea_source_video =
    FV_PLAYER_OPS("video", "FILE  video, through the OpenCV plug-in", open_video);
