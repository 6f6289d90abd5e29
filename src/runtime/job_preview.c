/* The preview's job: a JPEG of a pyramid level. */
#include <string.h>

#include "runtime/jobs.h"

/* The level of a camera's pyramid that is shown. */
static const struct fv_plane *shown_level(const struct fovea *rt, uint32_t camera)
{
    const struct fv_pyramid *pyramid =
        camera > 0 ? &rt->preview.others[camera - 1]
                   : fv_seen_pyramid(fv_front_end_images(&rt->front_end), FV_VIEWER_PREVIEW);
    return fv_pyramid_level(pyramid, rt->config.preview.level);
}

static bool waiting(const struct fovea *rt)
{
    return fv_preview_waiting(&rt->preview);
}

static void send_preview(struct fovea *rt, struct fovea_outputs *outputs)
{
    const struct fv_preview *preview = &rt->preview;
    const struct fv_plane *level = shown_level(rt, preview->state->camera);
    const struct fv_message_preview message = {
        .stamp = fv_frame_id_stamp(&preview->state->frame),
        .camera = preview->state->camera,
        .width = level->width,
        .height = level->height,
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
    if (!rt->config.preview.segmentation || rt->preview.state->camera > 0) return NULL;
    return fv_detection_has_mask(&rt->detection, mask) ||
                   fv_detection_has_mask(&rt->detection2, mask)
               ? mask
               : NULL;
}

static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    const struct fv_plane *level = shown_level(rt, rt->preview.state->camera);
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
    const struct fovea_rig *rig = &rt->config.rig;
    const struct fv_plane *levels[FOVEA_CAMERAS_MAX] = {shown_level(rt, 0)};
    uint32_t cameras = 1;
    for (; cameras < rt->config.preview.cameras && cameras < rig->camera_count; cameras++) {
        const struct fovea_camera *camera = &rig->cameras[cameras].camera;
        fv_pyramid_carve(&rt->preview.others[cameras - 1], camera->width, camera->height,
                         rt->config.preview.level + 1, &carving->arenas[FOVEA_MEMORY_FRAME]);
        levels[cameras] = shown_level(rt, cameras);
    }
    fv_preview_carve(&rt->preview, levels, cameras, &carving->arenas[FOVEA_MEMORY_PERSISTENT],
                     &carving->arenas[FOVEA_MEMORY_JOB]);
}

/* Whether the frame has an image of that camera. */
static bool has_image(const struct fovea *rt, const struct fovea_frame *frame, uint32_t camera)
{
    if (camera == 0) return true;
    if (camera >= frame->image_count) return false;
    const struct fovea_image *image = &frame->images[camera];
    const struct fv_plane *size = &rt->preview.others[camera - 1].level[0];
    return fovea_image_check(image) == FOVEA_OK && image->width == size->width &&
           image->height == size->height && image->format != FOVEA_PIXEL_MJPEG;
}

/* The camera whose turn it is, or the next one with an image in this frame. Its pyramid is computed
 * now. */
static uint32_t take_turn(struct fovea *rt, const struct fovea_frame *frame)
{
    uint32_t camera = rt->preview.state->turn;
    while (!has_image(rt, frame, camera))
        camera = (camera + 1) % rt->preview.cameras;
    if (camera > 0)
        fv_pyramid_build(&rt->preview.others[camera - 1], &rt->kernels, &frame->images[camera]);
    return camera;
}

static void ask(struct fovea *rt, const struct fovea_frame *frame)
{
    struct fv_preview *preview = &rt->preview;
    const bool due = fv_every(rt->state->frames_processed - 1, rt->config.preview.period_frames);
    if ((due || preview->state->due) && !preview->state->active)
        fv_preview_ask(preview, &rt->state->frame, take_turn(rt, frame));
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
