#include "inertial/clock.h"

#include <string.h>

#include "geometry/linear.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "inertial/stamp.h"

enum { SIZE = FV_IMU_CLOCK_SIZE, TURN = 0, BIAS = 3, OFFSET = 6, MOUNT = 7, REFUSED_MAX = 5 };

static const int64_t gap_max_ns = 60000000;
static const double offset_sigma_begin_s = 0.03, offset_max_s = 0.1;
static const double bias_sigma_begin = 0.1, attitude_sigma_begin = 1;
/* The camera's turns: floor of their sigma, and how its world turns, rad by root s. Found on odd
 * seeds of sim:orbit, wander and corridor, and on euroc_mh05_a. */
static const double turn_sigma_least = 2e-4, world_drift = 7e-4;
static const double bias_walk_least =
    1e-4; /* rad/s by root s: of the gyro, or of what stands for it */
static const double offset_drift = 1e-5; /* s by root s: clocks that run apart */
static const double doubt_factor = 3;    /* of the sigma, where frames do not fit */
/* Errors of gyro and camera that grow with the turn, rad after 1 rad: scale, misalignment. */
static const double turn_error = 0.003;
static const double innovation_max = 16.3; /* chi square of 3 at 0.1 % */

static double *at(struct fv_imu_clock *clock, int row, int column)
{
    return &clock->P[row * SIZE + column];
}

static void forget(struct fv_imu_clock *clock, int first, int count, double sigma)
{
    for (int i = first; i < first + count; i++) {
        for (int k = 0; k < SIZE; k++)
            *at(clock, i, k) = *at(clock, k, i) = 0;
        *at(clock, i, i) = sigma * sigma;
    }
}

static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

static void begin_sum(struct fv_imu_clock *clock)
{
    clock->time_s = 0;
    memcpy(clock->turn, identity, sizeof identity);
    memset(clock->turn_bias, 0, sizeof clock->turn_bias);
}

void fv_imu_clock_init(struct fv_imu_clock *clock, double mount_sigma)
{
    memset(clock, 0, sizeof *clock);
    clock->mount_sigma = mount_sigma;
    memcpy(clock->mount, identity, sizeof identity);
    forget(clock, MOUNT, 3, mount_sigma);
    forget(clock, BIAS, 3, bias_sigma_begin);
    forget(clock, OFFSET, 1, offset_sigma_begin_s);
    fv_imu_clock_restart(clock);
}

void fv_imu_clock_restart(struct fv_imu_clock *clock)
{
    clock->begun = clock->refused = 0;
    clock->frame_count = 0;
    forget(clock, TURN, 3, attitude_sigma_begin);
}

void fv_imu_clock_jump(struct fv_imu_clock *clock)
{
    fv_imu_clock_restart(clock);
    clock->sample_count = 0;
    clock->offset_s = 0;
    forget(clock, OFFSET, 1, offset_sigma_begin_s);
}

double fv_imu_clock_sigma(const struct fv_imu_clock *clock)
{
    return __builtin_sqrt(clock->P[OFFSET * (SIZE + 1)]);
}

void fv_imu_clock_mount(const struct fv_imu_clock *clock, struct fv_imu_clock_mount *mount)
{
    double variance = 0, diagonal = 0;
    fv_so3_log(clock->mount, mount->error);
    mount->angle = __builtin_sqrt(fv_dot3(mount->error, mount->error));
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            variance +=
                mount->error[i] * clock->P[(MOUNT + i) * SIZE + MOUNT + k] * mount->error[k];
        const double own = clock->P[(MOUNT + i) * (SIZE + 1)];
        mount->sigma[i] = __builtin_sqrt(own);
        diagonal = own > diagonal ? own : diagonal;
    }
    mount->angle_sigma =
        __builtin_sqrt(mount->angle > 0 ? variance / (mount->angle * mount->angle) : diagonal);
}

/* ---- samples --------------------------------------------------------------------------------- */

static struct fv_imu_clock_sample *sample_at(struct fv_imu_clock *clock, uint64_t i)
{
    return &clock->samples[(clock->first_sample + i) % FV_IMU_CLOCK_SAMPLES_MAX];
}

static void drop_sample(struct fv_imu_clock *clock)
{
    clock->first_sample = (clock->first_sample + 1) % FV_IMU_CLOCK_SAMPLES_MAX;
    clock->sample_count--;
}

