/* Of edges and line segments, on pictures of one kind each: no picture is known to be the dearest.
 */
#include "runtime/edges.h"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct edging {
    struct fovea *rt;
    struct fv_edge_stage *stage;
    uint8_t *bytes;
};

enum { PICTURES = 6, ENCODED_BYTES = 1 << 20 };

static void unit(void *context)
{
    struct edging *e = context;
    if (fv_edge_stage_unit(e->stage, &e->rt->kernels))
        (void)fv_edge_stage_encode(e->stage, e->bytes, ENCODED_BYTES);
}

/* Noise, black and white; stripes that rise by six per pixel, upright, lying and aslant; chequers;
 * and rings. */
static uint8_t pixel_of(int picture, int32_t x, int32_t y)
{
    switch (picture) {
    case 0:
        return (uint32_t)(y * 7919 + x + 1) * 2654435761u >> 19 & 1 ? 255 : 0;
    case 1:
        return (uint8_t)(x * 6 % 252);
    case 2:
        return (uint8_t)(y * 6 % 252);
    case 3:
        return (uint8_t)((x + y) * 5 % 250);
    case 4:
        return (x / 3 + y / 3) % 2 ? 230 : 20;
    default:
        return (uint8_t)((x - 300) * (x - 300) / 40 + (y - 200) * (y - 200) / 40);
    }
}

void pieces_of_edges(struct fovea *rt)
{
    struct edging e = {.rt = rt, .stage = &rt->edges, .bytes = malloc(ENCODED_BYTES)};
    if (rt->edges.state == NULL) return;
    for (int picture = 0; picture < PICTURES; picture++) {
        const struct fv_plane *level = fv_pyramid_level(&rt->front_end.images.main, 0);
        for (int32_t y = 0; y < level->height; y++)
            for (int32_t x = 0; x < level->width; x++)
                fv_plane_row(level, y)[x] = pixel_of(picture, x, y);
        fv_edge_stage_ask(e.stage, &rt->config.edge_job, &rt->state->frame, level);
        while (fv_edge_stage_waiting(e.stage)) {
            const enum fv_edge_phase phase = (enum fv_edge_phase)e.stage->state->phase;
            if (phase == FV_EDGE_SENDING)
                e.stage->state->joined.count = FV_MESSAGE_EDGE_SEGMENTS_MAX;
            piece_note(phase == FV_EDGE_FINDING   ? PIECE_edges_found
                       : phase == FV_EDGE_JOINING ? PIECE_segments_found
                                                  : PIECE_edges_sent,
                       (double)counter_of(unit, &e));
        }
    }
    free(e.bytes);
}
