/* Stations and samples as they come, and the units of an estimate. */
#include "inertial/estimator.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/vec.h"
#include "inertial/stamp.h"

enum {
    STATIONS_MIN = 4,
    STATIONS_TO_CORRECT = 10,
    STATIONS_FOR_ONE_WRONG = 4,
    ITERATIONS_MAX = 10,
    INTEGRATED_PER_UNIT = 48,
    ELIMINATED_PER_UNIT = 4,
    STEPPED_PER_UNIT = 16,
    SHAKE_SAMPLES = 400,
    SCALE = FV_INERTIAL_SCALE,
    DOWN = FV_INERTIAL_DOWN,
    GYRO = FV_INERTIAL_GYRO_BIAS
};

static const int64_t gap_max_ns = 60000000; /* between samples */
/* Of biases, from those that a link was summed with: beyond, its samples are summed again. */
static const double far_gyro = 5e-3, far_acceleration = 0.3;
/* Of a step that is worth another one. */
static const double far_scale = 5e-3, far_down = 3e-4, far_bias = 2e-4;
static const double shake_left = 0.25; /* of the noise of a sample */
static const double scale_least = 1e-3;
static const double wrong_sigmas = 6; /* length of three errors */
/* Of biases before anything is known, rad/s and m/s^2. */
static const double bias_sigma_begin[2] = {FV_INERTIAL_GYRO_BIAS_SIGMA, 0.3};

void fv_inertial_carve(struct fv_inertial *inertial, const struct fv_inertial_config *config,
                       struct fv_arena *persistent)
{
    inertial->config = *config;
    inertial->state = fv_arena_take(persistent, 1, sizeof *inertial->state);
    inertial->stations =
        fv_arena_take(persistent, FV_INERTIAL_STATIONS_MAX, sizeof *inertial->stations);
    inertial->samples =
        fv_arena_take(persistent, (size_t)FV_INERTIAL_STATIONS_MAX * FV_INERTIAL_SAMPLES_MAX,
                      sizeof *inertial->samples);
}

void fv_inertial_init(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    memset(s, 0, sizeof *s);
    s->down[2] = -1;
    s->noise = inertial->config.noise;
    memcpy(s->bias_sigma, bias_sigma_begin, sizeof s->bias_sigma);
}

/* What is known of the biases outlives the stations. */
static void keep_biases(struct fv_inertial_state *s)
{
    const struct fv_inertial_estimate *e = &s->estimate;
    if (!e->known) return;
    double gyro = 0, acceleration = 0;
    for (int i = 0; i < 3; i++) {
        const int a = FV_INERTIAL_ACCELERATION_BIAS + i, g = GYRO + i;
        gyro += e->covariance[g * (FV_INERTIAL_TAIL + 1)] / 3;
        acceleration += e->covariance[a * (FV_INERTIAL_TAIL + 1)] / 3;
    }
    memcpy(s->acceleration_bias, e->own.acceleration_bias, sizeof s->acceleration_bias);
    memcpy(s->shared.gyro_bias, e->shared.gyro_bias, sizeof s->shared.gyro_bias);
    memcpy(s->gyro_bias, e->shared.gyro_bias, sizeof s->gyro_bias);
    s->bias_sigma[0] = 2 * __builtin_sqrt(gyro) + 1e-4;
    s->bias_sigma[1] = 2 * __builtin_sqrt(acceleration) + 1e-2;
}

void fv_inertial_restart(struct fv_inertial *inertial, double metric_sigma, double scale_drift,
                         double tilt_drift)
{
    struct fv_inertial_state *s = inertial->state;
    s->metric_sigma = metric_sigma;
    s->scale_drift = scale_drift;
    s->tilt_drift = tilt_drift;
    keep_biases(s);
    s->first = s->count = 0;
    s->phase = FV_INERTIAL_IDLE;
    s->gone_log_scale = 0;
    memset(s->gone_down, 0, sizeof s->gone_down);
    s->gone = 0;
    s->waiting = s->handed = 0;
    s->prior.known = s->estimate.known = false;
}

/* ---- stations and samples -------------------------------------------------------------------- */

uint32_t fv_inertial_station_count(const struct fv_inertial *inertial)
{
    return inertial->state->count;
}

static uint32_t slot_of(const struct fv_inertial *inertial, uint32_t i)
{
    return (inertial->state->first + i) % FV_INERTIAL_STATIONS_MAX;
}

