#include "geometry/bundle.h"

#include <math.h>
#include <string.h>

enum { MAX_REJECTED = 5 };
static const double HUBER2 = 5.991;   /* 95 % of chi-square with 2 degrees of freedom */
static const double CONVERGED = 1e-6; /* relative fall of the cost that is not worth another iteration */
static const double DEPTH_MIN = 1e-6;
static const double BEHIND_CHI2 = 1e3; /* what an observation behind the camera costs */

void fv_bundle_carve(struct fv_bundle *bundle, uint32_t poses_max, uint32_t landmarks_max,
                     uint32_t observations_max, struct fv_arena *job)
{
    const size_t n = 6 * FV_BUNDLE_FREE_POSES_MAX;
    bundle->poses_max = poses_max;
    bundle->landmarks_max = landmarks_max;
    bundle->observations_max = observations_max;
    bundle->poses = fv_arena_take(job, poses_max, sizeof *bundle->poses);
    bundle->landmarks = fv_arena_take(job, landmarks_max, sizeof *bundle->landmarks);
    bundle->observations = fv_arena_take(job, observations_max, sizeof *bundle->observations);
    bundle->S = fv_arena_take(job, n * n, sizeof(double));
    bundle->g = fv_arena_take(job, n, sizeof(double));
    bundle->step = fv_arena_take(job, n, sizeof(double));
    bundle->diagonal = fv_arena_take(job, n, sizeof(double));
    bundle->tried = fv_arena_take(job, poses_max, sizeof *bundle->tried);
    bundle->tried_X = fv_arena_take(job, 3 * (size_t)landmarks_max, sizeof(double));
    bundle->tried_chi2 = fv_arena_take(job, observations_max, sizeof(float));
}

/* ---- one observation
 * ---------------------------------------------------------------------------------------- */

static void transform(const struct fv_bundle_pose *pose, const double X[3], double p[3])
{
    for (int i = 0; i < 3; i++) {
        p[i] = pose->R[3 * i] * X[0] + pose->R[3 * i + 1] * X[1] + pose->R[3 * i + 2] * X[2] + pose->t[i];
    }
}

bool fv_bundle_residual(const struct fv_bundle_observation *observation, const double p[3], double r[2],
                        double J[6])
{
    const double *b = observation->bearing, *A = observation->A;
    const double depth = b[0] * p[0] + b[1] * p[1] + b[2] * p[2];
    if (!(depth > DEPTH_MIN)) return false;
    const double inverse = 1.0 / depth;
    const double r0 = (A[0] * p[0] + A[1] * p[1] + A[2] * p[2]) * inverse;
    const double r1 = (A[3] * p[0] + A[4] * p[1] + A[5] * p[2]) * inverse;
    if (J != NULL) {
        for (int i = 0; i < 3; i++) {
            J[i] = (A[i] - r0 * b[i]) * inverse;
            J[3 + i] = (A[3 + i] - r1 * b[i]) * inverse;
        }
    }
    r[0] = r0;
    r[1] = r1;
    return true;
}

/* Huber: the weight of a residual, and half its robust square. */
static double huber_weight(double chi2)
{
    return chi2 <= HUBER2 ? 1.0 : sqrt(HUBER2 / chi2);
}

static double huber_cost(double chi2)
{
    return chi2 <= HUBER2 ? 0.5 * chi2 : sqrt(HUBER2 * chi2) - 0.5 * HUBER2;
}

/* What one observation adds to the normal equations: weighted residual, J for the point (2x3, world), P for
 * the pose. */
struct linear {
    double r[2], weight;
    double J[6];  /* dr/dX */
    double P[12]; /* dr/d(w, v) */
    int32_t free; /* of its pose, -1: fixed */
    bool valid;
};

static void linearise(const struct fv_bundle *bundle, const struct fv_bundle_observation *observation,
                      const double X[3], struct linear *out)
{
    const struct fv_bundle_pose *pose = &bundle->poses[observation->pose];
    double p[3], D[6];
    transform(pose, X, p);
    out->valid = fv_bundle_residual(observation, p, out->r, D);
    if (!out->valid) return;
    out->free = pose->free;
    out->weight = huber_weight(out->r[0] * out->r[0] + out->r[1] * out->r[1]);
    for (int row = 0; row < 2; row++) {
        const double *d = D + 3 * row;
        double *P = out->P + 6 * row, *J = out->J + 3 * row;
        for (int i = 0; i < 3; i++)
            J[i] = d[0] * pose->R[i] + d[1] * pose->R[3 + i] + d[2] * pose->R[6 + i];
        P[0] = p[1] * d[2] - p[2] * d[1]; /* d . (w x p) = w . (p x d) */
        P[1] = p[2] * d[0] - p[0] * d[2];
        P[2] = p[0] * d[1] - p[1] * d[0];
        P[3] = d[0];
        P[4] = d[1];
        P[5] = d[2];
    }
}

