/* The job of closures, and what a correction of the map means for the frame in work. */
#include "geometry/vec.h"
#include "odometry/odometry.h"

bool fv_odometry_closure_waiting(const struct fv_odometry *o)
{
    /* While the map is saved it stays as it is. */
    return o->config.closures && fv_closure_waiting(&o->closure) &&
           !fv_archive_busy(o->saver.archive);
}

void fv_odometry_follow_correction(struct fv_odometry *o, const struct fv_sim3 *S_new_old)
{
    struct fv_odometry_state *s = o->state;
    for (int k = 0; k < 3; k++)
        s->localise.motion.T_now_before.t[k] *= S_new_old->s;
    fv_sim3_apply(S_new_old, s->still.position, s->still.position);
    fv_covariance_rescale(s->reference.parts, S_new_old->s);
    fv_covariance_rescale(s->reference.lens, S_new_old->s);
    if (o->window.state->phase == FV_WINDOW_IDLE) return;
    fv_window_abort(&o->window); /* its copy is of the map before */
    s->job_wanted = true;
}

bool fv_odometry_closure_unit(struct fv_odometry *o, const struct fv_kernels *kernels,
                              struct fv_closure_outcome *outcome)
{
    const bool left = fv_closure_unit(&o->closure, &o->map, kernels, outcome);
    if (outcome->committed) fv_odometry_follow_correction(o, &outcome->S_new_current);
    if (outcome->fused) o->state->job_wanted = true;
    return left;
}