struct fv_inertial_station *fv_inertial_station_at(const struct fv_inertial *inertial, uint32_t i)
{
    return inertial->stations + slot_of(inertial, i);
}

static struct fv_inertial_sample *samples_of(const struct fv_inertial *inertial, uint32_t i)
{
    return inertial->samples + (size_t)slot_of(inertial, i) * FV_INERTIAL_SAMPLES_MAX;
}

static void cut(struct fv_inertial *inertial, struct fv_inertial_station *station)
{
    inertial->state->cuts += !station->cut;
    station->cut = true;
}

static void append(struct fv_inertial *inertial, uint32_t i, int64_t stamp_ns,
                   const struct fv_inertial_sample *sample)
{
    struct fv_inertial_station *station = fv_inertial_station_at(inertial, i);
    struct fv_inertial_sample *list = samples_of(inertial, i);
    const int64_t after_ns = fv_stamp_since(stamp_ns, station->stamp_ns);
    if (station->cut) return;
    if (after_ns <= 0) station->sample_count = 0; /* only the last before the station counts */
    if (after_ns < -gap_max_ns) return;
    const int64_t since =
        station->sample_count > 0 ? after_ns - list[station->sample_count - 1].after_ns : after_ns;
    if (station->sample_count >= FV_INERTIAL_SAMPLES_MAX) {
        inertial->state->overflows++;
        cut(inertial, station);
    } else if (since > gap_max_ns || after_ns > INT32_MAX) {
        cut(inertial, station);
    } else {
        struct fv_inertial_sample *kept = &list[station->sample_count++];
        *kept = *sample;
        kept->after_ns = (int32_t)after_ns;
    }
}

static double mean_of(const double a[2][3], const double now[3])
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const double d = a[0][i] - 2 * a[1][i] + now[i];
        sum += d * d / 18;
    }
    return sum;
}

/* The noise that is believed: the stated one, or what a sensor that is shaken shows. Shaking is not
 * white, and of what it adds to a sample a part is left over many. */
static void measure_shake(struct fv_inertial *inertial, int64_t stamp_ns, const double gyro[3],
                          const double acceleration[3])
{
    struct fv_imu_shake *k = &inertial->state->shake;
    struct fv_imu_noise *noise = &inertial->state->noise;
    const struct fv_imu_noise *least = &inertial->config.noise;
    if (k->count > 0 &&
        (fv_stamp_since(stamp_ns, k->stamps_ns[1]) > gap_max_ns || stamp_ns <= k->stamps_ns[1]))
        k->count = 0;
    if (k->count >= 2) {
        const double step_s = (double)(stamp_ns - k->stamps_ns[0]) * 0.5e-9,
                     part = 1 / (double)(k->count - 1);
        k->square[0] += part * (mean_of(k->gyro, gyro) - k->square[0]);
        k->square[1] += part * (mean_of(k->acceleration, acceleration) - k->square[1]);
        const double left = shake_left * shake_left * step_s;
        noise->gyro = left * k->square[0] > least->gyro ? left * k->square[0] : least->gyro;
        noise->acceleration =
            left * k->square[1] > least->acceleration ? left * k->square[1] : least->acceleration;
    }
    memcpy(k->gyro[0], k->gyro[1], sizeof k->gyro[0]);
    memcpy(k->acceleration[0], k->acceleration[1], sizeof k->acceleration[0]);
    fv_copy3(gyro, k->gyro[1]);
    fv_copy3(acceleration, k->acceleration[1]);
    k->stamps_ns[0] = k->stamps_ns[1];
    k->stamps_ns[1] = stamp_ns;
    if (k->count < SHAKE_SAMPLES) k->count++;
}

void fv_inertial_take(struct fv_inertial *inertial, int64_t stamp_ns, const double gyro[3],
                      const double acceleration[3])
{
    struct fv_inertial_state *s = inertial->state;
    struct fv_inertial_sample sample = {.after_ns = 0};
    if (s->any_sample && stamp_ns <= s->last_sample_ns) return;
    measure_shake(inertial, stamp_ns, gyro, acceleration);
    for (int i = 0; i < 3; i++) {
        sample.gyro[i] = (float)gyro[i];
        sample.acceleration[i] = (float)acceleration[i];
    }
    s->last_sample = sample;
    s->last_sample_ns = stamp_ns;
    s->any_sample = true;
    if (s->count > 1) {
        struct fv_inertial_station *before = fv_inertial_station_at(inertial, s->count - 2);
        const int64_t next_ns = fv_inertial_station_at(inertial, s->count - 1)->stamp_ns;
        if (!before->closed) {
            append(inertial, s->count - 2, stamp_ns, &sample);
            before->closed = stamp_ns >= next_ns;
        }
    }
    if (s->count > 0) append(inertial, s->count - 1, stamp_ns, &sample);
}

