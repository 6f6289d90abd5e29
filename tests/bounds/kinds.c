#include "bounds/kinds.h"

#include <stdio.h>
#include <stdlib.h>

#include "runtime/jobs.h"

const char *kind_name(enum kind kind)
{
    static const char *const names[KIND_COUNT] = {
#define NAME(name, text) text,
        KINDS(NAME)
#undef NAME
    };
    return names[kind];
}

/* A state in which a job does not wait. */
_Noreturn static void idle(const char *what)
{
    fprintf(stderr, "%s: found a unit of a job that is idle\n", what);
    exit(1);
}

static enum kind kind_of_creation(const struct fv_creation_state *g)
{
    switch (g->phase) {
    case FV_CREATION_MEASURED:
        return KIND_LANDMARKS_MEASURED;
    case FV_CREATION_TRIANGULATE:
        return KIND_LANDMARKS_NEW;
    case FV_CREATION_FUSE:
        return KIND_LANDMARKS_SEARCHED;
    case FV_CREATION_IDLE:
        break;
    }
    return KIND_KEYFRAME_TAKEN;
}

static enum kind kind_of_inertial(const struct fv_inertial *inertial)
{
    switch (inertial->state->phase) {
    case FV_INERTIAL_INTEGRATE:
        return KIND_INERTIAL_INTEGRATED;
    case FV_INERTIAL_ELIMINATE:
        return KIND_INERTIAL_ELIMINATED;
    case FV_INERTIAL_BACK:
        return KIND_INERTIAL_MOVED;
    case FV_INERTIAL_IDLE:
        break;
    }
    return KIND_INERTIAL_BEGUN;
}

static enum kind kind_of_window(const struct fv_window *window)
{
    switch (window->state->phase) {
    case FV_WINDOW_PASS:
        return KIND_WINDOW_PASS;
    case FV_WINDOW_DONE:
        return KIND_WINDOW_COMMITTED;
    case FV_WINDOW_IDLE:
        break;
    }
    return KIND_WINDOW_BEGUN;
}

static enum kind kind_of_map(const struct fovea *rt)
{
    const struct fv_odometry *o = &rt->odometry;
    const struct fv_odometry_state *s = o->state;
    if (fv_inertial_stage_waiting(&rt->inertial) && !fv_odometry_saving(o))
        return kind_of_inertial(&rt->inertial.estimator);
    if (fv_scale_waiting(&rt->scale, o)) return KIND_FLOOR;
    if (rt->free_space.enabled && fv_odometry_save_at_grid(o)) return KIND_GRID_SAVED;
    if (fv_archive_busy(o->saver.archive)) return KIND_MAP_SAVED;
    if (s->creation.pending_count > 0 || s->creation.phase != FV_CREATION_IDLE)
        return kind_of_creation(&s->creation);
    if (fv_odometry_agreement_waiting(o))
        return s->agreement.dropping ? KIND_KEYFRAME_GIVEN_UP : KIND_AGREEMENT;
    if (s->job_wanted || o->window.state->phase != FV_WINDOW_IDLE)
        return kind_of_window(&o->window);
    return fv_odometry_index_waiting(o) ? KIND_INDEX : KIND_AGREEMENT;
}

static enum kind kind_of_solve(const struct fv_pose_graph *graph)
{
    switch (graph->state->phase) {
    case FV_GRAPH_LINEARISE:
        return KIND_CLOSURE_LINEARISE;
    case FV_GRAPH_FACTOR:
        return KIND_CLOSURE_FACTOR;
    case FV_GRAPH_SOLVE:
        return KIND_CLOSURE_ITERATE;
    case FV_GRAPH_JUDGE:
        return KIND_CLOSURE_JUDGE;
    case FV_GRAPH_IDLE:
    case FV_GRAPH_DONE:
        break;
    }
    idle("pose graph");
}

static enum kind kind_of_closure(const struct fv_closure *closure)
{
    switch ((enum fv_closure_phase)closure->state->phase) {
    case FV_CLOSURE_MATCH:
        return KIND_CLOSURE_MATCH;
    case FV_CLOSURE_SAMPLE:
        return KIND_CLOSURE_SAMPLE;
    case FV_CLOSURE_REFINE:
        return KIND_CLOSURE_REFINE;
    case FV_CLOSURE_GUIDED:
        return KIND_CLOSURE_GUIDED;
    case FV_CLOSURE_LEVEL:
        return KIND_CLOSURE_LEVEL;
    case FV_CLOSURE_BEFORE:
        return KIND_CLOSURE_BEFORE;
    case FV_CLOSURE_GRAPH:
        return KIND_CLOSURE_GRAPH;
    case FV_CLOSURE_SOLVE:
        return kind_of_solve(&closure->graph);
    case FV_CLOSURE_COMMIT:
        return KIND_CLOSURE_COMMITTED;
    case FV_CLOSURE_FUSE:
        return KIND_CLOSURE_FUSE;
    case FV_CLOSURE_IDLE:
        break;
    }
    idle("closure");
}

