/* What another focal length adds to the covariance of a pose: see covariance_lens.h. */
#include "odometry/covariance_lens.h"

#include "geometry/se3.h"
#include "odometry/lens.h"
#include "odometry/odometry.h"

enum { ALERT_FRAMES = 300 };

static const double focal_spread = 2;     /* of changes in good runs over sigma of one frame, */
static const double focal_common = 0.001, /* and what frames have in common, that of their map, */
    focal_bent = 0.02;                    /* and of its bend */
static const double focal_sigmas = 3, focal_hint = 2; /* of both together */
static const double focal_max = 0.01;                 /* in good runs it stays below half of it */
static const double focal_alert = 0.004,
                    focal_less = 0.4;       /* of the sigmas of a hint, while on the alert */
static const double focal_fade = 0.9;       /* of the mean, per frame */
static const double focal_held_fade = 0.99; /* of what was clear, per frame */
static const double focal_shown =
    0.25; /* least of a change that the inliers of a fit without it show */

/* By how much changes of the focal length vary on good runs; `variance` is what independent errors
 * make of one. */
static double focal_sigma(double variance, double bend)
{
    const double bent = focal_bent * bend;
    return __builtin_sqrt(focal_spread * focal_spread * variance + focal_common * focal_common +
                          bent * bent);
}

/* What a frame shows of the focal length. */
struct shown {
    double change, variance, bend; /* variance: what independent errors make of the change */
};

static bool is_clear(const struct shown *shown)
{
    return __builtin_fabs(shown->change) > focal_sigmas * focal_sigma(shown->variance, shown->bend);
}

/* The change of the focal length to count. */
static double change_to_count(struct fv_covariance_state *s, const struct shown *shown)
{
    const double weight = 1 / shown->variance, own = __builtin_fabs(shown->change);
    s->change_sum = focal_fade * s->change_sum + weight * shown->change;
    s->change_weight = focal_fade * s->change_weight + weight;
    const double mean = __builtin_fabs(s->change_sum / s->change_weight),
                 hint = focal_hint * (s->alert_frames > 0 ? focal_less : 1),
                 mean_sigma = focal_sigma(1 / s->change_weight, shown->bend),
                 own_sigma = focal_sigma(shown->variance, shown->bend);
    const double of_mean = mean > hint * mean_sigma ? mean : 0,
                 of_own = own > hint * own_sigma ? own : 0;
    if (is_clear(shown)) return own / focal_shown;
    return of_own > of_mean ? of_own : of_mean;
}

bool fv_covariance_add_lens(struct fv_odometry *o, double variance, double bend,
                            double covariance[21])
{
    const struct fv_inverse_distance *distances =
        fv_map_metric(&o->map) ? fv_map_distances(&o->map, fv_map_current(&o->map)) : NULL;
    struct fv_covariance_state *s = &o->state->covariance;
    struct fv_lens_frame lens;
    if (!fv_lens_frame_current(o, distances, 1, &lens)) return false;
    const struct shown shown = {lens.change, lens.sigma_unit * lens.sigma_unit * variance, bend};
    const double counted = change_to_count(s, &shown),
                 times = lens.change != 0 ? counted / lens.change : 0;
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++) {
            s->lens[k] = times * times * lens.moved[row] * lens.moved[column];
            covariance[k] += s->lens[k];
        }
    const double own = __builtin_fabs(lens.change);
    const bool clear = is_clear(&shown);
    s->focal_held *= focal_held_fade;
    if (clear && own > s->focal_held) s->focal_held = own;
    if (s->alert_frames > 0) s->alert_frames--;
    if (clear && own > focal_alert) s->alert_frames = ALERT_FRAMES;
    s->focal = clear ? own : counted;
    if (s->focal_held > s->focal) s->focal = s->focal_held;
    return clear && own > focal_max;
}

void fv_covariance_add_reference_lens(const struct fv_odometry *o, const struct fv_se3 *T_frame_ref,
                                      double covariance[21])
{
    enum { TURN_FIRST = 15 }; /* of the upper triangle */
    double carried[21], turn[3];
    if (!fv_odometry_reference_known(o)) return;
    fv_se3_carry_covariance(T_frame_ref, o->state->reference.lens, carried);
    for (int k = 0; k < 21; k++)
        covariance[k] += carried[k];
    fv_so3_log(T_frame_ref->R, turn);
    const double focal = o->state->reference.focal, across[2] = {focal * turn[0], focal * turn[1]};
    covariance[TURN_FIRST] += across[0] * across[0];
    covariance[TURN_FIRST + 1] += across[0] * across[1];
    covariance[TURN_FIRST + 3] += across[1] * across[1];
}