void fv_inertial_jump(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    s->any_sample = false;
    for (uint32_t i = s->count > 2 ? s->count - 2 : 0; i < s->count; i++)
        if (!fv_inertial_station_at(inertial, i)->closed)
            cut(inertial, fv_inertial_station_at(inertial, i));
}

static void drop_oldest(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    const struct fv_inertial_own *own = &fv_inertial_station_at(inertial, 0)->now;
    if (s->estimate.known && own->scale > 0) {
        s->gone_log_scale += fv_log(own->scale);
        for (int i = 0; i < 3; i++)
            s->gone_down[i] += own->down[i];
        s->gone++;
    }
    s->first = (s->first + 1) % FV_INERTIAL_STATIONS_MAX;
    s->count--;
    if (s->phase != FV_INERTIAL_IDLE) s->waiting = FV_INERTIAL_STATIONS_PER_ESTIMATE; /* again */
    if (s->phase == FV_INERTIAL_ELIMINATE && s->next > 0 && s->next < FV_INERTIAL_ROOM)
        s->handed = 0; /* of two passes */
    s->phase = FV_INERTIAL_IDLE;
    s->prior.known = false;
    if (s->handed > 0) s->prior = s->hand_on[FV_INERTIAL_ROOM - s->handed--];
}

/* The newest station's samples so far: those that the one before has of its time, and the last
 * before it. */
static void hand_samples(struct fv_inertial *inertial)
{
    const uint32_t newest = inertial->state->count - 1;
    const struct fv_inertial_station *before = fv_inertial_station_at(inertial, newest - 1);
    const struct fv_inertial_sample *list = samples_of(inertial, newest - 1);
    if (before->cut && inertial->state->any_sample)
        append(inertial, newest, inertial->state->last_sample_ns, &inertial->state->last_sample);
    for (uint32_t i = 0; !before->cut && i < before->sample_count; i++)
        append(inertial, newest, before->stamp_ns + list[i].after_ns, &list[i]);
}

void fv_inertial_add_station(struct fv_inertial *inertial, int64_t stamp_ns,
                             const struct fv_inertial_owner *of,
                             const struct fv_inertial_pose *pose)
{
    struct fv_inertial_state *s = inertial->state;
    if (s->count == FV_INERTIAL_STATIONS_MAX) drop_oldest(inertial);
    if (s->count > 1 && !fv_inertial_station_at(inertial, s->count - 2)->closed)
        cut(inertial, fv_inertial_station_at(inertial, s->count - 2));
    struct fv_inertial_station *station = fv_inertial_station_at(inertial, s->count++);
    memset(station, 0, sizeof *station);
    station->stamp_ns = stamp_ns;
    station->of = *of;
    station->pose = *pose;
    s->waiting++;
    if (s->count < 2) {
        if (s->any_sample) append(inertial, s->count - 1, s->last_sample_ns, &s->last_sample);
        return;
    }
    hand_samples(inertial);
    /* Where the sensor's last sample is at the very instant, nothing is missing. */
    fv_inertial_station_at(inertial, s->count - 2)->closed =
        s->any_sample && s->last_sample_ns >= stamp_ns;
}

/* ---- links ----------------------------------------------------------------------------------- */

static void between(const struct fv_inertial_sample *a, const struct fv_inertial_sample *b,
                    double at, double gyro[3], double acceleration[3])
{
    for (int i = 0; i < 3; i++) {
        gyro[i] = (double)a->gyro[i] + at * ((double)b->gyro[i] - (double)a->gyro[i]);
        acceleration[i] = (double)a->acceleration[i] +
                          at * ((double)b->acceleration[i] - (double)a->acceleration[i]);
    }
}