/* ---- one landmark
 * ------------------------------------------------------------------------------------------- */

/* Inverse of a symmetric positive 3x3 (V is full, row-major). False when it is not positive. */
static bool invert_3(const double V[9], double out[9])
{
    const double a = V[0], b = V[1], c = V[2], d = V[4], e = V[5], f = V[8];
    const double A = d * f - e * e, B = c * e - b * f, C = b * e - c * d;
    const double determinant = a * A + b * B + c * C;
    if (!(determinant > 0)) return false;
    const double s = 1.0 / determinant;
    out[0] = A * s;
    out[1] = out[3] = B * s;
    out[2] = out[6] = C * s;
    out[4] = (a * f - c * c) * s;
    out[5] = out[7] = (b * c - a * e) * s;
    out[8] = (a * d - b * b) * s;
    return true;
}

/* Damped 3x3 block and gradient of a landmark from its linearised observations. */
static bool landmark_block(const struct linear *linear, uint32_t count, double lambda, double inverse[9],
                           double g[3])
{
    double V[9] = {0};
    memset(g, 0, 3 * sizeof *g);
    for (uint32_t k = 0; k < count; k++) {
        if (!linear[k].valid) continue;
        const double *J = linear[k].J, w = linear[k].weight;
        for (int i = 0; i < 3; i++) {
            g[i] -= w * (J[i] * linear[k].r[0] + J[3 + i] * linear[k].r[1]);
            for (int j = 0; j < 3; j++)
                V[3 * i + j] += w * (J[i] * J[j] + J[3 + i] * J[3 + j]);
        }
    }
    for (int i = 0; i < 3; i++)
        V[4 * i] += lambda * V[4 * i] + 1e-12;
    return invert_3(V, inverse);
}

/* W = P^T w J (6x3), the coupling of an observation's pose and its landmark. */
static void coupling(const struct linear *linear, double W[18])
{
    const double *P = linear->P, *J = linear->J, w = linear->weight;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < 3; j++)
            W[3 * i + j] = w * (P[i] * J[j] + P[6 + i] * J[3 + j]);
    }
}

/* Squared residual of an observation, kept for the caller; returns what it costs. */
static double note_chi2(const double r[2], bool valid, float *kept)
{
    const double chi2 = valid ? r[0] * r[0] + r[1] * r[1] : BEHIND_CHI2;
    *kept = valid ? (float)(chi2 < 1e30 ? chi2 : 1e30) : INFINITY;
    return huber_cost(chi2);
}

static uint32_t linearise_all(const struct fv_bundle *bundle, const struct fv_bundle_landmark *landmark,
                              struct linear *linear)
{
    const uint32_t count =
        landmark->count < FV_BUNDLE_SEEN_MAX ? landmark->count : FV_BUNDLE_SEEN_MAX;
    for (uint32_t k = 0; k < count; k++) {
        linearise(bundle, &bundle->observations[landmark->first + k], landmark->X, &linear[k]);
    }
    return count;
}

/* Add the pose's own block of an observation to the reduced system. */
static void add_pose_block(struct fv_bundle *bundle, const struct linear *linear)
{
    const size_t n = 6 * (size_t)bundle->free_poses, at = 6 * (size_t)linear->free;
    const double *P = linear->P, w = linear->weight;
    for (size_t i = 0; i < 6; i++) {
        double *row = bundle->S + (at + i) * n + at;
        for (size_t j = 0; j <= i; j++)
            row[j] += w * (P[i] * P[j] + P[6 + i] * P[6 + j]);
        bundle->g[at + i] -= w * (P[i] * linear->r[0] + P[6 + i] * linear->r[1]);
        bundle->diagonal[at + i] += w * (P[i] * P[i] + P[6 + i] * P[6 + i]);
    }
}