/* A turn at this rate for t: errors go as error' = E^T error - t bias. */
static void add_turn(struct fv_imu_clock *clock, const double rate[3], double t)
{
    double w[3], E[9], turn[9], turn_bias[9];
    for (int i = 0; i < 3; i++)
        w[i] = (rate[i] - clock->bias[i]) * t;
    fv_so3_exp(w, E);
    fv_multiply33(clock->turn, E, turn);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            double sum = r == c ? -t : 0;
            for (int k = 0; k < 3; k++)
                sum += E[3 * k + r] * clock->turn_bias[3 * k + c];
            turn_bias[3 * r + c] = sum;
        }
    memcpy(clock->turn, turn, sizeof turn);
    memcpy(clock->turn_bias, turn_bias, sizeof turn_bias);
    clock->time_s += t;
}

/* Sum the oldest interval between two samples as far as `to_ns`; false: samples lack in it. */
static bool add_interval(struct fv_imu_clock *clock, int64_t to_ns)
{
    const struct fv_imu_clock_sample *a = sample_at(clock, 0), *b = sample_at(clock, 1);
    const int64_t from_ns = clock->reached_ns > a->stamp_ns ? clock->reached_ns : a->stamp_ns,
                  end_ns = to_ns < b->stamp_ns ? to_ns : b->stamp_ns,
                  long_ns = fv_stamp_since(b->stamp_ns, a->stamp_ns);
    if (end_ns <= from_ns) return true;
    if (long_ns > gap_max_ns) return false;
    const double middle =
        (double)((from_ns - a->stamp_ns) + (end_ns - a->stamp_ns)) / 2 / (double)long_ns;
    for (int i = 0; i < 3; i++)
        clock->rate[i] = a->gyro[i] + middle * (b->gyro[i] - a->gyro[i]);
    add_turn(clock, clock->rate, (double)(end_ns - from_ns) * 1e-9);
    clock->reached_ns = end_ns;
    return true;
}

/* Sum samples up to an instant that they reach. False: some lack. */
static bool advance(struct fv_imu_clock *clock, int64_t to_ns)
{
    while (clock->sample_count > 1) {
        if (!add_interval(clock, to_ns)) return false;
        if (sample_at(clock, 1)->stamp_ns > to_ns) break;
        drop_sample(clock);
    }
    return true;
}

void fv_imu_clock_take(struct fv_imu_clock *clock, const struct fv_imu_reading *reading)
{
    if (clock->sample_count > 0 &&
        reading->stamp_ns <= sample_at(clock, clock->sample_count - 1)->stamp_ns)
        return;
    if (clock->sample_count == FV_IMU_CLOCK_SAMPLES_MAX) {
        if (clock->begun && !add_interval(clock, sample_at(clock, 1)->stamp_ns))
            fv_imu_clock_restart(clock);
        drop_sample(clock);
    }
    struct fv_imu_clock_sample *kept = sample_at(clock, clock->sample_count++);
    kept->stamp_ns = reading->stamp_ns;
    fv_copy3(reading->gyro, kept->gyro);
}

/* ---- filter ---------------------------------------------------------------------------------- */

