#include "inertial/preintegration.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/se3.h"
#include "geometry/vec.h"

enum { SIZE = 9, TURN = 0, VELOCITY = 3, POSITION = 6 };

void fv_cross_matrix(const double v[3], double M[9])
{
    const double rows[9] = {0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0};
    memcpy(M, rows, sizeof rows);
}

void fv_preintegration_begin(struct fv_preintegration *sum, const struct fv_imu_biases *biases)
{
    memset(sum, 0, sizeof *sum);
    sum->biases = *biases;
    for (int i = 0; i < 3; i++)
        sum->turn[4 * i] = 1;
}

/* Right Jacobian of the exponential: exp(w + d) = exp(w) exp(J d) for small d. */
static void right_jacobian(const double w[3], double J[9])
{
    double square = fv_dot3(w, w), a, b; /* (1 - cos x) / x^2 and (x - sin x) / x^3 */
    if (square < 1e-4) {
        a = 0.5 - square / 24 + square * square / 720;
        b = (1 - square / 20 + square * square / 840) / 6;
    } else {
        const double angle = __builtin_sqrt(square);
        a = (1 - fv_cos(angle)) / square;
        b = (angle - fv_sin(angle)) / (square * angle);
    }
    double W[9], WW[9];
    fv_cross_matrix(w, W);
    fv_multiply33(W, W, WW);
    for (int i = 0; i < 9; i++)
        J[i] = (i % 4 == 0 ? 1 : 0) - a * W[i] + b * WW[i];
}

/* What one step is: errors go as
 *   turn' = E^T turn - J gyro,  velocity' = velocity + C turn + D gyro - F acceleration,
 *   position' = position + velocity t + (C turn + D gyro - F acceleration) t / 2
 * with errors of gyro and acceleration as biases have them (to be subtracted from samples). */
struct step {
    double time_s;
    double E[9], J[9];       /* exp(w t), its right Jacobian times t */
    double C[9], D[9], F[9]; /* F = R half-way times t */
    double velocity[3];      /* R half-way times the force, times t */
};

static void make_step(const struct fv_preintegration *sum, const double gyro[3],
                      const double acceleration[3], double t, struct step *s)
{
    double whole[3], half[3], a[3], H[9], A[9], JH[9], FA[9], half_way[9];
    for (int i = 0; i < 3; i++) {
        whole[i] = (gyro[i] - sum->biases.gyro[i]) * t;
        half[i] = whole[i] / 2;
        a[i] = acceleration[i] - sum->biases.acceleration[i];
    }
    s->time_s = t;
    fv_so3_exp(whole, s->E);
    right_jacobian(whole, s->J);
    fv_so3_exp(half, H);
    right_jacobian(half, JH);
    fv_multiply33(sum->turn, H, half_way);
    for (int i = 0; i < 9; i++) {
        s->J[i] *= t;
        s->F[i] = half_way[i] * t;
    }
    fv_rotate3(s->F, a, s->velocity);
    fv_cross_matrix(a, A);
    fv_multiply33(s->F, A, FA); /* velocity error = -FA times the error of the turn half-way */
    fv_multiply33(FA, JH, s->D);
    double HT[9];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            HT[3 * r + c] = -H[3 * c + r];
    fv_multiply33(FA, HT, s->C);
    for (int i = 0; i < 9; i++)
        s->D[i] *= t / 2;
}

static void step_sums(struct fv_preintegration *sum, const struct step *s)
{
    double turn[9];
    for (int i = 0; i < 3; i++) {
        sum->position[i] += s->time_s * (sum->velocity[i] + s->velocity[i] / 2);
        sum->velocity[i] += s->velocity[i];
    }
    fv_multiply33(sum->turn, s->E, turn);
    memcpy(sum->turn, turn, sizeof turn);
    sum->time_s += s->time_s;
}