/* S(a, b) -= Y W_b^T for one pair of free poses, a >= b; Y = W_a V^-1. */
static void subtract_pair(double *S, size_t n, size_t a, size_t b, const double Y[18], const double W[18])
{
    for (size_t i = 0; i < 6; i++) {
        double *row = S + (6 * a + i) * n + 6 * b;
        const double y0 = Y[3 * i], y1 = Y[3 * i + 1], y2 = Y[3 * i + 2];
        for (size_t j = 0; j < 6; j++)
            row[j] -= y0 * W[3 * j] + y1 * W[3 * j + 1] + y2 * W[3 * j + 2];
    }
}

/* Fold one landmark into the reduced system. Returns the block products done. */
static uint32_t fold(struct fv_bundle *bundle, const struct fv_bundle_landmark *landmark)
{
    struct linear linear[FV_BUNDLE_SEEN_MAX];
    double W[FV_BUNDLE_SEEN_MAX][18], inverse[9], g[3];
    const uint32_t count = linearise_all(bundle, landmark, linear);
    for (uint32_t k = 0; k < count; k++) {
        struct fv_bundle_observation *observation = &bundle->observations[landmark->first + k];
        bundle->cost += note_chi2(linear[k].r, linear[k].valid, &observation->chi2);
    }
    if (!landmark_block(linear, count, bundle->lambda, inverse, g)) return count;
    const size_t n = 6 * (size_t)bundle->free_poses;
    uint32_t pairs = count;
    for (uint32_t k = 0; k < count; k++) {
        if (!linear[k].valid || linear[k].free < 0) continue;
        add_pose_block(bundle, &linear[k]);
        coupling(&linear[k], W[k]);
        double Y[18];
        for (int i = 0; i < 6; i++) {
            for (int j = 0; j < 3; j++) {
                Y[3 * i + j] = W[k][3 * i] * inverse[j] + W[k][3 * i + 1] * inverse[3 + j] +
                               W[k][3 * i + 2] * inverse[6 + j];
            }
            bundle->g[6 * (size_t)linear[k].free + (size_t)i] -=
                Y[3 * i] * g[0] + Y[3 * i + 1] * g[1] + Y[3 * i + 2] * g[2];
        }
        for (uint32_t m = 0; m <= k; m++) {
            if (!linear[m].valid || linear[m].free < 0) continue;
            const size_t a = (size_t)linear[k].free, b = (size_t)linear[m].free;
            if (a >= b) {
                subtract_pair(bundle->S, n, a, b, Y, W[m]);
            } else { /* keep to the lower triangle: the transposed block */
                double Z[18];
                for (int i = 0; i < 6; i++) {
                    for (int j = 0; j < 3; j++) {
                        Z[3 * i + j] = W[m][3 * i] * inverse[j] + W[m][3 * i + 1] * inverse[3 + j] +
                                       W[m][3 * i + 2] * inverse[6 + j];
                    }
                }
                subtract_pair(bundle->S, n, b, a, Z, W[k]);
            }
            pairs++;
        }
    }
    return pairs;
}

/* ---- the reduced system
 * ------------------------------------------------------------------------------------- */

/* LDL^T in the lower triangle, then the solution into `x`. False: not positive definite. */
static bool solve_ldlt(double *S, size_t n, const double *g, double *x)
{
    for (size_t j = 0; j < n; j++) {
        double *Lj = S + j * n;
        for (size_t k = 0; k < j; k++) { /* L(j, k) still holds L D: divide, and take off the diagonal */
            const double scaled = Lj[k] / S[k * n + k];
            Lj[j] -= scaled * Lj[k];
            Lj[k] = scaled;
        }
        if (!(Lj[j] > 1e-12)) return false;
        for (size_t i = j + 1; i < n; i++) {
            double *Li = S + i * n;
            double sum = Li[j];
            for (size_t k = 0; k < j; k++)
                sum -= Li[k] * Lj[k];
            Li[j] = sum;
        }
    }
    for (size_t i = 0; i < n; i++) {
        double sum = g[i];
        for (size_t k = 0; k < i; k++)
            sum -= S[i * n + k] * x[k];
        x[i] = sum;
    }
    for (size_t i = 0; i < n; i++)
        x[i] /= S[i * n + i];
    for (size_t i = n; i-- > 0;) {
        for (size_t k = 0; k < i; k++)
            x[k] -= S[i * n + k] * x[i];
    }
    return true;
}

/* exp of a rotation vector times R, by the quaternion of the half angle to third order, normalised: steps are
 * small, and what is lost is corrected by the next iteration. */
