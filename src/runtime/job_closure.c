/* The job that finds closures and merges maps. */
#include "runtime/jobs.h"
#include "runtime/kept_grid.h"

static bool waiting(const struct fovea *rt)
{
    return rt->config.odometry.enabled && fv_odometry_closure_waiting(&rt->odometry);
}

static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    (void)outputs;
    uint32_t done = 0;
    for (; done < units && waiting(rt); done++) {
        struct fv_closure_outcome outcome;
        (void)fv_odometry_closure_unit(&rt->odometry, &rt->kernels, &outcome);
        if (outcome.committed)
            fv_kept_grid_stretch(&rt->free_space, outcome.stretched_map, outcome.stretch);
    }
    return done;
}

/* The odometry carves, feeds and resets what the job works on. The largest map is corrected within
 * 20 s. */
const struct fv_job fv_job_closure = {.key = "map.closures",
                                      .units_min = 4,
                                      .units_fixed = 24,
                                      .waiting = waiting,
                                      .advance = advance};
