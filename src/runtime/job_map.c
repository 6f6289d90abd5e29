/* The map's job: saving, new landmarks, the window, the place index, the inertial estimate, and the
 * scale by the floor. */
#include "runtime/jobs.h"
#include "runtime/kept_grid.h"

static bool waiting(const struct fovea *rt)
{
    return rt->config.odometry.enabled &&
           (fv_odometry_job_waiting(&rt->odometry) || fv_scale_waiting(&rt->scale, &rt->odometry) ||
            fv_inertial_stage_waiting(&rt->inertial));
}

static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    if (!rt->config.odometry.enabled) return 0;
    for (; done < units && waiting(rt); done++) {
        if (fv_inertial_stage_waiting(&rt->inertial) && !fv_odometry_saving(&rt->odometry))
            fv_inertial_stage_unit(&rt->inertial, &rt->odometry);
        else if (fv_scale_waiting(&rt->scale, &rt->odometry))
            fv_scale_unit(&rt->scale, &rt->odometry);
        else if (!fv_kept_grid_save_unit(&rt->free_space, &rt->publish, &rt->odometry))
            fv_odometry_unit(&rt->odometry, &rt->kernels);
    }
    outputs->map_bytes = fv_odometry_save_take(&rt->odometry);
    return done;
}

/* The odometry carves, feeds and resets what the job works on. A window of five iterations takes
 * six frames at most, when keyframes are not close together, since new landmarks go first;
 * keyframes of a car follow each other by two frames. */
const struct fv_job fv_job_map = {.key = "odometry.enabled",
                                  .units_min = 24,
                                  .units_fixed = 56,
                                  .waiting = waiting,
                                  .advance = advance};
