/* The equations of the stations, and their elimination from the oldest on. */
#include <string.h>

#include "geometry/linear.h"
#include "geometry/normal_equations.h"
#include "geometry/vec.h"
#include "inertial/estimator.h"

/* Columns of a pair of stations: the older's own, the newer's own, the shared. Within an own. */
enum {
    OWN = FV_INERTIAL_OWN,
    TAIL = FV_INERTIAL_TAIL,
    PAIR = FV_INERTIAL_PAIR,
    NEXT = OWN,
    SHARED = 2 * OWN,
    LINK = 9, /* errors of a link */
    TURN = FV_INERTIAL_TURN,
    OFFSET = FV_INERTIAL_OFFSET,
    VELOCITY = FV_INERTIAL_VELOCITY,
    SCALE = FV_INERTIAL_SCALE,
    BIAS = FV_INERTIAL_ACCELERATION_BIAS,
    DOWN = FV_INERTIAL_DOWN,
    GYRO = FV_INERTIAL_GYRO_BIAS - OWN, /* among the shared */
    PLAIN_ITERATIONS = 3 /* until errors of poses are what they are and not those of a beginning */
};

/* What samples cannot tell however good they are, squared: times of exposure, and the form of the
 * motion between samples. */
static const double turn_floor = 2e-5 * 2e-5, velocity_floor = 5e-4 * 5e-4,
                    position_floor = 1e-4 * 1e-4;
static const double velocity_sigma_begin = 30, scale_sigma_begin = 30;
static const double handed_sigma_max = 0.1;   /* of the scale, relative */
static const double walk_floor = 1e-5 * 1e-5; /* of the acceleration bias, squared, per second */
static const double tilt_floor = 1e-5 * 1e-5; /* of gravity's direction, squared, rad per second */
static const double surprise = 3.5; /* length of three errors in sigmas: chi-square, 99.3 % */

struct pair {
    double H[PAIR * PAIR], g[PAIR]; /* lower triangle */
    double square;
};

static struct fv_normal normal_of(struct pair *pair)
{
    return (struct fv_normal){pair->H, pair->g, PAIR};
}

void fv_inertial_across(const double down[3], double across[2][3])
{
    int least = 0;
    for (int k = 1; k < 3; k++)
        if (fv_abs(down[k]) < fv_abs(down[least])) least = k;
    double axis[3] = {0, 0, 0};
    axis[least] = 1;
    fv_cross3(down, axis, across[0]);
    (void)fv_normalise3(across[0]);
    fv_cross3(down, across[0], across[1]);
}

/* ---- errors of one station ------------------------------------------------------------------- */

/* Three equal errors x with their variance, whose variables begin at `first`. */
static void add_three(struct pair *pair, int first, const double x[3], double variance)
{
    for (int k = 0; k < 3; k++) {
        pair->H[(first + k) * (PAIR + 1)] += 1 / variance;
        pair->g[first + k] -= x[k] / variance;
        pair->square += x[k] * x[k] / variance;
    }
}

/* The variance that three errors x of stated sigma are taken to have: larger where, as estimated so
 * far, they are larger than chance makes them (Huber's function, by reweighting). */
static double robust_variance(const struct fv_inertial_state *state, const double x[3],
                              double sigma)
{
    const double least = surprise * sigma, shown = fv_norm3(x);
    const bool settled = state->estimate.known || state->iteration >= PLAIN_ITERATIONS;
    return sigma * sigma * (settled && shown > least ? shown / least : 1);
}

/* The pose given. */
static void add_pose(struct pair *pair, const struct fv_inertial_state *state,
                     const struct fv_inertial_station *s)
{
    add_three(pair, TURN, s->now.turn, robust_variance(state, s->now.turn, s->pose.turn_sigma));
    add_three(pair, OFFSET, s->now.offset,
              robust_variance(state, s->now.offset, s->pose.position_sigma));
}

