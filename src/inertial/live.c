#include "inertial/live.h"

#include <string.h>

#include "geometry/vec.h"

static const int64_t gap_max_ns = 60000000;
static const double acceleration_sigma = 0.1; /* of what gravity and biases leave, m/s^2 */

void fv_inertial_live_take(struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                           int64_t stamp_ns, const double gyro[3], const double acceleration[3])
{
    const int64_t since_ns = live->any_sample ? stamp_ns - live->sample_ns : 0;
    if (live->any_sample && since_ns <= 0) return;
    if (live->begun && stamp_ns > live->reached_ns) {
        double mean_gyro[3], mean[3];
        const bool joined = live->any_sample && since_ns <= gap_max_ns;
        live->broken = live->broken || !joined;
        for (int i = 0; i < 3; i++) {
            mean_gyro[i] = joined ? (live->gyro[i] + gyro[i]) / 2 : gyro[i];
            mean[i] = joined ? (live->acceleration[i] + acceleration[i]) / 2 : acceleration[i];
        }
        fv_preintegration_step(&live->sum, noise, mean_gyro, mean,
                               (double)(stamp_ns - live->reached_ns) * 1e-9);
        live->reached_ns = stamp_ns;
    }
    live->any_sample = true;
    live->sample_ns = stamp_ns;
    fv_copy3(gyro, live->gyro);
    fv_copy3(acceleration, live->acceleration);
}

bool fv_inertial_live_reach(const struct fv_inertial_live *live, const struct fv_imu_noise *noise,
                            int64_t stamp_ns, struct fv_preintegration *sum)
{
    if (!live->begun || live->broken || !live->any_sample ||
        stamp_ns - live->sample_ns > gap_max_ns || stamp_ns <= live->pose_ns)
        return false;
    *sum = live->sum;
    if (stamp_ns > live->reached_ns)
        fv_preintegration_step(sum, noise, live->gyro, live->acceleration,
                               (double)(stamp_ns - live->reached_ns) * 1e-9);
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
    live->variance += acceleration_sigma * acceleration_sigma * t * t;
    const double gain = live->variance / (live->variance + noise);
    for (int i = 0; i < 3; i++)
        live->velocity[i] = velocity[i] + gain * (T->t[i] - predicted.t[i]) / t;
    live->variance *= 1 - gain;
}

void fv_inertial_live_pose(struct fv_inertial_live *live, int64_t stamp_ns,
                           const struct fv_se3 *T_world_imu, double position_sigma,
                           const struct fv_preintegration *sum, const double gravity[3],
                           const struct fv_imu_biases *biases)
{
    if (sum != NULL && gravity != NULL)
        follow(live, T_world_imu, position_sigma, sum, gravity);
    else
        live->moving = false;
    live->T_world_imu = *T_world_imu;
    live->begun = true;
    live->broken = false;
    live->pose_ns = stamp_ns;
    live->reached_ns = stamp_ns;
    fv_preintegration_begin(&live->sum, biases);
}
