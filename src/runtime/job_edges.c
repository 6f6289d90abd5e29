/* The job of edges: bitmaps of every n-th frame (runtime/edges.h). */
#include "runtime/jobs.h"

static bool is_on(const struct fovea *rt)
{
    return rt->config.edge_job.period_frames > 0;
}

static bool waiting(const struct fovea *rt)
{
    return fv_edge_stage_waiting(&rt->edges);
}

static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    while (done < units && waiting(rt)) {
        done++;
        if (!fv_edge_stage_unit(&rt->edges, &rt->kernels)) continue;
        fv_output_add(rt, FV_MESSAGE_EDGES,
                      fv_edge_stage_encode(&rt->edges, rt->outbox.buffer[FV_MESSAGE_EDGES],
                                           rt->outbox.capacity[FV_MESSAGE_EDGES]),
                      outputs);
        break; /* one message per work call: its buffer is in use until the next */
    }
    return done;
}

static void carve(struct fovea *rt, struct fv_carving *carving)
{
    const struct fovea_camera *camera = &rt->config.rig.cameras[0].camera;
    if (is_on(rt))
        fv_edge_stage_carve(&rt->edges, &rt->config.edge_job, camera->width, camera->height,
                            &carving->arenas[FOVEA_MEMORY_PERSISTENT],
                            &carving->arenas[FOVEA_MEMORY_JOB],
                            &carving->arenas[FOVEA_MEMORY_FRAME]);
}

static void ask(struct fovea *rt, const struct fovea_frame *frame)
{
    (void)frame;
    if (!is_on(rt) || !fv_every(rt->state->frames_processed - 1, rt->config.edge_job.period_frames))
        return;
    const struct fv_seen *seen = fv_front_end_images(&rt->front_end);
    fv_edge_stage_ask(&rt->edges, &rt->config.edge_job, &rt->state->frame,
                      fv_pyramid_level(fv_seen_pyramid(seen, FV_VIEWER_EDGES), 0));
}

static void reset(struct fovea *rt)
{
    if (rt->edges.state != NULL) rt->edges.state->phase = FV_EDGE_IDLE;
}

/* Fixed: 752x480 in one frame. */
const struct fv_job fv_job_edges = {.key = "edges.period_frames",
                                    .units_min = 4,
                                    .units_fixed = 32,
                                    .waiting = waiting,
                                    .advance = advance,
                                    .carve = carve,
                                    .frame = ask,
                                    .reset = reset};
