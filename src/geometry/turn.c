#include "geometry/turn.h"

#include <string.h>

#include "geometry/se3.h"
#include "geometry/vec.h"

static const double pictures_sigma = 2e-3, contradiction_sigmas2 = 16;
static const double variance_least = 1e-12; /* no turn is known better than to a microradian */

void fv_turn_begin(struct fv_turn *turn, const double bias[3])
{
    memset(turn, 0, sizeof *turn);
    for (int i = 0; i < 3; i++)
        turn->R[4 * i] = 1;
    fv_copy3(bias, turn->bias);
}

void fv_turn_correct(const struct fv_turn *turn, const double bias[3], double R[9])
{
    double more[3], error[3], E[9];
    fv_subtract3(bias, turn->bias, more);
    fv_rotate3(turn->by_bias, more, error);
    fv_so3_exp(error, E);
    fv_multiply33(turn->R, E, R);
}

void fv_turn_join(struct fv_turn *turn, const struct fv_turn *next)
{
    double R_next[9], R[9], carried[9], before[3];
    fv_turn_correct(next, turn->bias, R_next);
    fv_multiply33(turn->R, R_next, R);
    fv_multiply_back33(R_next, turn->by_bias, carried);
    memcpy(turn->R, R, sizeof R);
    for (int i = 0; i < 9; i++)
        turn->by_bias[i] = carried[i] + next->by_bias[i];
    fv_rotate_back3(R_next, turn->rate_change, before);
    for (int i = 0; i < 3; i++)
        turn->rate_change[i] = before[i] + next->rate_change[i];
    turn->variance += next->variance;
    turn->time_s += next->time_s;
}

void fv_turn_error(const struct fv_turn *turn, const double bias[3], const double between[9],
                   double error[3])
{
    double R[9], E[9];
    fv_turn_correct(turn, bias, R);
    fv_multiply_back33(R, between, E);
    fv_so3_log(E, error);
}

/* E |w x d|^2 = |w|^2 tr M - w M w, of the two axes at right angles to w. */
static double mount_variance(const double turned[3], const double M[9])
{
    double along[3];
    fv_rotate3(M, turned, along);
    return (fv_dot3(turned, turned) * (M[0] + M[4] + M[8]) - fv_dot3(turned, along)) / 2;
}

double fv_turn_mount_fraction(const struct fv_turn *turn, const struct fv_turn_doubt *doubt)
{
    double turned[3];
    fv_so3_log(turn->R, turned);
    const double square = fv_dot3(turned, turned);
    return square > 0 ? mount_variance(turned, doubt->mount) / square : 0;
}

double fv_turn_variance(const struct fv_turn *turn, const struct fv_turn_doubt *doubt)
{
    double turned[3];
    fv_so3_log(turn->R, turned);
    return variance_least + turn->variance + mount_variance(turned, doubt->mount) +
           doubt->scale * doubt->scale * fv_dot3(turned, turned) / 3 +
           doubt->clock_s * doubt->clock_s * fv_dot3(turn->rate_change, turn->rate_change);
}

double fv_turn_bias_variance(const struct fv_turn *turn, double sigma)
{
    double by = 0; /* s^2 */
    for (int i = 0; i < 9; i++)
        by += turn->by_bias[i] * turn->by_bias[i] / 3;
    return by * sigma * sigma;
}

bool fv_turn_contradicts(const double error[3], double variance)
{
    return !(fv_dot3(error, error) <=
             contradiction_sigmas2 * (variance + pictures_sigma * pictures_sigma));
}
