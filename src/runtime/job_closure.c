/* The job that closes loops and merges maps. */
#include "runtime/jobs.h"

bool fv_job_closure_waiting(const struct fovea *rt)
{
    return rt->config.odometry.enabled && fv_odometry_closure_waiting(&rt->odometry);
}

uint32_t fv_job_closure_advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    (void)outputs;
    uint32_t done = 0;
    for (; done < units && fv_job_closure_waiting(rt); done++)
        fv_odometry_closure_unit(&rt->odometry, &rt->kernels);
    return done;
}