/* P = A P A^T + Q over what has been summed. */
static void propagate(struct fv_imu_clock *clock, const struct fv_imu_clock_noise *noise)
{
    double A[SIZE * SIZE], AP[SIZE * SIZE], attitude[9];
    memset(A, 0, sizeof A);
    for (int i = 0; i < SIZE; i++)
        A[i * (SIZE + 1)] = 1;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            A[(TURN + r) * SIZE + TURN + c] = clock->turn[3 * c + r];
            A[(TURN + r) * SIZE + BIAS + c] = clock->turn_bias[3 * r + c];
        }
    for (int r = 0; r < SIZE; r++)
        for (int c = 0; c < SIZE; c++) {
            AP[r * SIZE + c] = 0;
            for (int k = 0; k < SIZE; k++)
                AP[r * SIZE + c] += A[r * SIZE + k] * clock->P[k * SIZE + c];
        }
    for (int r = 0; r < SIZE; r++)
        for (int c = 0; c < SIZE; c++) {
            double sum = 0;
            for (int k = 0; k < SIZE; k++)
                sum += AP[r * SIZE + k] * A[c * SIZE + k];
            clock->P[r * SIZE + c] = sum;
        }
    const double t = clock->time_s, least = bias_walk_least * bias_walk_least,
                 walk = noise->gyro_walk > least ? noise->gyro_walk : least;
    for (int i = 0; i < 3; i++) {
        *at(clock, TURN + i, TURN + i) += t * (noise->gyro + world_drift * world_drift);
        *at(clock, BIAS + i, BIAS + i) += t * walk;
    }
    if (clock->mount_sigma > 0) {
        double rate[3];
        fv_subtract3(clock->rate, clock->bias, rate);
        const double turned = t * __builtin_sqrt(fv_dot3(rate, rate));
        for (int i = 0; i < 3; i++)
            *at(clock, TURN + i, TURN + i) += turned * turn_error * turn_error;
    }
    *at(clock, OFFSET, OFFSET) += t * offset_drift * offset_drift;
    fv_multiply33(clock->attitude, clock->turn, attitude);
    memcpy(clock->attitude, attitude, sizeof attitude);
    fv_so3_orthonormalise(clock->attitude);
    begin_sum(clock);
}

static void turn_by(double R[9], const double step[3])
{
    double E[9], turned[9];
    fv_so3_exp(step, E);
    fv_multiply33(R, E, turned);
    memcpy(R, turned, sizeof turned);
}

static void move(struct fv_imu_clock *clock, const double step[SIZE])
{
    turn_by(clock->attitude, step + TURN);
    if (clock->mount_sigma > 0) {
        turn_by(clock->mount, step + MOUNT);
        fv_so3_orthonormalise(clock->mount);
    }
    for (int i = 0; i < 3; i++)
        clock->bias[i] += step[BIAS + i];
    clock->offset_s += step[OFFSET];
}

/* K = P H^T S^-1, with H^T handed over as PH = P H^T; x += K r; P -= K (P H^T)^T. */
static void correct(struct fv_imu_clock *clock, const double PH[SIZE * 3], const double inverse[9],
                    const double r[3])
{
    double K[SIZE * 3], step[SIZE], P[SIZE * SIZE];
    for (int i = 0; i < SIZE; i++) {
        for (int c = 0; c < 3; c++)
            K[3 * i + c] = PH[3 * i] * inverse[c] + PH[3 * i + 1] * inverse[3 + c] +
                           PH[3 * i + 2] * inverse[6 + c];
        step[i] = fv_dot3(K + 3 * i, r);
    }
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k < SIZE; k++)
            P[i * SIZE + k] = clock->P[i * SIZE + k] - fv_dot3(K + 3 * i, PH + 3 * k);
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k < SIZE; k++)
            clock->P[i * SIZE + k] = (P[i * SIZE + k] + P[k * SIZE + i]) / 2;
    move(clock, step);
}

/* R_world_imu of a frame by the mount so far. */
static void attitude_of(const struct fv_imu_clock *clock, const struct fv_imu_clock_frame *frame,
                        double R[9])
{
    memcpy(R, frame->R, sizeof frame->R);
    if (clock->mount_sigma > 0) fv_multiply33(frame->R, clock->mount, R);
}

/* The frame shows error - rate times the offset's error - the mount's error. False: it does not
 * fit. */
static bool measure(struct fv_imu_clock *clock, const struct fv_imu_clock_frame *frame)
{
    double rate[3], seen[9], PH[SIZE * 3], S[9], I[6], difference[9], r[3], weighted[3];
    attitude_of(clock, frame, seen);
    fv_subtract3(clock->rate, clock->bias, rate);
    for (int i = 0; i < SIZE; i++)
        for (int c = 0; c < 3; c++)
            PH[3 * i + c] = *at(clock, i, TURN + c) - *at(clock, i, OFFSET) * rate[c] -
                            *at(clock, i, MOUNT + c);
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++)
            S[3 * i + c] = PH[3 * (TURN + i) + c] - rate[i] * PH[3 * OFFSET + c] -
                           PH[3 * (MOUNT + i) + c] + frame->covariance[3 * i + c] +
                           (i == c ? turn_sigma_least * turn_sigma_least : 0);
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++)
            difference[3 * i + c] = clock->attitude[i] * seen[c] +
                                    clock->attitude[3 + i] * seen[3 + c] +
                                    clock->attitude[6 + i] * seen[6 + c];
    fv_so3_log(difference, r);
    const double packed[6] = {S[0], S[1], S[2], S[4], S[5], S[8]};
    if (!fv_invert_symmetric3(packed, I)) return false;
    const double inverse[9] = {I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5]};
    fv_rotate3(inverse, r, weighted);
    if (!(fv_dot3(r, weighted) < innovation_max)) return false;
    correct(clock, PH, inverse, r);
    return true;
}

