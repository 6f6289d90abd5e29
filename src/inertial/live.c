#include "inertial/live.h"

#include <string.h>

#include "geometry/vec.h"
#include "inertial/stamp.h"

static const int64_t gap_max_ns = 60000000;
static const double way_max_s = 0.5;           /* between poses that measure a velocity */
static const double acceleration_sigma = 0.02; /* of what gravity and biases leave, m/s^2 */

/* Of a change of velocity, an axis, by the noise of its samples. */
static double sample_variance(const struct fv_preintegration *sum)
{
    const double *C = sum->covariance;
    return (C[3 * 10] + C[4 * 10] + C[5 * 10]) / 3;
}

static void use(struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                const struct fv_imu_reading *sample)
{
    const int64_t stamp_ns = sample->stamp_ns,
                  since_ns = live->any_sample ? fv_stamp_since(stamp_ns, live->sample_ns) : 0,
                  step_ns = fv_stamp_since(stamp_ns, live->reached_ns);
    if (live->begun && step_ns > 0) {
        const bool joined = live->any_sample && since_ns <= gap_max_ns && step_ns <= gap_max_ns;
        double gyro[3], acceleration[3];
        live->broken = live->broken || !joined;
        for (int i = 0; i < 3; i++) {
            gyro[i] = (live->gyro[i] + sample->gyro[i]) / 2;
            acceleration[i] = (live->acceleration[i] + sample->acceleration[i]) / 2;
        }
        if (joined)
            fv_preintegration_step(&live->sum, noise, gyro, acceleration, (double)step_ns * 1e-9);
        live->reached_ns = stamp_ns;
    }
    live->any_sample = true;
    live->sample_ns = stamp_ns;
    fv_copy3(sample->gyro, live->gyro);
    fv_copy3(sample->acceleration, live->acceleration);
}

static void use_oldest(struct fv_inertial_live *live, const struct fv_imu_noise *noise)
{
    use(live, noise, &live->ahead[live->ahead_first]);
    live->ahead_first = (live->ahead_first + 1) % FV_INERTIAL_AHEAD_MAX;
    live->ahead_count--;
}

void fv_inertial_live_take(struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                           const struct fv_imu_reading *sample)
{
    if (live->any_sample && sample->stamp_ns <= live->sample_ns) return;
    if (live->ahead_count == FV_INERTIAL_AHEAD_MAX) use_oldest(live, noise);
    live->ahead[(live->ahead_first + live->ahead_count++) % FV_INERTIAL_AHEAD_MAX] = *sample;
}

void fv_inertial_live_advance(struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                              int64_t stamp_ns)
{
    while (live->ahead_count > 0 && live->ahead[live->ahead_first].stamp_ns <= stamp_ns)
        use_oldest(live, noise);
}

bool fv_inertial_live_reach(const struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                            int64_t stamp_ns, struct fv_preintegration *sum)
{
    if (!live->begun || live->broken || !live->any_sample ||
        fv_stamp_since(stamp_ns, live->sample_ns) > gap_max_ns || stamp_ns <= live->pose_ns ||
        live->reached_ns > stamp_ns)
        return false;
    *sum = live->sum;
    if (stamp_ns > live->reached_ns)
        fv_preintegration_step(sum, noise, live->gyro, live->acceleration,
                               (double)fv_stamp_since(stamp_ns, live->reached_ns) * 1e-9);
    return sum->time_s > 0;
}

void fv_inertial_live_predict(const struct fv_inertial_live *live,
                              const struct fv_preintegration *sum, const double gravity[3],
                              struct fv_se3 *T_world_imu, double velocity[3])
{
    const double t = sum->time_s, *R = live->T_world_imu.R;
    double gained[3], moved[3];
    fv_rotate3(R, sum->velocity, gained);
    fv_rotate3(R, sum->position, moved);
    fv_multiply33(R, sum->turn, T_world_imu->R);
    for (int i = 0; i < 3; i++) {
        T_world_imu->t[i] =
            live->T_world_imu.t[i] + live->velocity[i] * t + gravity[i] * t * t / 2 + moved[i];
        velocity[i] = live->velocity[i] + gravity[i] * t + gained[i];
    }
}

/* The way between two poses measures the velocity at the first. */
static void follow(struct fv_inertial_live *live, const struct fv_se3 *T, double position_sigma,
                   const struct fv_preintegration *sum, const double gravity[3])
{
    const double t = sum->time_s, noise = 2 * position_sigma * position_sigma / (t * t);
    struct fv_se3 predicted;
    double velocity[3];
    if (!live->moving) {
        memset(live->velocity, 0, sizeof live->velocity);
        live->variance = 1e4;
        live->moving = true;
    }
    fv_inertial_live_predict(live, sum, gravity, &predicted, velocity);
    live->variance += acceleration_sigma * acceleration_sigma * t * t + sample_variance(sum);
    const double gain = live->variance / (live->variance + noise);
    for (int i = 0; i < 3; i++)
        live->velocity[i] = velocity[i] + gain * (T->t[i] - predicted.t[i]) / t;
    const double since = acceleration_sigma * t / 2; /* the mean of the way is not its end */
    live->variance = live->variance * (1 - gain) + since * since;
}

void fv_inertial_live_pose(struct fv_inertial_live *live, int64_t stamp_ns,
                           const struct fv_se3 *T_world_imu, double position_sigma,
                           const struct fv_preintegration *sum, const double gravity[3],
                           const struct fv_imu_biases *biases)
{
    if (sum != NULL && gravity != NULL && sum->time_s < way_max_s) {
        follow(live, T_world_imu, position_sigma, sum, gravity);
    } else {
        live->moving = false;
        memset(live->velocity, 0, sizeof live->velocity);
    }
    live->T_world_imu = *T_world_imu;
    live->begun = true;
    live->broken = false;
    live->pose_ns = stamp_ns;
    live->reached_ns = stamp_ns;
    fv_preintegration_begin(&live->sum, biases);
}
