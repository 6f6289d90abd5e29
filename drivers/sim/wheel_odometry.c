#include "sim.h"

#include <string.h>

/* Wheel odometry of the body that carries the camera, at a rate of its own and with errors of each
 * step: what wheels or legs report. The body's frame is the camera's, so T_body_cam is the
 * identity. A body that is carried off does not turn its wheels: such steps are left out. */

static const double carried_off_m_s = 20.0;

void fv_sim_relative(const double a[12], const double b[12], double R[9], double t[3])
{
    for (int r = 0; r < 3; r++) {
        t[r] = 0;
        for (int k = 0; k < 3; k++)
            t[r] += a[4 * k + r] * (b[4 * k + 3] - a[4 * k + 3]);
        for (int c = 0; c < 3; c++)
            R[3 * r + c] = a[r] * b[c] + a[4 + r] * b[4 + c] + a[8 + r] * b[8 + c];
    }
}

/* Unit quaternion of a rotation whose trace may have any sign: the largest of its four parts comes
 * first. */
void fv_sim_quaternion(const double R[9], double q[4])
{
    double t = R[0] + R[4] + R[8], squares[4] = {t, R[0], R[4], R[8]};
    int best = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[best]) best = i;
    double s = 0.5 * __builtin_sqrt((best == 0 ? 1 + t : 1 + 2 * squares[best] - t)), f = 0.25 / s;
    const double w[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]},
                 v[3] = {R[5] + R[7], R[2] + R[6], R[1] + R[3]};
    q[0] = best == 0 ? s : f * w[best - 1];
    for (int i = 0; i < 3; i++)
        q[i + 1] = best == 0 ? f * w[i] : best == i + 1 ? s : f * v[3 - i - (best - 1)];
    for (int i = 0; i < 4 && q[0] < 0; i++)
        q[i] = i == 0 ? q[0] : -q[i];
    if (q[0] < 0) q[0] = -q[0];
}

/* R <- R S, and its rows made orthonormal again. */
static void turn(double R[9], const double S[9])
{
    double P[9];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            P[3 * r + c] = R[3 * r] * S[c] + R[3 * r + 1] * S[3 + c] + R[3 * r + 2] * S[6 + c];
    for (int r = 0; r < 2; r++) {
        for (int k = 0; k < r; k++) {
            double along = P[0] * P[3] + P[1] * P[4] + P[2] * P[5];
            for (int c = 0; c < 3; c++)
                P[3 * r + c] -= along * P[c];
        }
        double n = __builtin_sqrt(P[3 * r] * P[3 * r] + P[3 * r + 1] * P[3 * r + 1] +
                                  P[3 * r + 2] * P[3 * r + 2]);
        for (int c = 0; c < 3; c++)
            P[3 * r + c] /= n;
    }
    P[6] = P[1] * P[5] - P[2] * P[4];
    P[7] = P[2] * P[3] - P[0] * P[5];
    P[8] = P[0] * P[4] - P[1] * P[3];
    memcpy(R, P, sizeof P);
}

static void step(struct fovea_source *source, double time_s, double step_s)
{
    struct fv_sim_wheel_odometry *o = &source->wheel_odometry;
    struct fv_random random;
    double T[12], R[9], t[3], moved2 = 0;
    fv_sim_motion_pose(&source->motion, time_s, T);
    if (o->count == 0) memcpy(o->last, T, sizeof T);
    fv_sim_relative(o->last, T, R, t);
    memcpy(o->last, T, sizeof T);
    for (int i = 0; i < 3; i++)
        moved2 += t[i] * t[i];
    if (moved2 > carried_off_m_s * carried_off_m_s * step_s * step_s) return;
    fv_random_seed(&random, source->options.seed ^ (o->count + 1) * 0xD1B54A32D192ED03u);
    double stretch = 1 + source->options.wheel_odometry_noise * fv_random_normal(&random);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            o->position[r] += stretch * o->R[3 * r + k] * t[k];
    turn(o->R, R);
}

/* INT64_MAX: never. */
static int64_t stamp_of(double begin_s, uint64_t count, double hz)
{
    static const double most_ns = 9.2e18; /* that a stamp holds */
    const double stamp_ns = hz > 0 ? (begin_s + (double)count / hz) * 1e9 + 0.5 : most_ns;
    return stamp_ns < most_ns ? (int64_t)stamp_ns : INT64_MAX;
}

uint32_t fv_sim_samples(struct fovea_source *source, const struct fovea_frame *frame,
                        struct fovea_sample *samples, uint32_t count_max)
{
    const struct fv_sim_options *options = &source->options;
    struct fv_sim_wheel_odometry *o = &source->wheel_odometry;
    const double begin_s = (double)source->selection.start / options->rate_hz;
    uint32_t count = 0;
    if (source->selection.reverse) return 0;
    if (o->count == 0) memcpy(o->R, (const double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof o->R);
    for (; count < count_max; count++) {
        const int64_t wheel_odometry_ns = stamp_of(begin_s, o->count, options->wheel_odometry_hz),
                      imu_ns = stamp_of(begin_s, source->imu.count, options->imu_hz);
        struct fovea_sample *sample = &samples[count];
        if ((wheel_odometry_ns < imu_ns ? wheel_odometry_ns : imu_ns) > frame->stamp_ns) break;
        if (imu_ns <= wheel_odometry_ns) {
            sample->kind = FOVEA_SAMPLE_IMU;
            sample->imu.stamp_ns = imu_ns;
            fv_sim_imu_sample(source, fv_sim_frame_time(source, 0) + begin_s, &sample->imu);
            continue;
        }
        sample->kind = FOVEA_SAMPLE_WHEEL_ODOMETRY;
        sample->wheel_odometry.stamp_ns = wheel_odometry_ns;
        step(source,
             fv_sim_frame_time(source, 0) +
                 (begin_s + (double)o->count / options->wheel_odometry_hz),
             1 / options->wheel_odometry_hz);
        o->count++;
        memcpy(sample->wheel_odometry.position_m, o->position, sizeof o->position);
        fv_sim_quaternion(o->R, sample->wheel_odometry.orientation);
    }
    return count;
}
