#include "sim.h"

#include <string.h>

/* Wheel odometry of the body that carries the camera, at a rate of its own and with errors of each
 * step: what wheels or legs report. A body that is carried off does not turn its wheels: such steps
 * are left out. */

static const double carried_off_m_s = 20.0;

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

struct state {
    double last[12];          /* true T_world_body of the last sample */
    double R[9], position[3]; /* its reading: T_wheel_odom_body */
};

/* Move on by a step that ends at `time_s`. */
static void advance(const struct fovea_source *source, struct state *o, uint64_t n, double time_s)
{
    const double step_s = 1 / source->options.wheel_odometry_hz;
    struct fv_random random;
    double T[12], R[9], t[3], moved2 = 0;
    fv_sim_motion_body(&source->motion, time_s, T);
    if (n == 0) {
        memcpy(o->last, T, sizeof T);
        memcpy(o->R, (const double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof o->R);
    }
    fv_sim_relative(o->last, T, R, t);
    memcpy(o->last, T, sizeof T);
    for (int i = 0; i < 3; i++)
        moved2 += t[i] * t[i];
    if (moved2 > carried_off_m_s * carried_off_m_s * step_s * step_s) return;
    fv_random_seed(&random, source->options.seed ^ (n + 1) * 0xD1B54A32D192ED03u);
    double stretch = 1 + source->options.wheel_odometry_noise * fv_random_normal(&random);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            o->position[r] += stretch * o->R[3 * r + k] * t[k];
    turn(o->R, R);
}

static void sample(const struct fovea_source *source, void *state, uint64_t n, double begin_s,
                   struct fovea_sample *out)
{
    struct state *o = state;
    advance(source, o, n,
            fv_sim_frame_time(source, 0) +
                (begin_s + (double)n / source->options.wheel_odometry_hz));
    memcpy(out->wheel_odometry.position_m, o->position, sizeof o->position);
    fv_sim_quaternion(o->R, out->wheel_odometry.orientation);
}

const struct fv_sim_body_sensor fv_sim_wheel_odometry = {
    .kind = FOVEA_SAMPLE_WHEEL_ODOMETRY,
    .name = "wheel_odometry",
    .hz = offsetof(struct fv_sim_options, wheel_odometry_hz),
    .state_bytes = sizeof(struct state),
    .sample = sample,
};
