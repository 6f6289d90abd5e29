/* The preview's job: a JPEG of a pyramid level. */
#include <string.h>

#include "runtime/jobs.h"

/* The level of the pyramid that is shown. */
static const struct fv_plane *shown_level(const struct fovea *rt)
{
    return fv_pyramid_level(fv_seen_pyramid(fv_front_end_images(&rt->front_end), FV_VIEWER_PREVIEW),
                            rt->config.preview.level);
}

static bool waiting(const struct fovea *rt)
{
    return fv_preview_waiting(&rt->preview);
}

static void send_preview(struct fovea *rt, struct fovea_outputs *outputs)
{
    const struct fv_preview *preview = &rt->preview;
    const struct fv_message_preview message = {
        .stamp = fv_frame_id_stamp(&preview->state->frame),
        .width = preview->picture.width,
        .height = preview->picture.height,
        .scale = (double)fv_pyramid_scale(rt->config.preview.level),
        .jpeg = preview->jpeg,
        .jpeg_bytes = (uint32_t)preview->state->jpeg.used,
    };
    fv_output_add(rt, FV_MESSAGE_PREVIEW,
                  fv_message_preview_encode(&message, rt->outbox.buffer[FV_MESSAGE_PREVIEW],
                                            rt->outbox.capacity[FV_MESSAGE_PREVIEW]),
                  outputs);
}

/* The mask that is drawn; NULL: none. */
static const struct fovea_segmentation *drawn_mask(const struct fovea *rt,
                                                   struct fovea_segmentation *mask)
{
    if (!rt->config.preview.segmentation) return NULL;
    return fv_detection_has_mask(&rt->detection, mask) ||
                   fv_detection_has_mask(&rt->detection2, mask)
               ? mask
               : NULL;
}

static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    const struct fv_plane *level = shown_level(rt);
    struct fovea_segmentation found;
    const struct fovea_segmentation *mask = drawn_mask(rt, &found);
    uint32_t done = 0;
    while (done < units && fv_preview_waiting(&rt->preview)) {
        done++;
        if (fv_preview_unit(&rt->preview, level, mask, rt->config.preview.quality)) {
            send_preview(rt, outputs);
            break; /* one message per work call: its buffer is in use until the next */
        }
    }
    return done;
}

static void carve(struct fovea *rt, struct fv_carving *carving)
{
    const struct fv_plane *level = shown_level(rt);
    fv_preview_carve(&rt->preview, level->width, level->height,
                     &carving->arenas[FOVEA_MEMORY_PERSISTENT], &carving->arenas[FOVEA_MEMORY_JOB]);
}

static void ask(struct fovea *rt, const struct fovea_frame *frame)
{
    (void)frame;
    const bool due = fv_every(rt->state->frames_processed - 1, rt->config.preview.period_frames);
    if (due || rt->preview.state->due) fv_preview_ask(&rt->preview, &rt->state->frame);
}

static void reset(struct fovea *rt)
{
    memset(rt->preview.state, 0, sizeof *rt->preview.state);
}

/* A preview of 376x240 in 6 frames. */
const struct fv_job fv_job_preview = {.key = "preview.period_frames",
                                      .units_min = 4,
                                      .units_fixed = 8,
                                      .waiting = waiting,
                                      .advance = advance,
                                      .carve = carve,
                                      .frame = ask,
                                      .reset = reset};
