#include "odometry/turn.h"

#include <string.h>

#include "geometry/linear.h"
#include "geometry/vec.h"
#include "odometry/odometry.h"

/* Mean variances of the axes of a pose. */
struct variances {
    double place, turn;
};

/* False: singular. */
static bool variances_of(const double information[36], struct variances *v)
{
    double A[36];
    memcpy(A, information, sizeof A);
    *v = (struct variances){0, 0};
    if (!fv_ldlt_factor(A, 6)) return false;
    for (int i = 0; i < 6; i++) {
        double e[6] = {0};
        e[i] = 1;
        fv_ldlt_back(A, 6, e);
        *(i < 3 ? &v->place : &v->turn) += e[i] / 3;
    }
    return v->place > 0 && v->turn > 0;
}

/* The small turn that leads from the frame's own attitude to the measured one. */
static void innovation(const struct fv_motion_hint *hint, const struct fv_se3 *last,
                       const struct fv_se3 *T, double turn[3])
{
    double expected[9], E[9];
    fv_multiply33(hint->T_now_last.R, last->R, expected);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            E[3 * r + c] = fv_dot3(expected + 3 * r, T->R + 3 * c);
    fv_so3_log(E, turn);
}

void fv_odometry_hold_turn(struct fv_odometry *o, const struct fv_se3 *last,
                           const struct fv_pose_fit *fit, bool trusted, struct fv_se3 *T)
{
    struct fv_turn_state *s = &o->state->turn;
    const struct fv_motion_hint *hint = &o->state->localise.hint;
    const double before = s->variance;
    double step[6] = {0}, H[36];
    struct variances own, both;
    memset(s->held, 0, sizeof s->held);
    s->place_share = s->turn_share = 1;
    s->variance = 0;
    if (!trusted || !variances_of(fit->information, &own)) return;
    s->variance = own.turn;
    if (!hint->measured || !(before > 0)) return;
    const double variance = before + fv_turn_variance(&hint->turned, &hint->gyro.doubt) +
                            fv_turn_bias_variance(&hint->turned, hint->gyro.bias_sigma);
    innovation(hint, last, T, step + 3);
    if (fv_turn_contradicts(step + 3, variance + own.turn)) return;
    memcpy(H, fit->information, sizeof H);
    for (int i = 3; i < 6; i++) {
        step[i] /= variance;
        H[7 * i] += 1 / variance;
    }
    if (!variances_of(H, &both) || !fv_ldlt_solve(H, 6, step)) return;
    fv_se3_move(T, step);
    fv_copy3(step + 3, s->held);
    s->variance = both.turn;
    s->place_share = __builtin_sqrt(both.place / own.place);
    s->turn_share = __builtin_sqrt(both.turn / own.turn);
}

void fv_odometry_share_own(struct fv_odometry *o)
{
    const struct fv_turn_state *s = &o->state->turn;
    o->state->covariance.own_position *= s->place_share;
    o->state->covariance.own_turn *= s->turn_share;
}

void fv_odometry_seen_attitude(const struct fv_odometry *o, double R[9])
{
    double E[9], seen[9];
    fv_so3_exp(o->state->turn.held, E);
    fv_multiply33(R, E, seen);
    memcpy(R, seen, sizeof seen);
}

void fv_odometry_follow_turn(struct fv_odometry *o)
{
    struct fv_turn_state *s = &o->state->turn;
    const struct fv_motion_hint *hint = &o->state->localise.hint;
    const struct fv_keyframe *newest = &o->map.keyframes[o->state->newest],
                             *frame = &o->map.keyframes[fv_map_current(&o->map)];
    struct fv_turn since = hint->turned;
    if (!o->state->pose.posed) {
        s->variance = 0;
        memset(s->held, 0, sizeof s->held);
        return;
    }
    if (o->turns == NULL) return;
    fv_subtract3(hint->rate, s->rate, since.rate_change);
    fv_copy3(hint->rate, s->rate);
    fv_turns_follow(o->turns, hint->measured ? &since : NULL, &hint->gyro);
    if (newest->used && newest->stamp_ns == frame->stamp_ns)
        fv_turns_keyframe(o->turns, newest->number);
}