static void rotate_by(const double w[3], const double R[9], double out[9])
{
    const double h2 = 0.25 * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    const double s = 0.5 * (1.0 - h2 / 6.0);
    double q[4] = {1.0 - h2 / 2.0, s * w[0], s * w[1], s * w[2]};
    const double norm = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
        q[i] *= norm;
    const double M[9] = {
        1 - 2 * (q[2] * q[2] + q[3] * q[3]), 2 * (q[1] * q[2] - q[0] * q[3]),
        2 * (q[1] * q[3] + q[0] * q[2]),     2 * (q[1] * q[2] + q[0] * q[3]),
        1 - 2 * (q[1] * q[1] + q[3] * q[3]), 2 * (q[2] * q[3] - q[0] * q[1]),
        2 * (q[1] * q[3] - q[0] * q[2]),     2 * (q[2] * q[3] + q[0] * q[1]),
        1 - 2 * (q[1] * q[1] + q[2] * q[2]),
    };
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out[3 * i + j] = M[3 * i] * R[j] + M[3 * i + 1] * R[3 + j] + M[3 * i + 2] * R[6 + j];
        }
    }
}

static void step_pose(const struct fv_bundle_pose *pose, const double step[6], struct fv_bundle_pose *out)
{
    double column[9] = {pose->t[0], 0, 0, pose->t[1], 0, 0, pose->t[2], 0, 0}, turned[9];
    *out = *pose;
    rotate_by(step, pose->R, out->R);
    rotate_by(step, column, turned);
    for (int i = 0; i < 3; i++)
        out->t[i] = turned[3 * i] + step[3 + i];
}

static void begin_linearise(struct fv_bundle *bundle)
{
    const size_t n = 6 * (size_t)bundle->free_poses;
    memset(bundle->S, 0, n * n * sizeof(double));
    memset(bundle->g, 0, n * sizeof(double));
    memset(bundle->diagonal, 0, n * sizeof(double));
    bundle->cost = 0;
    bundle->next_landmark = 0;
    bundle->phase = FV_BUNDLE_LINEARISE;
}

/* A step that did not lower the cost, or could not be computed: damp more and go on, or give up. */
static void reject(struct fv_bundle *bundle)
{
    bundle->lambda *= bundle->nu;
    bundle->nu *= 2;
    bundle->rejected++;
    bundle->iterations++;
    if (bundle->rejected >= MAX_REJECTED || bundle->iterations >= bundle->iterations_max) {
        bundle->phase = FV_BUNDLE_DONE;
    } else {
        begin_linearise(bundle);
    }
}

static void solve(struct fv_bundle *bundle)
{
    const size_t n = 6 * (size_t)bundle->free_poses;
    for (size_t i = 0; i < n; i++)
        bundle->S[i * n + i] += bundle->lambda * bundle->diagonal[i] + 1e-9;
    if (n > 0 && !solve_ldlt(bundle->S, n, bundle->g, bundle->step)) {
        reject(bundle);
        return;
    }
    bundle->gain_predicted = 0;
    for (size_t i = 0; i < n; i++) {
        bundle->gain_predicted +=
            0.5 * bundle->step[i] * (bundle->lambda * bundle->diagonal[i] * bundle->step[i] + bundle->g[i]);
    }
    for (uint32_t i = 0; i < bundle->pose_count; i++) {
        const struct fv_bundle_pose *pose = &bundle->poses[i];
        if (pose->free < 0) {
            bundle->tried[i] = *pose;
        } else {
            step_pose(pose, bundle->step + 6 * pose->free, &bundle->tried[i]);
        }
    }
    bundle->cost_tried = 0;
    bundle->next_landmark = 0;
    bundle->phase = FV_BUNDLE_TRY;
}

/* ---- trying a step
 * ------------------------------------------------------------------------------------------ */

