/* The preview's job: a JPEG of a pyramid level. */
#include "runtime/jobs.h"

bool fv_job_preview_waiting(const struct fovea *rt)
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

uint32_t fv_job_preview_advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    const struct fv_plane *level = fv_pyramid_level(&rt->pyramid, rt->config.preview.level);
    uint32_t done = 0;
    while (done < units && fv_preview_waiting(&rt->preview)) {
        done++;
        if (fv_preview_unit(&rt->preview, level, rt->config.preview.quality)) {
            send_preview(rt, outputs);
            break; /* one message per work call: its buffer is in use until the next */
        }
    }
    return done;
}
