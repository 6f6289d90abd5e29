#include "bounds/inertial_parts.h"

#include "bounds/counter.h"
#include "odometry/rolling.h"
#include "scale/inertial.h"

static struct inertial_parts parts;

struct inertial_parts inertial_parts_take(void)
{
    const struct inertial_parts taken = parts;
    parts = (struct inertial_parts){0};
    return taken;
}

/* Under the names that the linker gives what is called, and what stands in its place. */
#define PART(result, name, ...)                                                                    \
    result name(__VA_ARGS__) __asm__("__real_fv_" #name);                                          \
    result counted_##name(__VA_ARGS__) __asm__("__wrap_fv_" #name)

PART(void, inertial_stage_predict, struct fv_inertial_stage *stage,
     const struct fv_odometry *odometry, int64_t stamp_ns, struct fv_motion_hint *hint);
PART(bool, inertial_stage_rate, const struct fv_inertial_stage *stage, int64_t stamp_ns,
     double rate[3]);
PART(void, inertial_stage_step, struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
     int64_t stamp_ns);
PART(void, odometry_place, const struct fv_odometry *odometry, const struct fv_rolling *rolling,
     const struct fv_odometry_input *input, struct fovea_feature *placed);

void counted_inertial_stage_predict(struct fv_inertial_stage *stage,
                                    const struct fv_odometry *odometry, int64_t stamp_ns,
                                    struct fv_motion_hint *hint)
{
    const uint64_t before = counter_now();
    inertial_stage_predict(stage, odometry, stamp_ns, hint);
    parts.predicted += counter_now() - before;
}

bool counted_inertial_stage_rate(const struct fv_inertial_stage *stage, int64_t stamp_ns,
                                 double rate[3])
{
    const uint64_t before = counter_now();
    const bool known = inertial_stage_rate(stage, stamp_ns, rate);
    parts.predicted += counter_now() - before;
    return known;
}

void counted_inertial_stage_step(struct fv_inertial_stage *stage,
                                 const struct fv_odometry *odometry, int64_t stamp_ns)
{
    const uint64_t before = counter_now();
    inertial_stage_step(stage, odometry, stamp_ns);
    parts.stepped += counter_now() - before;
}

void counted_odometry_place(const struct fv_odometry *odometry, const struct fv_rolling *rolling,
                            const struct fv_odometry_input *input, struct fovea_feature *placed)
{
    const uint64_t before = counter_now();
    odometry_place(odometry, rolling, input, placed);
    parts.placed += counter_now() - before;
}