/* Add what lies of the interval between two samples in [0, end_ns]. */
static void integrate(const struct fv_inertial *inertial, struct fv_inertial_station *station,
                      const struct fv_inertial_sample *a, const struct fv_inertial_sample *b,
                      int64_t end_ns)
{
    const int64_t from = a->after_ns > 0 ? a->after_ns : 0,
                  to = b->after_ns < end_ns ? b->after_ns : end_ns;
    double gyro[3], acceleration[3];
    if (to <= from) return;
    const double middle = ((double)(from - a->after_ns) + (double)(to - a->after_ns)) / 2 /
                          (double)(b->after_ns - a->after_ns);
    between(a, b, middle, gyro, acceleration);
    fv_preintegration_step(&station->link, &inertial->state->noise, gyro, acceleration,
                           (double)(to - from) * 1e-9);
}

static bool far_apart(const double a[3], const double b[3], double limit)
{
    double d[3];
    fv_subtract3(a, b, d);
    return fv_dot3(d, d) > limit * limit;
}

/* Sum at most *budget samples of a link; true when it is whole. */
static bool integrate_link(const struct fv_inertial *inertial, uint32_t i, uint32_t *budget)
{
    struct fv_inertial_station *station = fv_inertial_station_at(inertial, i);
    const struct fv_inertial_sample *list = samples_of(inertial, i);
    const int64_t end_ns =
        fv_stamp_since(fv_inertial_station_at(inertial, i + 1)->stamp_ns, station->stamp_ns);
    struct fv_imu_biases biases;
    memcpy(biases.gyro, inertial->state->shared.gyro_bias, sizeof biases.gyro);
    memcpy(biases.acceleration, station->now.acceleration_bias, sizeof biases.acceleration);
    if (station->integrated == 0 || /* begin, or begin again */
        far_apart(biases.gyro, station->link.biases.gyro, far_gyro) ||
        far_apart(biases.acceleration, station->link.biases.acceleration, far_acceleration)) {
        fv_preintegration_begin(&station->link, &biases);
        station->integrated = 0;
        if (list[0].after_ns > 0) { /* nothing from before: the first sample stands for it */
            struct fv_inertial_sample first = list[0];
            first.after_ns = 0;
            integrate(inertial, station, &first, &list[0], end_ns);
        }
    }
    for (; station->integrated + 1 < station->sample_count; station->integrated++, (*budget)--) {
        if (*budget == 0) return false;
        integrate(inertial, station, &list[station->integrated], &list[station->integrated + 1],
                  end_ns);
    }
    return true;
}

/* Attitude of the sensor at a station. */
static void attitude(const struct fv_inertial *inertial, const struct fv_inertial_station *station,
                     double R[9])
{
    fv_multiply33(station->pose.T_world_cam.R, inertial->config.T_cam_imu.R, R);
}

/* First values of a station: those of the one before, moved on by the link. */
static void follow(const struct fv_inertial *inertial, uint32_t i)
{
    const struct fv_inertial_station *a = fv_inertial_station_at(inertial, i);
    struct fv_inertial_station *b = fv_inertial_station_at(inertial, i + 1);
    double R[9], gained[3];
    if (b->now.scale > 0) return;
    b->now = a->now;
    memset(b->now.turn, 0, sizeof b->now.turn);
    memset(b->now.offset, 0, sizeof b->now.offset);
    attitude(inertial, a, R);
    fv_rotate3(R, a->link.velocity, gained);
    for (int k = 0; k < 3; k++)
        b->now.velocity[k] +=
            gained[k] + inertial->config.gravity * a->link.time_s * a->now.down[k];
}

/* Gravity is against the mean of what the sensor feels. */
static void guess_down(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    double down[3] = {0, 0, 0};
    for (uint32_t i = 0; i + 1 < s->taking_part; i++) {
        const struct fv_inertial_station *station = fv_inertial_station_at(inertial, i);
        double R[9], gained[3];
        attitude(inertial, station, R);
        fv_rotate3(R, station->link.velocity, gained);
        for (int k = 0; k < 3; k++)
            down[k] -= gained[k];
    }
    if (!fv_normalise3(down)) return;
    for (uint32_t i = 0; i < s->taking_part; i++)
        fv_copy3(down, fv_inertial_station_at(inertial, i)->now.down);
}

/* ---- an estimate ----------------------------------------------------------------------------- */

bool fv_inertial_wanted(const struct fv_inertial *inertial)
{
    return inertial->state->waiting >= FV_INERTIAL_STATIONS_PER_ESTIMATE &&
           inertial->state->phase == FV_INERTIAL_IDLE;
}

bool fv_inertial_busy(const struct fv_inertial *inertial)
{
    return inertial->state->phase != FV_INERTIAL_IDLE;
}