static void step_derivatives(struct fv_preintegration *sum, const struct step *s)
{
    const double t = s->time_s;
    double CT[9], ET[9];
    fv_multiply33(s->C, sum->turn_gyro, CT);
    fv_multiply_back33(s->E, sum->turn_gyro, ET);
    for (int i = 0; i < 9; i++) {
        const double by_gyro = CT[i] + s->D[i];
        sum->position_gyro[i] += t * (sum->velocity_gyro[i] + by_gyro / 2);
        sum->velocity_gyro[i] += by_gyro;
        sum->position_acceleration[i] += t * (sum->velocity_acceleration[i] - s->F[i] / 2);
        sum->velocity_acceleration[i] -= s->F[i];
        sum->turn_gyro[i] = ET[i] - s->J[i];
    }
}

/* out = A in, with A the step's transition: three rows of blocks over `columns` columns of 9. */
static void transit(const struct step *s, const double in[81], double out[81])
{
    const double t = s->time_s;
    for (int c = 0; c < SIZE; c++)
        for (int r = 0; r < 3; r++) {
            double turned = 0, bent = 0;
            for (int k = 0; k < 3; k++) {
                turned += s->E[3 * k + r] * in[SIZE * k + c];
                bent += s->C[3 * r + k] * in[SIZE * k + c];
            }
            const double velocity = in[SIZE * (VELOCITY + r) + c];
            out[SIZE * r + c] = turned;
            out[SIZE * (VELOCITY + r) + c] = velocity + bent;
            out[SIZE * (POSITION + r) + c] =
                in[SIZE * (POSITION + r) + c] + t * (velocity + bent / 2);
        }
}

static void transpose(double M[81])
{
    for (int r = 0; r < SIZE; r++)
        for (int c = 0; c < r; c++) {
            const double kept = M[SIZE * r + c];
            M[SIZE * r + c] = M[SIZE * c + r];
            M[SIZE * c + r] = kept;
        }
}

static void step_covariance(struct fv_preintegration *sum, const struct fv_imu_noise *noise,
                            const struct step *s)
{
    const double t = s->time_s, gyro = noise->gyro / t, force = noise->acceleration * t;
    double M[81], *S = sum->covariance;
    transit(s, S, M); /* A S, then A (A S)^T, S symmetric */
    transpose(M);
    transit(s, M, S);
    double G[27]; /* by the gyro's noise, 9x3 */
    for (int i = 0; i < 9; i++) {
        G[i] = -s->J[i];
        G[9 + i] = s->D[i];
        G[18 + i] = s->D[i] * t / 2;
    }
    for (int r = 0; r < SIZE; r++)
        for (int c = 0; c < SIZE; c++)
            S[SIZE * r + c] += gyro * fv_dot3(G + 3 * r, G + 3 * c);
    for (int i = 0; i < 3; i++) {
        S[(SIZE + 1) * (VELOCITY + i)] += force;
        S[SIZE * (VELOCITY + i) + POSITION + i] += force * t / 2;
        S[SIZE * (POSITION + i) + VELOCITY + i] += force * t / 2;
        S[(SIZE + 1) * (POSITION + i)] += force * t * t / 4;
    }
}

void fv_preintegration_step(struct fv_preintegration *sum, const struct fv_imu_noise *noise,
                            const double gyro[3], const double acceleration[3], double step_s)
{
    struct step step;
    make_step(sum, gyro, acceleration, step_s, &step);
    step_covariance(sum, noise, &step);
    step_derivatives(sum, &step);
    step_sums(sum, &step);
}

void fv_preintegration_correct(const struct fv_preintegration *sum,
                               const struct fv_imu_biases *biases, struct fv_preintegrated *out)
{
    double gyro[3], acceleration[3], turn[3], E[9];
    fv_subtract3(biases->gyro, sum->biases.gyro, gyro);
    fv_subtract3(biases->acceleration, sum->biases.acceleration, acceleration);
    fv_rotate3(sum->turn_gyro, gyro, turn);
    fv_so3_exp(turn, E);
    fv_multiply33(sum->turn, E, out->turn);
    for (int i = 0; i < 3; i++) {
        out->velocity[i] = sum->velocity[i] + fv_dot3(sum->velocity_gyro + 3 * i, gyro) +
                           fv_dot3(sum->velocity_acceleration + 3 * i, acceleration);
        out->position[i] = sum->position[i] + fv_dot3(sum->position_gyro + 3 * i, gyro) +
                           fv_dot3(sum->position_acceleration + 3 * i, acceleration);
    }
}
