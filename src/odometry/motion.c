#include "odometry/motion.h"

static const double intervals_max = 40;

void fv_motion_forget(struct fv_motion *m)
{
    m->known = false;
}

void fv_motion_note(struct fv_motion *m, const struct fv_se3 *T_before, int64_t stamp_before_ns,
                    const struct fv_se3 *T_now, int64_t stamp_ns)
{
    struct fv_se3 T_world_before;
    fv_se3_invert(T_before, &T_world_before);
    fv_se3_compose(T_now, &T_world_before, &m->T_now_before);
    m->known =
        !__builtin_sub_overflow(stamp_ns, stamp_before_ns, &m->interval_ns) && m->interval_ns > 0;
    m->stamp_ns = stamp_ns;
}

void fv_motion_predict(const struct fv_motion *m, const struct fv_se3 *T_last, int64_t stamp_ns,
                       struct fv_se3 *T)
{
    int64_t ahead_ns;
    struct fv_se3 step;
    *T = *T_last;
    if (!m->known || __builtin_sub_overflow(stamp_ns, m->stamp_ns, &ahead_ns) || ahead_ns <= 0)
        return;
    const double fraction = (double)ahead_ns / (double)m->interval_ns;
    fv_se3_part(&m->T_now_before, fraction < intervals_max ? fraction : intervals_max, &step);
    fv_se3_compose(&step, T_last, T);
}