/* The window begins after the last link that is cut. */
static void skip_cuts(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    uint32_t behind = 0;
    for (uint32_t i = 0; i < s->count; i++)
        if (fv_inertial_station_at(inertial, i)->cut) behind = i + 1;
    if (behind == 0) return;
    keep_biases(s);
    s->first = slot_of(inertial, behind);
    s->count -= behind;
    s->handed = 0;
    s->prior.known = s->estimate.known = false;
}

void fv_inertial_begin(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    s->waiting = 0;
    skip_cuts(inertial);
    while (s->count > FV_INERTIAL_WINDOW)
        drop_oldest(inertial);
    uint32_t part = 0;
    while (part + 1 < s->count && fv_inertial_station_at(inertial, part)->closed)
        part++;
    if (part + 1 < STATIONS_MIN) return;
    s->taking_part = part + 1;
    struct fv_inertial_station *oldest = fv_inertial_station_at(inertial, 0);
    if (!(oldest->now.scale > 0)) {
        oldest->now.scale = 1;
        memcpy(oldest->now.acceleration_bias, s->acceleration_bias, sizeof s->acceleration_bias);
        fv_copy3(s->down, oldest->now.down);
    }
    s->next = s->iteration = 0;
    s->phase = FV_INERTIAL_INTEGRATE;
}

static void integrate_unit(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    uint32_t budget = INTEGRATED_PER_UNIT;
    for (; s->next + 1 < s->taking_part; s->next++) {
        if (!integrate_link(inertial, s->next, &budget)) return;
        follow(inertial, s->next);
    }
    if (!s->estimate.known && s->iteration == 0) guess_down(inertial);
    s->phase = FV_INERTIAL_ELIMINATE;
    s->next = 0;
    s->moved_far = false;
}

/* The equations cannot be solved: no estimate, and the next begins from nothing. */
static void give_up(struct fv_inertial *inertial)
{
    for (uint32_t i = 0; i < inertial->state->count; i++)
        memset(&fv_inertial_station_at(inertial, i)->now, 0, sizeof(struct fv_inertial_own));
    inertial->state->handed = 0;
    inertial->state->prior.known = inertial->state->estimate.known = false;
    inertial->state->phase = FV_INERTIAL_IDLE;
}

static void eliminate_unit(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    for (int n = 0; n < ELIMINATED_PER_UNIT && s->next + 1 < s->taking_part; n++, s->next++)
        if (!fv_inertial_eliminate(inertial, s->next)) {
            give_up(inertial);
            return;
        }
    if (s->next + 1 < s->taking_part) return;
    if (!fv_inertial_solve_tail(inertial)) {
        give_up(inertial);
        return;
    }
    s->phase = FV_INERTIAL_BACK;
}

static void move_own(struct fv_inertial_own *own, const double step[FV_INERTIAL_OWN])
{
    double across[2][3];
    for (int k = 0; k < 3; k++) {
        own->turn[k] += step[FV_INERTIAL_TURN + k];
        own->offset[k] += step[FV_INERTIAL_OFFSET + k];
        own->velocity[k] += step[FV_INERTIAL_VELOCITY + k];
        own->acceleration_bias[k] += step[FV_INERTIAL_ACCELERATION_BIAS + k];
    }
    own->scale += step[SCALE];
    if (own->scale < scale_least) own->scale = scale_least;
    fv_inertial_across(own->down, across);
    for (int k = 0; k < 3; k++)
        own->down[k] += across[0][k] * step[DOWN] + across[1][k] * step[DOWN + 1];
    (void)fv_normalise3(own->down);
}

static bool is_wrong(const struct fv_inertial_station *s)
{
    return fv_norm3(s->now.offset) > wrong_sigmas * s->pose.position_sigma ||
           fv_norm3(s->now.turn) > wrong_sigmas * s->pose.turn_sigma;
}

/* A pose that errs by far more than it states had a map that was wrong: from now on it states that,
 * so that it counts for little without calling the whole estimate a misfit. Where many err so, the
 * samples may as well be wrong, or their clock, or where the sensor sits: that is a misfit. */