/* What is known of the oldest station beforehand. */
static void add_beginning(struct pair *pair, const struct fv_inertial *inertial,
                          const struct fv_inertial_station *s)
{
    const struct fv_inertial_state *state = inertial->state;
    const double metric = state->metric_sigma,
                 sigma = metric > 0 ? metric : scale_sigma_begin * s->now.scale,
                 off = metric > 0 ? s->now.scale - 1 : 0, none[3] = {0, 0, 0};
    double bias[3], gyro[3];
    const double square = pair->square;
    add_three(pair, VELOCITY, none, velocity_sigma_begin * velocity_sigma_begin);
    fv_subtract3(s->now.acceleration_bias, state->acceleration_bias, bias);
    add_three(pair, BIAS, bias, state->bias_sigma[1] * state->bias_sigma[1]);
    fv_subtract3(state->shared.gyro_bias, state->gyro_bias, gyro);
    add_three(pair, SHARED + GYRO, gyro, state->bias_sigma[0] * state->bias_sigma[0]);
    pair->H[SCALE * (PAIR + 1)] += 1 / (sigma * sigma);
    pair->g[SCALE] -= off / (sigma * sigma);
    pair->H[DOWN * (PAIR + 1)] += 1e-4;
    pair->H[(DOWN + 1) * (PAIR + 1)] += 1e-4;
    pair->square = square;
}

/* How far a station and the shared are from where a prior was linearised. */
static void away(const struct fv_inertial_prior *prior, const struct fv_inertial_own *own,
                 const struct fv_inertial_shared *shared, double x[TAIL])
{
    double across[2][3], down[3];
    fv_inertial_across(prior->own.down, across);
    fv_subtract3(own->down, prior->own.down, down);
    for (int k = 0; k < 3; k++) {
        x[TURN + k] = own->turn[k] - prior->own.turn[k];
        x[OFFSET + k] = own->offset[k] - prior->own.offset[k];
        x[VELOCITY + k] = own->velocity[k] - prior->own.velocity[k];
        x[BIAS + k] = own->acceleration_bias[k] - prior->own.acceleration_bias[k];
        x[OWN + GYRO + k] = shared->gyro_bias[k] - prior->shared.gyro_bias[k];
    }
    x[SCALE] = own->scale - prior->own.scale;
    for (int k = 0; k < 2; k++)
        x[DOWN + k] = fv_dot3(across[k], down);
}

/* A tail's variables among those of a pair, as those of the older station. */
static int column_of(int tail)
{
    return tail < OWN ? tail : tail + OWN;
}

static void add_tail(struct pair *pair, const double H[TAIL * TAIL], const double g[TAIL])
{
    for (int r = 0; r < TAIL; r++) {
        pair->g[column_of(r)] += g[r];
        for (int c = 0; c <= r; c++)
            pair->H[column_of(r) * PAIR + column_of(c)] += H[r * TAIL + c];
    }
}

/* Two values that belong to the directions across, in others: a row of what stands by them, or a
 * part of a gradient. */
static void turn_two(const double B[4], double *a, double *b)
{
    const double first = *a * B[0] + *b * B[2], second = *a * B[1] + *b * B[3];
    *a = first;
    *b = second;
}

/* Directions across gravity are chosen by its components: those of now may be others than those
 * that the prior was made in, by a quarter of a turn where two components are about the same. */
static void turn_prior(const struct fv_inertial_prior *prior, const struct fv_inertial_own *own,
                       double H[TAIL * TAIL], double g[TAIL])
{
    double then[2][3], now[2][3], B[4];
    fv_inertial_across(prior->own.down, then);
    fv_inertial_across(own->down, now);
    for (int r = 0; r < 2; r++)
        for (int c = 0; c < 2; c++)
            B[2 * r + c] = fv_dot3(then[r], now[c]);
    for (int r = 0; r < TAIL; r++)
        turn_two(B, &H[r * TAIL + DOWN], &H[r * TAIL + DOWN + 1]);
    for (int c = 0; c < TAIL; c++)
        turn_two(B, &H[DOWN * TAIL + c], &H[(DOWN + 1) * TAIL + c]);
    turn_two(B, &g[DOWN], &g[DOWN + 1]);
}