/* While the mask waits: the floor that it is laid on is measured, where that is due. */
static enum kind kind_of_ground(const struct fovea *rt)
{
    const struct fv_ground_stage_state *ground = rt->ground.state;
    if (ground->phase >= FV_GROUND_GATHERED) return KIND_SPACE_FLOOR;
    return ground->phase == FV_GROUND_GATHERING &&
                   ground->seen_ns == rt->free_space.state->frame.stamp_ns
               ? KIND_SPACE_LANDMARKS
               : KIND_SPACE_MASK;
}

static enum kind kind_of_grid(const struct fv_grid *grid)
{
    switch ((enum fv_grid_phase)grid->state->phase) {
    case FV_GRID_DECAY:
        return KIND_SPACE_DECAY;
    case FV_GRID_POINTS_TAKEN:
        return KIND_SPACE_POINTS;
    case FV_GRID_RAYS:
        return KIND_SPACE_RAYS;
    case FV_GRID_APPLY:
    case FV_GRID_IDLE:
        break;
    }
    return KIND_SPACE_EVIDENCE;
}

static enum kind kind_of_free_space(const struct fovea *rt)
{
    switch ((enum fv_free_space_phase)rt->free_space.state->phase) {
    case FV_FREE_SPACE_WAITING:
        return kind_of_ground(rt);
    case FV_FREE_SPACE_UPDATING:
        return kind_of_grid(&rt->free_space.grid);
    case FV_FREE_SPACE_RECALLING:
        return KIND_SPACE_RECALL;
    case FV_FREE_SPACE_SCANNING:
        return KIND_SPACE_SCAN;
    case FV_FREE_SPACE_SENDING_GRID:
        return KIND_SPACE_GRID_SENT;
    case FV_FREE_SPACE_SENDING_SCAN:
        return KIND_SPACE_SCAN_SENT;
    case FV_FREE_SPACE_SENDING_HEIGHTS:
        return KIND_SPACE_HEIGHTS_SENT;
    case FV_FREE_SPACE_IDLE:
        break;
    }
    idle("free space");
}

static enum kind kind_of_decoding(const struct fv_detection *d)
{
    if (d->gives == 0) return KIND_DETECT_TENSORS;
    switch ((enum fv_decode_phase)d->memory.scratch->progress.phase) {
    case FV_DECODE_SCAN:
    case FV_DECODE_SORT:
    case FV_DECODE_SUPPRESS:
        break;
    case FV_DECODE_POINTS:
        return KIND_DETECT_KEYPOINTS;
    case FV_DECODE_CLEAR:
    case FV_DECODE_MASK:
        return (d->gives & FV_DETECT_BOXES) != 0 ? KIND_DETECT_OBJECT_MASKS : KIND_DETECT_MASK;
    }
    return d->gives == FV_DETECT_MASK ? KIND_DETECT_MASK : KIND_DETECT_DECODE;
}

/* Of one network. */
static enum kind kind_of_network(const struct fv_detection *d)
{
    switch ((enum fv_detection_mapping)d->state->mapping) {
    case FV_DETECTION_MAPPING:
        return d->gives == FV_DETECT_MASK ? KIND_DETECT_MASK_SENT : KIND_DETECT_BOXES;
    case FV_DETECTION_SENDING:
        return KIND_DETECT_MASK_SENT;
    case FV_DETECTION_IDLE:
        break;
    }
    switch ((enum fv_nn_job_phase)d->memory.job->nn.phase) {
    case FV_NN_JOB_BALANCE:
        return KIND_DETECT_BALANCE;
    case FV_NN_JOB_FILL:
        return KIND_DETECT_INPUT;
    case FV_NN_JOB_RUN:
        return KIND_DETECT_NETWORK;
    case FV_NN_JOB_DONE:
        return kind_of_decoding(d);
    case FV_NN_JOB_IDLE:
        break;
    }
    idle("network");
}

static enum kind kind_of_detection(const struct fovea *rt)
{
    if (fv_free_space_waiting(&rt->free_space)) return kind_of_free_space(rt);
    return kind_of_network(fv_detection_waiting(&rt->detection) ? &rt->detection : &rt->detection2);
}

static enum kind kind_of_edges(const struct fovea *rt)
{
    switch ((enum fv_edge_phase)rt->edges.state->phase) {
    case FV_EDGE_JOINING:
        return KIND_EDGE_SEGMENTS;
    case FV_EDGE_SENDING:
        return KIND_EDGES_SENT;
    case FV_EDGE_FINDING:
    case FV_EDGE_IDLE:
        break;
    }
    return KIND_EDGES;
}

enum kind kind_of(const struct fovea *rt, enum fovea_job job)
{
    if (!fv_jobs[job]->waiting(rt)) return KIND_COUNT;
    switch (job) {
    case FOVEA_JOB_MAP:
        return kind_of_map(rt);
    case FOVEA_JOB_DETECT:
        return kind_of_detection(rt);
    case FOVEA_JOB_CLOSURE:
        return kind_of_closure(&rt->odometry.closure);
    case FOVEA_JOB_PREVIEW:
        return KIND_PREVIEW;
    case FOVEA_JOB_EDGES:
        return kind_of_edges(rt);
    case FOVEA_JOB_CALIBRATION:
        return rt->odometry.state != NULL && rt->calibration.state->due ? KIND_CALIBRATION_MESSAGE
                                                                        : KIND_CALIBRATION;
    case FOVEA_JOB_COUNT:
        break;
    }
    return KIND_COUNT;
}
