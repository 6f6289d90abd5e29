/* How sure a pose is that goes on by the samples, without a picture. */
#include <string.h>

#include "geometry/vec.h"
#include "scale/inertial.h"

enum {
    TAIL = FV_INERTIAL_TAIL,
    TURN = FV_INERTIAL_TURN,
    VELOCITY = FV_INERTIAL_VELOCITY,
    BIAS = FV_INERTIAL_ACCELERATION_BIAS,
    DOWN = FV_INERTIAL_DOWN,
    GYRO = FV_INERTIAL_GYRO_BIAS
};

/* Derivatives of position (world) and turn (sensor, on the right) after `sum` by what the estimator
 * is unsure of. */
static void derivatives(const struct fv_inertial_stage *stage, const struct fv_preintegration *sum,
                        double J[6 * FV_INERTIAL_TAIL])
{
    const struct fv_inertial_estimate *e = fv_inertial_result(&stage->estimator);
    const double *R = stage->state->live.T_world_imu.R, t = sum->time_s;
    double P[9], RP[9], RA[9], RG[9];
    memset(J, 0, 6 * TAIL * sizeof *J);
    fv_cross_matrix(sum->position, P);
    fv_multiply33(R, P, RP);
    fv_multiply33(R, sum->position_acceleration, RA);
    fv_multiply33(R, sum->position_gyro, RG);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            J[r * TAIL + TURN + c] = -RP[3 * r + c];
            J[r * TAIL + VELOCITY + c] = r == c ? t : 0;
            J[r * TAIL + BIAS + c] = RA[3 * r + c];
            J[r * TAIL + GYRO + c] = RG[3 * r + c];
            if (c < 2)
                J[r * TAIL + DOWN + c] =
                    stage->estimator.config.gravity * t * t / 2 * e->across[c][r];
            J[(3 + r) * TAIL + GYRO + c] = sum->turn_gyro[3 * r + c];
        }
}

/* Covariance of the motion since the last pose: of the sensor's position in world and its turn. */
static void covariance_of_sensor(const struct fv_inertial_stage *stage,
                                 const struct fv_preintegration *sum, double S[36])
{
    const double *C = fv_inertial_result(&stage->estimator)->covariance,
                 *R = stage->state->live.T_world_imu.R, t = sum->time_s;
    double J[6 * TAIL], JC[6 * TAIL], block[9], turned[9];
    derivatives(stage, sum, J);
    for (int r = 0; r < 6; r++)
        for (int c = 0; c < TAIL; c++) {
            JC[r * TAIL + c] = 0;
            for (int k = 0; k < TAIL; k++)
                JC[r * TAIL + c] += J[r * TAIL + k] * C[k * TAIL + c];
        }
    for (int r = 0; r < 6; r++)
        for (int c = 0; c < 6; c++) {
            S[6 * r + c] = r == c && r < 3 ? stage->state->live.variance * t * t : 0;
            for (int k = 0; k < TAIL; k++)
                S[6 * r + c] += JC[r * TAIL + k] * J[c * TAIL + k];
        }
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            block[3 * r + c] = sum->covariance[9 * (6 + r) + 6 + c];
    fv_multiply33(R, block, turned);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            S[6 * r + c] += fv_dot3(turned + 3 * r, R + 3 * c);
            S[6 * (3 + r) + 3 + c] += sum->covariance[9 * r + c];
        }
}

void fv_inertial_stage_coast_covariance(const struct fv_inertial_stage *stage,
                                        const struct fv_preintegration *sum, const double R[9],
                                        double out[21])
{
    double S[36], own[36], sensor[21];
    covariance_of_sensor(stage, sum, S);
    for (int r = 0; r < 6; r++)
        for (int c = 0; c < 6; c++) {
            double value = 0;
            for (int k = 0; k < 3; k++)
                for (int m = 0; m < 3; m++)
                    value += (r < 3 ? R[3 * k + r] : k == r - 3) *
                             (c < 3 ? R[3 * m + c] : m == c - 3) *
                             S[6 * (r < 3 ? k : 3 + k) + (c < 3 ? m : 3 + m)];
            own[6 * r + c] = value;
        }
    for (int r = 0, k = 0; r < 6; r++)
        for (int c = r; c < 6; c++, k++)
            sensor[k] = own[6 * r + c];
    fv_se3_carry_covariance(&stage->estimator.config.T_cam_imu, sensor, out);
}

double fv_inertial_stage_coast_velocity_sigma(const struct fv_inertial_stage *stage,
                                              const struct fv_preintegration *sum)
{
    static const int acceleration[3] = {15, 18, 20}; /* on the diagonal of the biases' covariance */
    const struct fv_inertial_stage_state *s = stage->state;
    const double t = sum->time_s,
                 tilt = stage->estimator.config.gravity * s->known.gravity_sigma * t;
    double variance = s->live.variance + tilt * tilt;
    for (int i = 0; i < 3; i++)
        variance +=
            (sum->covariance[10 * (3 + i)] + t * t * s->known.bias_covariance[acceleration[i]]) / 3;
    return __builtin_sqrt(variance);
}