static void add_prior(struct pair *pair, const struct fv_inertial *inertial,
                      const struct fv_inertial_station *s)
{
    const struct fv_inertial_prior *prior = &inertial->state->prior;
    double x[TAIL], g[TAIL], H[TAIL * TAIL];
    away(prior, &s->now, &inertial->state->shared, x);
    for (int r = 0; r < TAIL; r++)
        for (int c = 0; c <= r; c++)
            H[r * TAIL + c] = H[c * TAIL + r] = prior->H[r * TAIL + c];
    for (int r = 0; r < TAIL; r++) {
        g[r] = prior->g[r];
        for (int c = 0; c < TAIL; c++)
            g[r] -= H[r * TAIL + c] * x[c];
    }
    turn_prior(prior, &s->now, H, g);
    add_tail(pair, H, g);
}

/* ---- the link between two stations ----------------------------------------------------------- */

struct ends {
    double Ri[9], Rj[9]; /* attitudes of the sensor */
    double way[3];       /* between the cameras, world's unit */
    double lever[3];     /* from camera to sensor, in the sensor's axes, metres */
};

static void attitude(const struct fv_inertial *inertial, const struct fv_inertial_station *s,
                     double R[9])
{
    double E[9], A[9];
    fv_so3_exp(s->now.turn, E);
    fv_multiply33(s->pose.T_world_cam.R, inertial->config.T_cam_imu.R, A);
    fv_multiply33(A, E, R);
}

static void find_ends(const struct fv_inertial *inertial, const struct fv_inertial_station *i,
                      const struct fv_inertial_station *j, struct ends *e)
{
    attitude(inertial, i, e->Ri);
    attitude(inertial, j, e->Rj);
    for (int k = 0; k < 3; k++)
        e->way[k] = j->pose.T_world_cam.t[k] + j->now.offset[k] - i->pose.T_world_cam.t[k] -
                    i->now.offset[k];
    fv_rotate_back3(inertial->config.T_cam_imu.R, inertial->config.T_cam_imu.t, e->lever);
}

static void put(double J[LINK * PAIR], int row, int column, const double M[9], double factor)
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            J[(row + r) * PAIR + column + c] = factor * M[3 * r + c];
}

/* Column `column` of three rows: factor R^T v. */
static void put_back(double J[LINK * PAIR], int row, int column, const double R[9],
                     const double v[3], double factor)
{
    double turned[3];
    fv_rotate_back3(R, v, turned);
    for (int r = 0; r < 3; r++)
        J[(row + r) * PAIR + column] = factor * turned[r];
}