static void correct_sigmas(struct fv_inertial *inertial)
{
    const uint32_t count = inertial->state->taking_part;
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_inertial_station *s = fv_inertial_station_at(inertial, i);
        wrong += s->corrected || is_wrong(s);
    }
    if (count < STATIONS_TO_CORRECT || wrong * STATIONS_FOR_ONE_WRONG > count) return;
    for (uint32_t i = 0; i < count; i++) {
        struct fv_inertial_station *s = fv_inertial_station_at(inertial, i);
        if (!is_wrong(s)) continue;
        const double off = fv_norm3(s->now.offset), turned = fv_norm3(s->now.turn);
        if (off > s->pose.position_sigma) s->pose.position_sigma = off;
        if (turned > s->pose.turn_sigma) s->pose.turn_sigma = turned;
        s->corrected = true;
    }
}

/* Of the whole way. */
static void write_means(const struct fv_inertial *inertial, struct fv_inertial_estimate *e)
{
    const struct fv_inertial_state *s = inertial->state;
    const double count = (double)(s->gone + s->taking_part);
    e->log_scale = s->gone_log_scale;
    fv_copy3(s->gone_down, e->mean_down);
    for (uint32_t i = 0; i < s->taking_part; i++) {
        const struct fv_inertial_own *own = &fv_inertial_station_at(inertial, i)->now;
        e->log_scale += fv_log(own->scale);
        for (int k = 0; k < 3; k++)
            e->mean_down[k] += own->down[k];
    }
    e->log_scale /= count;
    /* Unit vectors that differ by small angles have a mean shorter by half their mean square. */
    e->down_variance = 1 - fv_norm3(e->mean_down) / count;
    if (!(e->down_variance > 0)) e->down_variance = 0;
    (void)fv_normalise3(e->mean_down);
}

static void finish(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    struct fv_inertial_estimate *e = &s->estimate;
    const struct fv_inertial_station *newest = fv_inertial_station_at(inertial, s->taking_part - 1);
    const double *C = e->covariance;
    const int down = DOWN * (FV_INERTIAL_TAIL + 1), scale = SCALE * (FV_INERTIAL_TAIL + 1);
    e->own = newest->now;
    e->shared = s->shared;
    fv_copy3(e->own.down, s->down);
    fv_inertial_across(e->own.down, e->across);
    e->stamp_ns = newest->stamp_ns;
    e->time_s =
        (double)fv_stamp_since(newest->stamp_ns, fv_inertial_station_at(inertial, 0)->stamp_ns) *
        1e-9;
    e->stations = s->taking_part;
    e->scale_sigma = __builtin_sqrt(C[scale]) / e->own.scale;
    e->gravity_sigma = __builtin_sqrt((C[down] + C[down + FV_INERTIAL_TAIL + 1]) / 2);
    write_means(inertial, e);
    e->known = true;
    correct_sigmas(inertial);
    s->phase = FV_INERTIAL_IDLE;
}

static void back_unit(struct fv_inertial *inertial)
{
    struct fv_inertial_state *s = inertial->state;
    const double *x = s->solution;
    if (s->next + 1 == s->taking_part) { /* the newest and the shared go first */
        struct fv_inertial_own *own = &fv_inertial_station_at(inertial, s->next)->now;
        s->moved_far = fv_abs(x[SCALE]) > far_scale * own->scale;
        for (int k = DOWN; k < FV_INERTIAL_TAIL; k++)
            s->moved_far = s->moved_far || fv_abs(x[k]) > (k < GYRO ? far_down : far_bias);
        move_own(own, x);
        for (int k = 0; k < 3; k++)
            s->shared.gyro_bias[k] += x[GYRO + k];
    }
    for (int n = 0; n < STEPPED_PER_UNIT && s->next > 0; n++) {
        s->next--;
        fv_inertial_step_back(inertial, s->next);
        move_own(&fv_inertial_station_at(inertial, s->next)->now, s->solution);
    }
    if (s->next > 0) return;
    s->iteration++;
    if (s->moved_far && s->iteration < ITERATIONS_MAX)
        s->phase = FV_INERTIAL_INTEGRATE;
    else
        finish(inertial);
}

bool fv_inertial_unit(struct fv_inertial *inertial)
{
    switch (inertial->state->phase) {
    case FV_INERTIAL_INTEGRATE:
        integrate_unit(inertial);
        break;
    case FV_INERTIAL_ELIMINATE:
        eliminate_unit(inertial);
        break;
    case FV_INERTIAL_BACK:
        back_unit(inertial);
        break;
    case FV_INERTIAL_IDLE:
        break;
    }
    return inertial->state->phase != FV_INERTIAL_IDLE;
}
