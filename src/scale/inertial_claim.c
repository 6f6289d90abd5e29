/* What the inertial stage claims: when an estimate counts, and what is known by it. */
#include <string.h>

#include "geometry/vec.h"
#include "scale/inertial.h"

static const double claim_sigma = 0.04, claim_misfit = 4, claim_gravity_sigma = 0.05;
static const double claim_time_s = 3;
static const double settled_sigma = 0.02, settled_s = 6; /* of gravity: the sooner of both */
/* Of the scale: models of lenses and sensors are not better; the unit of a map by one camera
 * differs by this from place to place, in simulation and on EuRoC. */
static const double stereo_sigma_least = 0.005, mono_sigma_least = 0.01;
/* Poses tilt together, a map by more and more: of gravity in a frame's axes no estimate is surer
 * than this, rad. Found in simulation on odd seeds of four trajectories. */
static const double gravity_sigma_least = 1.2e-3;

/* Of two that are independent. */
static void join_gravity(const struct fv_map_gravity *a, struct fv_map_gravity *b)
{
    if (!(a->sigma > 0)) return;
    const double by_a = 1 / (a->sigma * a->sigma), by_b = 1 / (b->sigma * b->sigma);
    for (int i = 0; i < 3; i++)
        b->down[i] = by_a * a->down[i] + by_b * b->down[i];
    (void)fv_normalise3(b->down);
    b->sigma = __builtin_sqrt(1 / (by_a + by_b));
    if (b->sigma < gravity_sigma_least) b->sigma = gravity_sigma_least;
}

static void write_known(struct fv_inertial_stage *stage, const struct fv_inertial_estimate *e,
                        double sigma_least)
{
    struct fv_inertial_known *known = &stage->state->known;
    const double sigma2 = e->scale_sigma * e->scale_sigma + sigma_least * sigma_least;
    const int gyro = FV_INERTIAL_GYRO_BIAS, acceleration = FV_INERTIAL_ACCELERATION_BIAS;
    known->claimed = true;
    known->scale = e->own.scale;
    known->map_scale = fv_exp(e->log_scale);
    known->scale_sigma = __builtin_sqrt(sigma2);
    known->gravity_sigma = __builtin_sqrt(e->gravity_sigma * e->gravity_sigma +
                                          gravity_sigma_least * gravity_sigma_least);
    for (int i = 0; i < 3; i++)
        known->gravity[i] = stage->estimator.config.gravity * e->own.down[i];
    fv_copy3(e->mean_down, known->map_gravity.down);
    known->map_gravity.sigma =
        __builtin_sqrt(known->gravity_sigma * known->gravity_sigma + e->down_variance);
    join_gravity(&stage->state->brought, &known->map_gravity);
    memcpy(known->biases.gyro, e->shared.gyro_bias, sizeof known->biases.gyro);
    memcpy(known->biases.acceleration, e->own.acceleration_bias, sizeof known->biases.acceleration);
    for (int r = 0, k = 0; r < 6; r++)
        for (int c = r; c < 6; c++, k++)
            known->bias_covariance[k] =
                e->covariance[(r < 3 ? gyro + r : acceleration + r - 3) * FV_INERTIAL_TAIL +
                              (c < 3 ? gyro + c : acceleration + c - 3)];
}

/* The filter of frames goes on from what the stations say of its velocity then. */
static void correct_velocity(struct fv_inertial_stage *stage, const struct fv_inertial_estimate *e)
{
    struct fv_inertial_live *live = &stage->state->live;
    const struct fv_inertial_station *newest =
        fv_inertial_station_at(&stage->estimator, e->stations - 1);
    double variance = 0;
    if (!live->moving || fv_norm3(newest->live) == 0) return;
    for (int i = 0; i < 3; i++) {
        const double more = e->own.velocity[i] - newest->live[i];
        live->velocity[i] += more;
        for (uint32_t k = e->stations; k < fv_inertial_station_count(&stage->estimator); k++)
            fv_inertial_station_at(&stage->estimator, k)->live[i] += more; /* so were they */
        variance += e->covariance[(FV_INERTIAL_VELOCITY + i) * (FV_INERTIAL_TAIL + 1)] / 3;
    }
    live->variance = variance;
}

void fv_inertial_stage_judge(struct fv_inertial_stage *stage)
{
    struct fv_inertial_stage_state *s = stage->state;
    const struct fv_inertial_estimate *e = fv_inertial_result(&stage->estimator);
    if (s->cuts != stage->estimator.state->cuts) { /* another stretch: it must show itself */
        s->cuts = stage->estimator.state->cuts;
        s->agreeing = 0;
        s->anew = true;
    }
    if (!e->known) {
        s->agreeing = 0;
        return;
    }
    const double log_scale = fv_log(e->own.scale), moved = fv_abs(log_scale - s->log_scale);
    const bool good = e->scale_sigma < claim_sigma && e->misfit < claim_misfit &&
                      e->gravity_sigma < (s->metric ? claim_gravity_sigma : settled_sigma),
               agrees = moved < 2 * (e->scale_sigma < s->sigma ? s->sigma : e->scale_sigma);
    s->agreeing = good && agrees ? s->agreeing + 1 : 0;
    s->log_scale = log_scale;
    s->sigma = e->scale_sigma;
    const bool better =
        s->known.claimed && e->misfit < claim_misfit && e->scale_sigma < s->known.scale_sigma;
    const bool seasoned =
        (s->known.claimed && !s->anew) ||
        (s->agreeing >= FV_INERTIAL_AGREEING && (s->metric || e->time_s >= claim_time_s));
    if (!seasoned || !(good || better)) return;
    s->anew = s->doubted = false;
    write_known(stage, e, s->metric ? stereo_sigma_least : mono_sigma_least);
    correct_velocity(stage, e);
    s->claimed_ns = e->stamp_ns;
    s->claimed_sigma = s->known.scale_sigma;
    s->known.settled =
        s->known.settled || e->gravity_sigma < settled_sigma || e->time_s > settled_s;
}