static void link_errors(const struct fv_inertial *inertial, const struct fv_inertial_station *i,
                        const struct fv_inertial_station *j, const struct ends *e,
                        double error[LINK], double J[LINK * PAIR])
{
    const struct fv_preintegration *link = &i->link;
    const double t = link->time_s, s = i->now.scale, g = inertial->config.gravity;
    const double *down = i->now.down;
    struct fv_imu_biases biases;
    struct fv_preintegrated sum;
    double across[2][3], gained[3], moved[3], far[3], turn[9], left[9], M[9], back[9];
    memcpy(biases.gyro, inertial->state->shared.gyro_bias, sizeof biases.gyro);
    memcpy(biases.acceleration, i->now.acceleration_bias, sizeof biases.acceleration);
    fv_preintegration_correct(link, &biases, &sum);
    fv_inertial_across(down, across);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            back[3 * r + c] = e->Ri[3 * c + r];
    fv_multiply33(back, e->Rj, turn);
    fv_multiply_back33(sum.turn, turn, left);
    fv_so3_log(left, error);
    fv_rotate3(turn, e->lever, far);
    for (int k = 0; k < 3; k++) {
        gained[k] = j->now.velocity[k] - i->now.velocity[k] - g * t * down[k];
        moved[k] = s * e->way[k] - i->now.velocity[k] * t - g * t * t / 2 * down[k];
    }
    double gained_own[3], moved_own[3];
    fv_rotate_back3(e->Ri, gained, gained_own);
    fv_rotate_back3(e->Ri, moved, moved_own);
    for (int k = 0; k < 3; k++) {
        moved_own[k] += far[k];
        error[3 + k] = gained_own[k] - sum.velocity[k];
        error[6 + k] = moved_own[k] - e->lever[k] - sum.position[k];
    }
    memset(J, 0, LINK * PAIR * sizeof *J);
    for (int r = 0; r < 3; r++) { /* of the turn */
        for (int c = 0; c < 3; c++)
            J[r * PAIR + TURN + c] = -turn[3 * c + r];
        J[r * PAIR + NEXT + TURN + r] = 1;
    }
    put(J, 0, SHARED + GYRO, link->turn_gyro, -1);
    fv_cross_matrix(gained_own, M);
    put(J, 3, TURN, M, 1);
    put(J, 3, VELOCITY, back, -1);
    put(J, 3, NEXT + VELOCITY, back, 1);
    put(J, 3, SHARED + GYRO, link->velocity_gyro, -1);
    put(J, 3, BIAS, link->velocity_acceleration, -1);
    fv_cross_matrix(moved_own, M);
    put(J, 6, TURN, M, 1);
    put(J, 6, VELOCITY, back, -t);
    put(J, 6, OFFSET, back, -s);
    put(J, 6, NEXT + OFFSET, back, s);
    put(J, 6, SHARED + GYRO, link->position_gyro, -1);
    put(J, 6, BIAS, link->position_acceleration, -1);
    fv_cross_matrix(e->lever, left);
    fv_multiply33(turn, left, M);
    put(J, 6, NEXT + TURN, M, -1);
    put_back(J, 6, SCALE, e->Ri, e->way, 1);
    for (int k = 0; k < 2; k++) {
        put_back(J, 3, DOWN + k, e->Ri, across[k], -g * t);
        put_back(J, 6, DOWN + k, e->Ri, across[k], -g * t * t / 2);
    }
}

/* Bring errors and derivatives to independent ones: by L of covariance = L D L^T; `weight` becomes
 * 1 / D. */
static bool whiten(const struct fv_preintegration *link, double error[LINK], double J[LINK * PAIR],
                   double weight[LINK])
{
    double S[LINK * LINK];
    memcpy(S, link->covariance, sizeof S);
    for (int k = 0; k < 3; k++) {
        S[k * (LINK + 1)] += turn_floor;
        S[(3 + k) * (LINK + 1)] += velocity_floor;
        S[(6 + k) * (LINK + 1)] += position_floor;
    }
    if (!fv_ldlt_factor(S, LINK)) return false;
    for (int r = 0; r < LINK; r++) {
        for (int k = 0; k < r; k++) {
            const double l = S[r * LINK + k];
            error[r] -= l * error[k];
            for (int c = 0; c < PAIR; c++)
                J[r * PAIR + c] -= l * J[k * PAIR + c];
        }
        weight[r] = 1 / S[r * (LINK + 1)];
    }
    return true;
}

static bool add_link(struct pair *pair, const struct fv_inertial *inertial,
                     const struct fv_inertial_station *i, const struct fv_inertial_station *j)
{
    double error[LINK], J[LINK * PAIR], WJ[LINK * PAIR], weight[LINK];
    struct ends ends;
    const struct fv_normal normal = normal_of(pair);
    find_ends(inertial, i, j, &ends);
    link_errors(inertial, i, j, &ends, error, J);
    if (!whiten(&i->link, error, J, weight)) return false;
    for (int r = 0; r < LINK; r++) {
        pair->square += weight[r] * error[r] * error[r];
        fv_block_weigh(J + r * PAIR, PAIR, weight[r], WJ + r * PAIR);
    }
    fv_normal_add_one(&normal, 0, PAIR, J, WJ, error, LINK, NULL);
    return true;
}

/* a and b are equal but for a walk of this variance. */
static void add_walk(struct pair *pair, int a, double difference, double variance)
{
    const double w = 1 / variance;
    const int b = NEXT + a;
    pair->H[a * (PAIR + 1)] += w;
    pair->H[b * (PAIR + 1)] += w;
    pair->H[b * PAIR + a] -= w;
    pair->g[a] += w * difference;
    pair->g[b] -= w * difference;
    pair->square += w * difference * difference;
}

