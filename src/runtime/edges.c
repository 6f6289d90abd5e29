#include "runtime/edges.h"

#include <string.h>

#include "message/message.h"

enum { PIXELS_PER_UNIT = 16384, SEGMENT_PIXELS_PER_UNIT = 4096 }; /* 0.05 ms here */

void fv_edge_stage_carve(struct fv_edge_stage *stage, const struct fovea_edge_job_config *config,
                         int32_t width, int32_t height, struct fv_arena *persistent,
                         struct fv_arena *job, struct fv_arena *frame)
{
    stage->state = fv_arena_take(persistent, 1, sizeof *stage->state);
    stage->picture = (struct fv_plane){.width = width, .height = height, .stride = width};
    stage->picture.pixels = fv_arena_take(job, (size_t)width * (size_t)height, 1);
    fv_edges_carve(&stage->edges, &config->edges, width, height, job);
    stage->bits = fv_arena_take(frame, FV_MESSAGE_EDGE_BYTES_MAX, 1);
    stage->has_segments = config->segments;
    if (!config->segments) return;
    const struct fovea_segments_config segments = {.length_min_px = config->segment_length_min_px,
                                                   .count_max = FV_MESSAGE_EDGE_SEGMENTS_MAX};
    fv_segments_carve(&stage->segments, &segments, width, height, job, frame);
    stage->ends = fv_arena_take(frame, FV_MESSAGE_EDGE_SEGMENTS_MAX, sizeof *stage->ends);
}

/* The image under way keeps the thresholds that it began with; copies of the runtime find them in
 * the state. */
static void use_thresholds(struct fv_edge_stage *stage)
{
    fv_edges_set(&stage->edges, stage->state->low, stage->state->high);
    stage->segments.config.length_min_px = stage->state->length_min_px;
}

void fv_edge_stage_ask(struct fv_edge_stage *stage, const struct fovea_edge_job_config *config,
                       const struct fv_frame_id *frame, const struct fv_plane *image)
{
    struct fv_edge_state *state = stage->state;
    if (state->phase != FV_EDGE_IDLE) return;
    for (int32_t y = 0; y < stage->picture.height; y++)
        memcpy(fv_plane_row(&stage->picture, y), fv_plane_row(image, y),
               (size_t)stage->picture.width);
    state->frame = *frame;
    state->phase = FV_EDGE_FINDING;
    state->sent = 0;
    state->low = config->edges.low;
    state->high = config->edges.high;
    state->length_min_px = config->segment_length_min_px;
    use_thresholds(stage);
    fv_edges_begin(&stage->edges, &state->found);
    if (stage->has_segments) fv_segments_begin(&stage->segments, &state->joined);
}

bool fv_edge_stage_waiting(const struct fv_edge_stage *stage)
{
    return stage->state != NULL && stage->state->phase != FV_EDGE_IDLE;
}

bool fv_edge_stage_unit(struct fv_edge_stage *stage, const struct fv_kernels *kernels)
{
    struct fv_edge_state *state = stage->state;
    use_thresholds(stage);
    if (state->phase == FV_EDGE_FINDING) {
        if (fv_edges_advance(&stage->edges, &state->found, kernels, &stage->picture,
                             PIXELS_PER_UNIT))
            state->phase = stage->has_segments ? FV_EDGE_JOINING : FV_EDGE_SENDING;
        return false;
    }
    if (state->phase == FV_EDGE_JOINING) {
        if (fv_segments_advance(&stage->segments, &state->joined, kernels, &stage->picture,
                                SEGMENT_PIXELS_PER_UNIT))
            state->phase = FV_EDGE_SENDING;
        return false;
    }
    return true;
}

/* The ends of the segments found, as the message has them; how many. */
static uint32_t take_segments(const struct fv_edge_stage *stage)
{
    const uint32_t count = stage->has_segments ? stage->state->joined.count : 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct fovea_segment *s = &stage->segments.found[i];
        const float ends[4] = {s->x0_px, s->y0_px, s->x1_px, s->y1_px};
        memcpy(stage->ends[i], ends, sizeof ends);
    }
    return count;
}

uint32_t fv_edge_stage_encode(struct fv_edge_stage *stage, uint8_t *buffer, size_t capacity)
{
    struct fv_edge_state *state = stage->state;
    const struct fv_plane *picture = &stage->picture;
    const int32_t row_bytes = (picture->width + 7) / 8, left = picture->height - state->sent;
    const int32_t most = FV_MESSAGE_EDGE_BYTES_MAX / row_bytes, rows = left < most ? left : most;
    for (int32_t y = 0; y < rows; y++)
        fv_edges_pack(&stage->edges, state->sent + y, stage->bits + (ptrdiff_t)y * row_bytes);
    const bool last = rows == left;
    const struct fv_message_edges message = {.stamp = fv_frame_id_stamp(&state->frame),
                                             .config = &stage->edges.config,
                                             .width = picture->width,
                                             .height = picture->height,
                                             .first_row = state->sent,
                                             .row_count = rows,
                                             .bits = stage->bits,
                                             .segment_count = last ? take_segments(stage) : 0,
                                             .segments = (const float(*)[4])stage->ends};
    state->sent += rows;
    if (last) state->phase = FV_EDGE_IDLE;
    return fv_message_edges_encode(&message, buffer, capacity);
}
