#include "runtime/preview.h"

#include <string.h>

#include "detect/segmentation.h"
#include "message/message.h"

enum {
    BLOCKS_PER_UNIT = 64, /* about 0.05 ms here, 0.25 ms on a slow board */
    DRAWN_PER_UNIT = 1 << 15
};

/* Of one packet, what LCM's header, the channel and the message's other fields leave. */
static size_t jpeg_capacity(int32_t width, int32_t height)
{
    const size_t packet =
        FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES - fv_message_preview_size_max(0);
    const size_t picture = fv_jpeg_capacity(width, height);
    return picture < packet ? picture : packet;
}

void fv_preview_carve(struct fv_preview *preview, const struct fv_plane *const *levels,
                      uint32_t cameras, struct fv_arena *persistent, struct fv_arena *job)
{
    size_t pixels_max = 0;
    preview->cameras = cameras;
    preview->jpeg_capacity = 0;
    for (uint32_t i = 0; i < cameras; i++) {
        const size_t pixels = (size_t)levels[i]->width * (size_t)levels[i]->height;
        const size_t capacity = jpeg_capacity(levels[i]->width, levels[i]->height);
        if (pixels > pixels_max) pixels_max = pixels;
        if (capacity > preview->jpeg_capacity) preview->jpeg_capacity = capacity;
    }
    preview->state = fv_arena_take(persistent, 1, sizeof *preview->state);
    preview->picture = fv_arena_take(job, pixels_max, 1);
    preview->jpeg = fv_arena_take(job, preview->jpeg_capacity, 1);
}

void fv_preview_ask(struct fv_preview *preview, const struct fv_frame_id *frame, uint32_t camera)
{
    struct fv_preview_state *state = preview->state;
    if (state->active) return;
    state->due = 1;
    state->camera = camera;
    state->frame = *frame;
}

bool fv_preview_waiting(const struct fv_preview *preview)
{
    return preview->state->due || preview->state->active;
}

/* The pixels that are encoded, of the size of a level. */
static struct fv_plane picture_of(const struct fv_preview *preview, const struct fv_plane *level)
{
    return (struct fv_plane){preview->picture, level->width, level->height, level->width};
}

static void begin(struct fv_preview *preview, const struct fv_plane *picture, uint32_t quality)
{
    preview->state->quality = quality;
    fv_jpeg_start(&preview->state->jpeg, picture->width, picture->height, quality, preview->jpeg,
                  preview->jpeg_capacity);
}

/* Into some rows more; a mask that goes meanwhile is drawn as far as it was. */
static void draw_mask(struct fv_preview *preview, const struct fv_plane *picture,
                      const struct fovea_segmentation *mask)
{
    const int32_t rows = DRAWN_PER_UNIT / picture->width + 1, first = preview->state->drawn,
                  end = picture->height - first > rows ? first + rows : picture->height;
    fv_segmentation_overlay(mask, picture->pixels, picture->width, picture->height, first, end);
    preview->state->drawn = end;
}

bool fv_preview_unit(struct fv_preview *preview, const struct fv_plane *level,
                     const struct fovea_segmentation *mask, uint32_t quality)
{
    struct fv_preview_state *state = preview->state;
    const struct fv_plane picture = picture_of(preview, level);
    if (!state->active) {
        for (int32_t y = 0; y < picture.height; y++)
            memcpy(fv_plane_row(&picture, y), fv_plane_row(level, y), (size_t)picture.width);
        begin(preview, &picture, quality);
        state->turn = (state->camera + 1) % preview->cameras;
        state->due = 0;
        state->active = 1;
        state->drawn = 0;
        return false;
    }
    if (mask == NULL) state->drawn = picture.height;
    if (state->drawn < picture.height) {
        draw_mask(preview, &picture, mask);
        return false;
    }
    if (!fv_jpeg_encode(&state->jpeg, &picture, BLOCKS_PER_UNIT, preview->jpeg)) return false;
    if (state->jpeg.overflow && state->quality > 1) {
        begin(preview, &picture, state->quality - (state->quality + 3) / 4);
        return false;
    }
    state->active = 0;
    return !state->jpeg.overflow;
}
