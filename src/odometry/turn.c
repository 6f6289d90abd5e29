#include "odometry/turn.h"

#include <string.h>

#include "geometry/linear.h"
#include "geometry/vec.h"
#include "odometry/odometry.h"

/* Mean variances of the axes of a pose. */
struct variances {
    double position, turn;
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
        *(i < 3 ? &v->position : &v->turn) += e[i] / 3;
    }
    return v->position > 0 && v->turn > 0;
}

/* The turn since the last frame. False: it is no measurement. */
static bool turn_since(const struct fv_odometry *o, struct fv_turn *turn)
{
    const struct fv_motion_hint *hint = &o->state->localise.hint;
    const struct fv_turn_state *s = &o->state->turn;
    double before[3];
    if (!hint->measured || !s->rated) return false;
    *turn = hint->turned;
    fv_rotate_back3(turn->R, s->rate, before);
    fv_subtract3(hint->rate, before, turn->rate_change);
    return true;
}

/* The small turn that leads from the frame's own attitude to the measured one. */
static void innovation(const struct fv_turn *turn, const double bias[3], const struct fv_se3 *last,
                       const struct fv_se3 *T, double out[3])
{
    double R_last_now[9], expected[9], E[9];
    fv_turn_correct(turn, bias, R_last_now);
    fv_multiply_back33(R_last_now, last->R, expected);
    fv_multiply33_transposed(expected, T->R, E);
    fv_so3_log(E, out);
}

void fv_odometry_hold_turn(struct fv_odometry *o, const struct fv_se3 *last,
                           const struct fv_pose_fit *fit, bool trusted, struct fv_se3 *T)
{
    struct fv_turn_state *s = &o->state->turn;
    const struct fv_gyro_known *gyro = &o->state->localise.hint.gyro;
    /* A frame that was found again follows no frame. */
    const double before = o->state->state == FOVEA_TRACKING_LOST ? 0 : s->variance;
    double step[6] = {0}, H[36];
    struct fv_turn turn;
    struct variances own, both;
    memset(s->held, 0, sizeof s->held);
    s->position_fraction = 1;
    s->variance = 0;
    if (o->turns == NULL || !trusted || !variances_of(fit->information, &own)) return;
    s->variance = own.turn;
    if (!(before > 0) || !turn_since(o, &turn)) return;
    const double variance = before + fv_turn_variance(&turn, &gyro->doubt) +
                            fv_turn_bias_variance(&turn, gyro->bias_sigma);
    innovation(&turn, gyro->bias, last, T, step + 3);
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
    s->position_fraction = __builtin_sqrt(both.position / own.position);
}

void fv_odometry_reduce_own(struct fv_odometry *o)
{
    o->state->covariance.own_position *= o->state->turn.position_fraction;
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
    struct fv_turn turn;
    if (!o->state->pose.posed) {
        s->variance = 0;
        memset(s->held, 0, sizeof s->held);
        return;
    }
    if (o->turns == NULL) return;
    fv_turns_follow(o->turns, turn_since(o, &turn) ? &turn : NULL, &hint->gyro);
    fv_copy3(hint->rate, s->rate);
    s->rated = hint->measured;
    if (newest->used && newest->stamp_ns == frame->stamp_ns)
        fv_turns_keyframe(o->turns, newest->number);
}