/* Likewise gravity's directions, each in the axes of its own station. */
static void add_tilt_walk(struct pair *pair, const struct fv_inertial_own *i,
                          const struct fv_inertial_own *j, double variance)
{
    const struct fv_normal normal = normal_of(pair);
    double at_i[2][3], at_j[2][3], walked[3], error[2], J[2 * PAIR], WJ[2 * PAIR];
    fv_inertial_across(i->down, at_i);
    fv_inertial_across(j->down, at_j);
    fv_subtract3(j->down, i->down, walked);
    memset(J, 0, sizeof J);
    for (int r = 0; r < 2; r++) {
        error[r] = fv_dot3(at_i[r], walked);
        J[r * PAIR + DOWN + r] = -1;
        for (int c = 0; c < 2; c++)
            J[r * PAIR + NEXT + DOWN + c] = fv_dot3(at_i[r], at_j[c]);
        pair->square += error[r] * error[r] / variance;
        fv_block_weigh(J + r * PAIR, PAIR, 1 / variance, WJ + r * PAIR);
    }
    fv_normal_add_one(&normal, 0, PAIR, J, WJ, error, 2, NULL);
}

static void add_walks(struct pair *pair, const struct fv_inertial *inertial,
                      const struct fv_inertial_station *i, const struct fv_inertial_station *j)
{
    const double t = i->link.time_s, s = i->now.scale;
    add_walk(pair, SCALE, j->now.scale - i->now.scale, inertial->state->scale_drift * s * s * t);
    for (int k = 0; k < 3; k++)
        add_walk(pair, BIAS + k, j->now.acceleration_bias[k] - i->now.acceleration_bias[k],
                 (inertial->config.acceleration_walk + walk_floor) * t);
    add_tilt_walk(pair, &i->now, &j->now, (inertial->state->tilt_drift + tilt_floor) * t);
}

/* ---- elimination ----------------------------------------------------------------------------- */

/* Errors of a station alone, with all that was eliminated before it. */
static void begin_pair(struct pair *pair, struct fv_inertial *inertial, uint32_t i)
{
    struct fv_inertial_state *state = inertial->state;
    const struct fv_inertial_station *station = fv_inertial_station_at(inertial, i);
    memset(pair, 0, sizeof *pair);
    if (i > 0)
        add_tail(pair, state->tail, state->tail_gradient);
    else if (state->prior.known)
        add_prior(pair, inertial, station);
    else
        add_beginning(pair, inertial, station);
    if (i == 0) {
        state->square = 0;
        state->errors = 0;
    }
    add_pose(pair, state, station);
}

/* tail = what is left of the pair's other variables without the older station. */
static void reduce(struct fv_inertial_state *state, const struct fv_inertial_station *station,
                   const struct pair *pair, const double solved[OWN * TAIL])
{
    for (int r = 0; r < TAIL; r++) {
        double g = pair->g[OWN + r];
        for (int k = 0; k < OWN; k++)
            g -= solved[k * TAIL + r] * station->gradient[k];
        state->tail_gradient[r] = g;
        for (int c = 0; c <= r; c++) {
            double sum = pair->H[(OWN + r) * PAIR + OWN + c];
            for (int k = 0; k < OWN; k++)
                sum -= station->coupling[k * TAIL + r] * solved[k * TAIL + c];
            state->tail[r * TAIL + c] = sum;
        }
    }
}

/* What the tail says once station `i`, one of the oldest, is eliminated. A scale that is hardly
 * known is not handed on: where none can be seen the estimate goes to 0, which holds of nothing
 * that comes later. */