static struct fv_imu_clock_frame *frame_at(struct fv_imu_clock *clock, uint64_t i)
{
    return &clock->waiting[(clock->first_frame + i) % FV_IMU_CLOCK_FRAMES_MAX];
}

static void drop_frame(struct fv_imu_clock *clock)
{
    clock->first_frame = (clock->first_frame + 1) % FV_IMU_CLOCK_FRAMES_MAX;
    clock->frame_count--;
}

/* Attitudes begin with this frame, if samples reach back to it. */
static void begin(struct fv_imu_clock *clock, const struct fv_imu_clock_frame *frame, int64_t at_ns)
{
    while (clock->sample_count > 1 && sample_at(clock, 1)->stamp_ns <= at_ns)
        drop_sample(clock);
    if (clock->sample_count < 1 || sample_at(clock, 0)->stamp_ns > at_ns) return;
    attitude_of(clock, frame, clock->attitude);
    fv_copy3(sample_at(clock, 0)->gyro, clock->rate);
    begin_sum(clock);
    clock->reached_ns = at_ns;
    clock->begun = 1;
    (void)measure(clock, frame);
}

static void doubt_mount(struct fv_imu_clock *clock)
{
    const double most = clock->mount_sigma * clock->mount_sigma;
    double P[3];
    for (int i = 0; i < 3; i++) {
        P[i] = *at(clock, MOUNT + i, MOUNT + i) * doubt_factor * doubt_factor;
        P[i] = P[i] < most ? P[i] : most;
    }
    forget(clock, MOUNT, 3, 0);
    for (int i = 0; i < 3; i++)
        *at(clock, MOUNT + i, MOUNT + i) = P[i];
}

/* What led to frames that do not fit may be wrong too. */
static void doubt(struct fv_imu_clock *clock)
{
    const double P = *at(clock, OFFSET, OFFSET) * doubt_factor * doubt_factor,
                 most = offset_sigma_begin_s * offset_sigma_begin_s;
    forget(clock, OFFSET, 1, __builtin_sqrt(P < most ? P : most));
    forget(clock, BIAS, 3, bias_sigma_begin);
    if (clock->mount_sigma > 0) doubt_mount(clock);
}

static void use(struct fv_imu_clock *clock, const struct fv_imu_clock_noise *noise,
                const struct fv_imu_clock_frame *frame, int64_t at_ns)
{
    if (!clock->begun) {
        begin(clock, frame, at_ns);
        return;
    }
    if (at_ns <= clock->reached_ns) return;
    if (!advance(clock, at_ns)) {
        fv_imu_clock_restart(clock);
        return;
    }
    propagate(clock, noise);
    if (measure(clock, frame)) {
        clock->refused = 0;
        clock->frames++;
    } else if (++clock->refused >= REFUSED_MAX) {
        doubt(clock);
        fv_imu_clock_restart(clock);
    }
    if (fv_abs(clock->offset_s) > offset_max_s) fv_imu_clock_jump(clock);
}

void fv_imu_clock_frame(struct fv_imu_clock *clock, const struct fv_imu_clock_noise *noise,
                        const struct fv_imu_clock_frame *frame)
{
    if (clock->frame_count == FV_IMU_CLOCK_FRAMES_MAX) drop_frame(clock);
    *frame_at(clock, clock->frame_count++) = *frame;
    while (clock->frame_count > 0 && clock->sample_count > 0) {
        const struct fv_imu_clock_frame next = *frame_at(clock, 0);
        const int64_t at_ns = fv_stamp_since(next.stamp_ns, (int64_t)(clock->offset_s * 1e9));
        if (sample_at(clock, clock->sample_count - 1)->stamp_ns < at_ns) break;
        drop_frame(clock);
        use(clock, noise, &next, at_ns);
    }
}
