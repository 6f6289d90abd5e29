#include "odometry/motion.h"

#include "geometry/vec.h"

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

/* Intervals between two stamps; 0: nothing to follow. */
static double intervals(const struct fv_motion *m, int64_t from_ns, int64_t stamp_ns)
{
    int64_t ahead_ns;
    if (!m->known || __builtin_sub_overflow(stamp_ns, from_ns, &ahead_ns) || ahead_ns <= 0)
        return 0;
    const double fraction = (double)ahead_ns / (double)m->interval_ns;
    return fraction < intervals_max ? fraction : intervals_max;
}

void fv_motion_predict_from(const struct fv_motion *m, const struct fv_se3 *T_from, int64_t from_ns,
                            int64_t stamp_ns, struct fv_se3 *T)
{
    const double fraction = intervals(m, from_ns, stamp_ns);
    struct fv_se3 step;
    *T = *T_from;
    if (!(fraction > 0)) return;
    fv_se3_part(&m->T_now_before, fraction, &step);
    fv_se3_compose(&step, T_from, T);
}

void fv_motion_predict(const struct fv_motion *m, const struct fv_se3 *T_last, int64_t stamp_ns,
                       struct fv_se3 *T)
{
    fv_motion_predict_from(m, T_last, m->stamp_ns, stamp_ns, T);
}

void fv_motion_predict_by(const struct fv_motion *m, const struct fv_motion_hint *hint,
                          const struct fv_se3 *T_last, int64_t stamp_ns, struct fv_se3 *T)
{
    struct fv_se3 step = hint->T_now_last;
    if (!hint->turn) {
        fv_motion_predict(m, T_last, stamp_ns, T);
        return;
    }
    if (!hint->whole) { /* -t is the way from before to last, in the axes of last */
        double way[3];
        for (int k = 0; k < 3; k++)
            way[k] = intervals(m, m->stamp_ns, stamp_ns) * m->T_now_before.t[k];
        fv_rotate3(step.R, way, step.t);
    }
    fv_se3_compose(&step, T_last, T);
}