static void hand_on(struct fv_inertial *inertial, uint32_t i)
{
    struct fv_inertial_state *state = inertial->state;
    struct fv_inertial_prior *prior = &state->hand_on[i];
    const bool sure = state->estimate.known && state->estimate.scale_sigma < handed_sigma_max;
    if (i == 0) state->handed = sure ? FV_INERTIAL_ROOM : 0;
    if (state->handed == 0) return;
    prior->known = true;
    memcpy(prior->H, state->tail, sizeof state->tail);
    memcpy(prior->g, state->tail_gradient, sizeof state->tail_gradient);
    prior->own = fv_inertial_station_at(inertial, i + 1)->now;
    prior->shared = state->shared;
}

bool fv_inertial_eliminate(struct fv_inertial *inertial, uint32_t i)
{
    struct fv_inertial_state *state = inertial->state;
    struct fv_inertial_station *station = fv_inertial_station_at(inertial, i);
    const struct fv_inertial_station *next = fv_inertial_station_at(inertial, i + 1);
    struct pair pair;
    double solved[OWN * TAIL], column[OWN];
    begin_pair(&pair, inertial, i);
    if (!add_link(&pair, inertial, station, next)) return false;
    add_walks(&pair, inertial, station, next);
    for (int r = 0; r < OWN; r++) {
        station->gradient[r] = pair.g[r];
        for (int c = 0; c < OWN; c++)
            station->block[r * OWN + c] = pair.H[r * PAIR + c];
        for (int c = 0; c < TAIL; c++)
            station->coupling[r * TAIL + c] = pair.H[(OWN + c) * PAIR + r];
    }
    if (!fv_ldlt_factor(station->block, OWN)) return false;
    for (int c = 0; c < TAIL; c++) {
        for (int r = 0; r < OWN; r++)
            column[r] = station->coupling[r * TAIL + c];
        fv_ldlt_back(station->block, OWN, column);
        for (int r = 0; r < OWN; r++)
            solved[r * TAIL + c] = column[r];
    }
    reduce(state, station, &pair, solved);
    memcpy(column, station->gradient, sizeof column);
    fv_ldlt_back(station->block, OWN, column);
    state->square += pair.square;
    for (int r = 0; r < OWN; r++) /* what its step saves */
        state->square -= station->gradient[r] * column[r];
    state->errors += LINK + 6 + 6 - OWN;
    if (i < FV_INERTIAL_ROOM) hand_on(inertial, i);
    return true;
}

bool fv_inertial_solve_tail(struct fv_inertial *inertial)
{
    struct fv_inertial_state *state = inertial->state;
    struct fv_inertial_estimate *e = &state->estimate;
    struct pair pair;
    double H[TAIL * TAIL], column[TAIL];
    begin_pair(&pair, inertial, state->taking_part - 1);
    for (int r = 0; r < TAIL; r++) {
        state->solution[r] = pair.g[column_of(r)];
        for (int c = 0; c <= r; c++)
            H[r * TAIL + c] = pair.H[column_of(r) * PAIR + column_of(c)];
    }
    if (!fv_ldlt_factor(H, TAIL)) return false;
    fv_ldlt_back(H, TAIL, state->solution);
    state->square += pair.square;
    for (int r = 0; r < TAIL; r++)
        state->square -= pair.g[column_of(r)] * state->solution[r];
    e->misfit = state->errors > OWN ? state->square / (state->errors - OWN) : 1;
    for (int c = 0; c < TAIL; c++) {
        memset(column, 0, sizeof column);
        column[c] = e->misfit > 1 ? e->misfit : 1;
        fv_ldlt_back(H, TAIL, column);
        for (int r = 0; r < TAIL; r++)
            e->covariance[r * TAIL + c] = column[r];
    }
    return state->solution[SCALE] == state->solution[SCALE]; /* not NaN */
}

void fv_inertial_step_back(struct fv_inertial *inertial, uint32_t i)
{
    struct fv_inertial_state *state = inertial->state;
    const struct fv_inertial_station *station = fv_inertial_station_at(inertial, i);
    double x[OWN];
    for (int r = 0; r < OWN; r++) {
        x[r] = station->gradient[r];
        for (int c = 0; c < TAIL; c++)
            x[r] -= station->coupling[r * TAIL + c] * state->solution[c];
    }
    fv_ldlt_back(station->block, OWN, x);
    memcpy(state->solution, x, sizeof x);
}
