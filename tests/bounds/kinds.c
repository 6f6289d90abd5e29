#include "bounds/kinds.h"

#include "runtime/jobs.h"

static const char *kind_of_creation(const struct fv_creation_state *g)
{
    switch (g->phase) {
    case FV_CREATION_TRIANGULATE:
        return "map: new landmarks";
    case FV_CREATION_FUSE:
        return "map: landmarks searched in neighbours";
    case FV_CREATION_MEASURED:
        return "map: landmarks of measured distances";
    case FV_CREATION_IDLE:
        break;
    }
    return "map: keyframe taken up";
}

static const char *kind_of_map(const struct fovea *rt)
{
    const struct fv_odometry *o = &rt->odometry;
    const struct fv_odometry_state *s = o->state;
    if (fv_inertial_stage_waiting(&rt->inertial) && !fv_odometry_saving(o)) return "map: inertial";
    if (fv_scale_waiting(&rt->scale, o)) return "map: floor";
    if (rt->free_space.enabled && fv_odometry_save_at_grid(o)) return "map: grid saved";
    if (fv_archive_busy(o->saver.archive)) return "map: saving";
    if (s->creation.pending_count > 0 || s->creation.phase != FV_CREATION_IDLE)
        return kind_of_creation(&s->creation);
    if (fv_odometry_agreement_waiting(o))
        return s->agreement.dropping ? "map: keyframe given up" : "map: agreement";
    if (s->job_wanted || o->window.state->phase != FV_WINDOW_IDLE)
        return o->window.state->phase == FV_WINDOW_PASS   ? "map: window pass"
               : o->window.state->phase == FV_WINDOW_DONE ? "map: window committed"
                                                          : "map: window begun";
    return "map: index";
}

static const char *kind_of_closure(const struct fv_closure *closure)
{
    static const char *const names[] = {"closure: none",   "closure: match",  "closure: sample",
                                        "closure: refine", "closure: guided", "closure: before",
                                        "closure: graph",  "closure: solve",  "closure: committed",
                                        "closure: fuse"};
    static const char *const solves[] = {"closure: none",       "closure: linearise",
                                         "closure: factor",     "closure: iterate",
                                         "closure: judge step", "closure: none"};
    if (closure->state->phase == FV_CLOSURE_SOLVE) return solves[closure->graph.state->phase];
    return names[closure->state->phase];
}

/* While the mask waits: the floor that it is laid on is measured, where that is due. */
static const char *kind_of_ground(const struct fovea *rt)
{
    const struct fv_ground_stage_state *ground = rt->ground.state;
    if (ground->phase >= FV_GROUND_GATHERED) return "free space: floor fitted";
    return ground->phase == FV_GROUND_GATHERING &&
                   ground->seen_ns == rt->free_space.state->frame.stamp_ns
               ? "free space: landmarks on floor"
               : "free space: mask taken";
}

static const char *kind_of_free_space(const struct fovea *rt)
{
    switch (rt->free_space.state->phase) {
    case FV_FREE_SPACE_WAITING:
        return kind_of_ground(rt);
    case FV_FREE_SPACE_RECALLING:
        return "free space: recall";
    case FV_FREE_SPACE_SCANNING:
        return "free space: scan";
    case FV_FREE_SPACE_SENDING_GRID:
        return "free space: grid sent";
    case FV_FREE_SPACE_SENDING_SCAN:
        return "free space: scan sent";
    case FV_FREE_SPACE_SENDING_HEIGHTS:
        return "free space: heights sent";
    default:
        break;
    }
    switch (rt->free_space.grid.state->phase) {
    case FV_GRID_DECAY:
        return "free space: cells forget";
    case FV_GRID_POINTS_TAKEN:
        return "free space: points";
    case FV_GRID_RAYS:
        return "free space: rays";
    default:
        return "free space: evidence";
    }
}

static const char *kind_of_detection(const struct fovea *rt)
{
    if (fv_free_space_waiting(&rt->free_space)) return kind_of_free_space(rt);
    const struct fv_detection *d = &rt->detection;
    const bool labels = d->gives == FV_DETECT_MASK;
    if (d->state->mapping != FV_DETECTION_IDLE)
        return labels ? "detect: mask sent" : "detect: boxes and objects";
    switch (d->memory.job->nn.phase) {
    case FV_NN_JOB_FILL:
        return "detect: input";
    case FV_NN_JOB_RUN:
        return "detect: network";
    case FV_NN_JOB_DONE:
        return labels ? "detect: mask decoded" : "detect: decode";
    default:
        return "detect: other";
    }
}

const char *kind_of(const struct fovea *rt, enum fovea_job job)
{
    if (!fv_jobs[job]->waiting(rt)) return NULL;
    switch (job) {
    case FOVEA_JOB_MAP:
        return kind_of_map(rt);
    case FOVEA_JOB_DETECT:
        return kind_of_detection(rt);
    case FOVEA_JOB_CLOSURE:
        return kind_of_closure(&rt->odometry.closure);
    case FOVEA_JOB_PREVIEW:
        return "preview";
    case FOVEA_JOB_EDGES:
        return rt->edges.state->phase == FV_EDGE_JOINING   ? "edges: segments"
               : rt->edges.state->phase == FV_EDGE_SENDING ? "edges: sent"
                                                           : "edges";
    case FOVEA_JOB_CALIBRATION:
        return rt->odometry.state != NULL && rt->calibration.state->due ? "calibration: message"
                                                                        : "calibration";
    case FOVEA_JOB_COUNT:
        break;
    }
    return NULL;
}
