/* The map's job: saving, new landmarks, the window, the place index, and the scale by the floor. */
#include "runtime/jobs.h"

bool fv_job_map_waiting(const struct fovea *rt)
{
    return rt->config.odometry.enabled &&
           (fv_odometry_job_waiting(&rt->odometry) || fv_scale_waiting(&rt->scale, &rt->odometry));
}

uint32_t fv_job_map_advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    if (!rt->config.odometry.enabled) return 0;
    for (; done < units && fv_job_map_waiting(rt); done++) {
        if (fv_scale_waiting(&rt->scale, &rt->odometry))
            fv_scale_unit(&rt->scale, &rt->odometry);
        else
            fv_odometry_unit(&rt->odometry, &rt->kernels);
    }
    outputs->map_bytes = fv_odometry_save_take(&rt->odometry);
    return done;
}
