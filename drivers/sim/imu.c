#include "sim.h"

#include <string.h>

/* A simulated inertial sensor, anywhere on the body. A sample
 * stands for the interval that ends at its stamp: the mean angular rate turns the attitude at its
 * begin exactly into that at its end, and the mean specific force, in the attitude half-way,
 * changes the velocity by what it changes. So samples without noise, integrated in this way, give
 * the motion back. A body that is carried off in an instant (`kidnap`) reads rest there. Biases
 * begin at values drawn from the seed and walk on; an axis reports its range at most. A sample
 * stands for what is at its stamp plus the time offset. */

static const double carried_off_m_s = 20.0;
static const double half_step_s = 1e-3; /* of the velocity's difference quotient */

/* The sensor so far. */
struct state {
    double gyro_bias[3], acceleration_bias[3];
};

static void describe(const struct fv_sim_options *options, struct fovea_rig *rig)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    rig->has_imu = true;
    fv_sim_pose_rows(&options->imu_pose, rig->imu.T_body_imu);
    rig->imu.rate_hz = options->imu_hz;
    rig->imu.gyro_noise = options->imu_noise * options->gyro_noise;
    rig->imu.gyro_walk = options->imu_noise * options->gyro_walk;
    rig->imu.acceleration_noise = options->imu_noise * options->acceleration_noise;
    rig->imu.acceleration_walk = options->imu_noise * options->acceleration_walk;
    rig->imu.gyro_range = options->gyro_range_rad_s;
    rig->imu.acceleration_range = options->acceleration_range_m_s2;
    /* The mean of an interval is what an instrument would read in its middle. */
    const double offset_ns =
        (options->imu_offset_known ? options->imu_offset_ms * 1e6 : 0) - 0.5e9 / options->imu_hz;
    rig->imu.time_offset_ns = (int64_t)(offset_ns + (offset_ns < 0 ? -0.5 : 0.5));
    if (rig->cameras[0].has_T_body_cam) return;
    rig->cameras[0].has_T_body_cam = true;
    memcpy(rig->cameras[0].T_body_cam, identity, sizeof identity);
}

static void pose(const struct fovea_source *source, double time_s, double T_world_imu[12])
{
    fv_sim_motion_body(&source->motion, time_s, T_world_imu);
    fv_sim_compose(T_world_imu, source->info.rig.imu.T_body_imu, T_world_imu);
}

/* Velocity in the world, its own: beside the body's origin it holds what turning adds. false: the
 * body is carried off about this time. */
static bool velocity(const struct fovea_source *source, double time_s, double v[3])
{
    double before[12], after[12], moved2 = 0;
    pose(source, time_s - half_step_s, before);
    pose(source, time_s + half_step_s, after);
    for (int i = 0; i < 3; i++) {
        v[i] = (after[4 * i + 3] - before[4 * i + 3]) / (2 * half_step_s);
        moved2 += v[i] * v[i];
    }
    return moved2 < carried_off_m_s * carried_off_m_s;
}

/* v <- v turned back by the unit quaternion q. */
static void turn_back(const double q[4], double v[3])
{
    const double u[3] = {-q[1], -q[2], -q[3]};
    double t[3], c[3];
    for (int i = 0; i < 3; i++)
        t[i] = 2 * (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
    for (int i = 0; i < 3; i++)
        c[i] = u[(i + 1) % 3] * t[(i + 2) % 3] - u[(i + 2) % 3] * t[(i + 1) % 3];
    for (int i = 0; i < 3; i++)
        v[i] += q[0] * t[i] + c[i];
}

/* What an ideal sensor reads over [end_s - step_s, end_s]. */
static void ideal(const struct fovea_source *source, double end_s, double step_s,
                  struct fovea_imu_sample *sample)
{
    double a[12], b[12], R[9], t[3], q[4], v0[3], v1[3],
        force[3] = {0, 0, source->options.gravity_m_s2};
    double moved2 = 0;
    pose(source, end_s - step_s, a);
    pose(source, end_s, b);
    fv_sim_relative(a, b, R, t);
    for (int i = 0; i < 3; i++)
        moved2 += t[i] * t[i];
    bool rest = !velocity(source, end_s - step_s, v0);
    rest = !velocity(source, end_s, v1) || rest;
    rest = rest || moved2 > carried_off_m_s * carried_off_m_s * step_s * step_s;
    fv_sim_quaternion(R, q);
    const double s = __builtin_sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double rate = s > 0 && !rest ? 2 * fv_atan2(s, q[0]) / (s * step_s) : 0;
    for (int i = 0; i < 3; i++)
        sample->gyro[i] = rate * q[i + 1];
    for (int i = 0; i < 3 && !rest; i++)
        force[i] += (v1[i] - v0[i]) / step_s;
    const double n = 1 / __builtin_sqrt(2 * (1 + q[0]));
    const double half[4] = {(1 + q[0]) * n, q[1] * n, q[2] * n, q[3] * n};
    for (int i = 0; i < 3; i++)
        sample->acceleration[i] = a[i] * force[0] + a[4 + i] * force[1] + a[8 + i] * force[2];
    if (!rest) turn_back(half, sample->acceleration);
}

/* The biases that the sensor begins with. */
static void begin_biases(const struct fv_sim_options *options, struct state *imu)
{
    struct fv_random random;
    fv_random_seed(&random, options->seed ^ 0xB1A5E5u);
    for (int i = 0; i < 3; i++) {
        imu->gyro_bias[i] = options->gyro_bias_rad_s * fv_random_normal(&random);
        imu->acceleration_bias[i] = options->acceleration_bias_m_s2 * fv_random_normal(&random);
    }
}

/* What an axis of this range reports; 0: of any. */
static double within(double value, double range)
{
    if (range == 0) return value;
    return fv_within(value, range);
}

static void sample(const struct fovea_source *source, void *state, uint64_t n, double begin_s,
                   struct fovea_sample *out)
{
    const struct fv_sim_options *options = &source->options;
    struct state *imu = state;
    const double step_s = 1 / options->imu_hz, factor = options->imu_noise,
                 white = factor / __builtin_sqrt(step_s), walk = factor * __builtin_sqrt(step_s);
    struct fv_random random;
    if (n == 0) begin_biases(options, imu);
    begin_s = fv_sim_frame_time(source, 0) + begin_s + options->imu_offset_ms * 1e-3;
    ideal(source, begin_s + (double)n * step_s, step_s, &out->imu);
    fv_random_seed(&random, options->seed ^ (n + 1) * 0xA24BAED4963EE407u);
    for (int i = 0; i < 3; i++) {
        imu->gyro_bias[i] += walk * options->gyro_walk * fv_random_normal(&random);
        imu->acceleration_bias[i] += walk * options->acceleration_walk * fv_random_normal(&random);
        out->imu.gyro[i] +=
            imu->gyro_bias[i] + white * options->gyro_noise * fv_random_normal(&random);
        out->imu.acceleration[i] += imu->acceleration_bias[i] +
                                    white * options->acceleration_noise * fv_random_normal(&random);
        out->imu.gyro[i] = within(out->imu.gyro[i], options->gyro_range_rad_s);
        out->imu.acceleration[i] =
            within(out->imu.acceleration[i], options->acceleration_range_m_s2);
    }
}

const struct fv_sim_body_sensor fv_sim_imu = {
    .kind = FOVEA_SAMPLE_IMU,
    .name = "imu",
    .hz = offsetof(struct fv_sim_options, imu_hz),
    .state_bytes = sizeof(struct state),
    .describe = describe,
    .sample = sample,
};