/* Back-substitute one landmark, and what its observations cost after the step. */
static uint32_t try_landmark(struct fv_bundle *bundle, uint32_t index)
{
    const struct fv_bundle_landmark *landmark = &bundle->landmarks[index];
    struct linear linear[FV_BUNDLE_SEEN_MAX];
    double inverse[9], g[3], *X = bundle->tried_X + 3 * (size_t)index;
    const uint32_t count = linearise_all(bundle, landmark, linear);
    memcpy(X, landmark->X, 3 * sizeof(double));
    if (landmark_block(linear, count, bundle->lambda, inverse, g)) {
        double rest[3] = {g[0], g[1], g[2]};
        for (uint32_t k = 0; k < count; k++) {
            if (!linear[k].valid || linear[k].free < 0) continue;
            double W[18];
            coupling(&linear[k], W);
            const double *step = bundle->step + 6 * linear[k].free;
            for (int i = 0; i < 6; i++) {
                for (int j = 0; j < 3; j++)
                    rest[j] -= W[3 * i + j] * step[i];
            }
        }
        for (int i = 0; i < 3; i++) {
            X[i] += inverse[3 * i] * rest[0] + inverse[3 * i + 1] * rest[1] + inverse[3 * i + 2] * rest[2];
        }
    }
    for (uint32_t k = 0; k < count; k++) {
        const struct fv_bundle_observation *observation = &bundle->observations[landmark->first + k];
        double p[3], r[2];
        transform(&bundle->tried[observation->pose], X, p);
        const bool valid = fv_bundle_residual(observation, p, r, NULL);
        bundle->cost_tried += note_chi2(r, valid, &bundle->tried_chi2[landmark->first + k]);
    }
    return 3 * count + 1;
}

static void accept(struct fv_bundle *bundle)
{
    memcpy(bundle->poses, bundle->tried, bundle->pose_count * sizeof *bundle->poses);
    for (uint32_t i = 0; i < bundle->landmark_count; i++) {
        memcpy(bundle->landmarks[i].X, bundle->tried_X + 3 * (size_t)i, 3 * sizeof(double));
    }
    for (uint32_t i = 0; i < bundle->observation_count; i++)
        bundle->observations[i].chi2 = bundle->tried_chi2[i];
}

/* The step was tried on all landmarks: keep it or not, and change the damping by how well the model foresaw
 * it. */
static void judge(struct fv_bundle *bundle)
{
    const double gain = bundle->cost - bundle->cost_tried;
    if (!(gain >= 0)) {
        reject(bundle);
        return;
    }
    accept(bundle);
    const double ratio = bundle->gain_predicted > 0 ? gain / bundle->gain_predicted : 1.0;
    const double t = 2 * (ratio < 1.0 ? ratio : 1.0) - 1, shrink = 1 - t * t * t;
    bundle->lambda *= shrink > 1.0 / 3 ? shrink : 1.0 / 3;
    bundle->nu = 2;
    bundle->rejected = 0;
    bundle->iterations++;
    const bool converged = gain <= CONVERGED * bundle->cost;
    if (converged || bundle->iterations >= bundle->iterations_max) {
        bundle->cost = bundle->cost_tried;
        bundle->phase = FV_BUNDLE_DONE;
    } else {
        begin_linearise(bundle);
    }
}

/* ---- life
 * --------------------------------------------------------------------------------------------------- */

void fv_bundle_start(struct fv_bundle *bundle, uint32_t iterations)
{
    bundle->free_poses = 0;
    for (uint32_t i = 0; i < bundle->pose_count; i++)
        bundle->free_poses += bundle->poses[i].free >= 0;
    bundle->iterations = bundle->rejected = 0;
    bundle->iterations_max = iterations;
    bundle->lambda = 1e-4;
    bundle->nu = 2;
    begin_linearise(bundle);
}

/* All landmarks are folded in and the cost is known. */
static void linearised(struct fv_bundle *bundle)
{
    bundle->phase = bundle->iterations < bundle->iterations_max ? FV_BUNDLE_SOLVE : FV_BUNDLE_DONE;
}

bool fv_bundle_unit(struct fv_bundle *bundle)
{
    uint32_t pairs = 0;
    switch (bundle->phase) {
    case FV_BUNDLE_LINEARISE:
        while (bundle->next_landmark < bundle->landmark_count && pairs < FV_BUNDLE_UNIT_PAIRS) {
            pairs += fold(bundle, &bundle->landmarks[bundle->next_landmark++]);
        }
        if (bundle->next_landmark == bundle->landmark_count) linearised(bundle);
        break;
    case FV_BUNDLE_SOLVE:
        solve(bundle);
        break;
    case FV_BUNDLE_TRY:
        while (bundle->next_landmark < bundle->landmark_count && pairs < FV_BUNDLE_UNIT_PAIRS) {
            pairs += try_landmark(bundle, bundle->next_landmark++);
        }
        if (bundle->next_landmark == bundle->landmark_count) judge(bundle);
        break;
    case FV_BUNDLE_IDLE:
    case FV_BUNDLE_DONE:
        break;
    }
    return bundle->phase == FV_BUNDLE_DONE || bundle->phase == FV_BUNDLE_IDLE;
}
