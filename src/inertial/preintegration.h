/* Preintegration: what an inertial sensor says of the motion between two instants, as one
 * measurement.
 *
 * Turn, change of velocity and change of position are summed in the sensor's frame at the first
 * instant, free of gravity and of the velocity that it began with, so that they hold whatever pose
 * and velocity an estimator takes there. With them go their covariance and their derivatives by
 * the biases: a bias that an estimator moves a little corrects the measurement to first order, one
 * that it moves much needs the samples again. C. Forster, L. Carlone, F. Dellaert, D. Scaramuzza,
 * "On-manifold preintegration for real-time visual-inertial odometry", T-RO 2017.
 *
 * With R, v, p those of the sensor in a frame where g is the acceleration of free fall, i and j the
 * two instants and t the time between them:
 *   R_j = R_i turn,  v_j = v_i + g t + R_i velocity,
 *   p_j = p_i + v_i t + g t^2 / 2 + R_i position.
 * Errors of the turn are on its right, turn_true = turn exp(error). Orders of 9 are turn (rad),
 * velocity (m/s), position (m). A step takes the mean rate and the mean specific force of its
 * interval; the force counts in the attitude half-way. Plain data, no addresses, the same bits on
 * every machine. Real-time safe, any thread; a step is some 1,500 multiplications. */
#ifndef FOVEA_INERTIAL_PREINTEGRATION_H
#define FOVEA_INERTIAL_PREINTEGRATION_H

#ifdef __cplusplus
extern "C" {
#endif

struct fv_imu_biases {
    double gyro[3];         /* rad/s */
    double acceleration[3]; /* m/s^2 */
};

/* Squared densities of the samples' white noise. */
struct fv_imu_noise {
    double gyro;         /* rad^2/s^2/Hz */
    double acceleration; /* m^2/s^4/Hz */
};

struct fv_preintegration {
    double time_s;
    double turn[9]; /* rotation, row-major */
    double velocity[3], position[3];
    struct fv_imu_biases biases; /* that the samples were rid of */
    /* Derivatives by the biases, 3x3 row-major; that of the turn is of its error on the right. */
    double turn_gyro[9], velocity_gyro[9], position_gyro[9];
    double velocity_acceleration[9], position_acceleration[9];
    double covariance[81];
};

/* Nothing has happened yet. */
void fv_preintegration_begin(struct fv_preintegration *sum, const struct fv_imu_biases *biases);

/* Go on by an interval of `step_s` > 0 over which the sensor read these means. */
void fv_preintegration_step(struct fv_preintegration *sum, const struct fv_imu_noise *noise,
                            const double gyro[3], const double acceleration[3], double step_s);

/* The three sums as other biases would have them, to first order. */
struct fv_preintegrated {
    double turn[9], velocity[3], position[3];
};
void fv_preintegration_correct(const struct fv_preintegration *sum,
                               const struct fv_imu_biases *biases, struct fv_preintegrated *out);

/* M[3x3] = [v]x, so that M u = v x u. */
void fv_cross_matrix(const double v[3], double M[9]);

#ifdef __cplusplus
}
#endif
#endif
