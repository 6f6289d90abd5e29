#include "sim.h"

#include <stdlib.h>
#include <string.h>

/* The robot and what moves about, tick by tick: accelerations are bounded, and what moves gives
 * way. The robot stops at what it touches. */

static const double tick_s = 0.02; /* along the path */
static const double camera_ahead_m = 0.1, camera_down = 20 * FV_PI / 180;
static const double forward_most = 2 * FV_SIM_DRIVE_SPEED_M_S, backward_most = 0.3; /* m/s */
static const double turning_most = 1.5;                                             /* rad/s */
static const double throttle_m_s2 = 0.8, brake_m_s2 = 1.5, turning_rad_s2 = 3.0;
static const double mover_m_s2 = 0.6, mover_gap_m = 0.15;
static const double stand_s = 1.0; /* before the drive and after it */

static double draw(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

static double between(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

static double distance(const double a[2], const double b[2])
{
    const double x = a[0] - b[0], y = a[1] - b[1];
    return __builtin_sqrt(x * x + y * y);
}

/* ---- a tick ---------------------------------------------------------------------------------- */

static void mover_at(const struct fv_sim_mover *mover, double along, double position[2])
{
    for (int32_t k = 0; k < 2; k++)
        position[k] = mover->from[k] + along * mover->way[k];
}

/* The pace that it wants: along its lane and back, and away from the robot when that is near. */
static double wanted_pace(const struct fv_sim_mover *m, const struct fv_sim_drive_tick *from,
                          int32_t i, struct fv_sim_drive_tick *to)
{
    const double along = from->along[i], pace = from->pace[i];
    const double brake_m = 0.5 * pace * pace / mover_m_s2 + 0.02;
    double at[2];
    mover_at(m, along, at);
    const double gap = distance(at, from->position) - m->radius - FV_SIM_DRIVE_RADIUS_M;
    const double away =
        (at[0] - from->position[0]) * m->way[0] + (at[1] - from->position[1]) * m->way[1];
    if (gap < FV_SIM_DRIVE_YIELD_M) to->direction[i] = away > 0 ? 1 : -1;
    const bool at_end = to->direction[i] > 0 ? along > m->length - brake_m : along < brake_m;
    if (!at_end) return to->direction[i] * m->speed;
    if (gap >= FV_SIM_DRIVE_YIELD_M) to->direction[i] = (int8_t)-to->direction[i];
    return 0;
}

static void move_mover(const struct fv_sim_drive *d, const struct fv_sim_drive_tick *from,
                       int32_t i, struct fv_sim_drive_tick *to)
{
    const struct fv_sim_mover *m = &d->mover[i];
    to->direction[i] = from->direction[i];
    const double most = mover_m_s2 * d->tick_s, want = wanted_pace(m, from, i, to);
    const double pace = from->pace[i] + between(want - from->pace[i], -most, most);
    const double along = from->along[i] + 0.5 * (from->pace[i] + pace) * d->tick_s;
    double at[2], was[2];
    mover_at(m, along, at);
    mover_at(m, from->along[i], was);
    const double gap = distance(at, to->position) - m->radius - FV_SIM_DRIVE_RADIUS_M;
    const bool near = gap < mover_gap_m && distance(at, to->position) < distance(was, to->position);
    const bool stays = near || along < 0 || along > m->length;
    to->along[i] = stays ? from->along[i] : along;
    to->pace[i] = stays ? 0 : pace;
}

/* Gap between the robot at a place and the nearest of all that stands or moves. */
static double gap_at(const struct fv_sim_drive *d, const double position[2],
                     const struct fv_sim_drive_tick *tick)
{
    double least = fv_sim_drive_gap(d, position, FV_SIM_DRIVE_RADIUS_M);
    for (int32_t i = 0; i < d->mover_count; i++) {
        double at[2];
        mover_at(&d->mover[i], tick->along[i], at);
        const double gap = distance(at, position) - d->mover[i].radius - FV_SIM_DRIVE_RADIUS_M;
        least = gap < least ? gap : least;
    }
    return least;
}

static void move_robot(const struct fv_sim_drive *d, const struct fv_sim_drive_tick *from,
                       double speed, double turning, struct fv_sim_drive_tick *to)
{
    const double dt = d->tick_s, want = between(speed, -backward_most, forward_most);
    const bool brakes =
        want * from->speed < 0 || __builtin_fabs(want) < __builtin_fabs(from->speed);
    const double most = (brakes ? brake_m_s2 : throttle_m_s2) * dt, turn = turning_rad_s2 * dt;
    to->speed = from->speed + between(want - from->speed, -most, most);
    to->turning =
        from->turning +
        between(between(turning, -turning_most, turning_most) - from->turning, -turn, turn);
    to->yaw = from->yaw + 0.5 * (from->turning + to->turning) * dt;
    const double way = 0.5 * (from->speed + to->speed) * dt, yaw = 0.5 * (from->yaw + to->yaw);
    to->position[0] = from->position[0] + way * fv_cos(yaw);
    to->position[1] = from->position[1] + way * fv_sin(yaw);
}

void fv_sim_drive_step(struct fv_sim_drive *d, double speed_m_s, double turning_rad_s)
{
    if (d->tick_count == 0 || d->tick_count >= d->tick_room) return;
    const struct fv_sim_drive_tick *from = &d->tick[d->tick_count - 1];
    struct fv_sim_drive_tick *to = &d->tick[d->tick_count];
    move_robot(d, from, speed_m_s, turning_rad_s, to);
    const double gap = gap_at(d, to->position, from);
    const bool touches = gap <= 0 && gap < gap_at(d, from->position, from);
    if (touches) {
        memcpy(to->position, from->position, sizeof to->position);
        to->speed = 0;
        d->contacts += !d->touches;
    }
    d->touches = touches || (d->touches && gap < 0.02);
    for (int32_t i = 0; i < d->mover_count; i++)
        move_mover(d, from, i, to);
    if (d->reached < 0 && distance(to->position, d->goal) < FV_SIM_DRIVE_GOAL_M)
        d->reached = d->tick_count;
    d->tick_count++;
}

/* ---- between ticks --------------------------------------------------------------------------- */

/* Cubic Hermite interpolation: values and their rates at both ends of a step. */
static double smooth(double a, double b, double rate_a, double rate_b, double step, double f)
{
    const double g = 1 - f;
    return g * g * (1 + 2 * f) * a + f * f * (1 + 2 * g) * b +
           step * f * g * (g * rate_a - f * rate_b);
}

/* The ticks about a time, and where between them; before the first and after the last all stands
 * still, or goes on for the little that is asked. */
static double find(const struct fv_sim_drive *d, double time_s,
                   const struct fv_sim_drive_tick *about[2])
{
    const double at = (time_s - d->begin_s) / d->tick_s;
    const int64_t last = d->tick_count - 1;
    if (at < 0) {
        about[0] = about[1] = &d->tick[0];
        return 0;
    }
    if (at >= (double)last) {
        about[0] = about[1] = &d->tick[last];
        return 0;
    }
    const int64_t i = (int64_t)at;
    about[0] = &d->tick[i];
    about[1] = &d->tick[d->jumps ? i : i + 1];
    return at - (double)i;
}

void fv_sim_drive_robot(const struct fv_sim_drive *d, double time_s, double position[2],
                        double *yaw)
{
    const struct fv_sim_drive_tick *t[2];
    const double f = find(d, time_s, t);
    for (int32_t k = 0; k < 2; k++) {
        double rate[2];
        for (int32_t i = 0; i < 2; i++)
            rate[i] = t[i]->speed * (k == 0 ? fv_cos(t[i]->yaw) : fv_sin(t[i]->yaw));
        position[k] = t[0] == t[1] ? t[0]->position[k]
                                   : smooth(t[0]->position[k], t[1]->position[k], rate[0], rate[1],
                                            d->tick_s, f);
    }
    *yaw = t[0] == t[1] ? t[0]->yaw
                        : smooth(t[0]->yaw, t[1]->yaw, t[0]->turning, t[1]->turning, d->tick_s, f);
}

void fv_sim_drive_mover(const struct fv_sim_drive *d, int32_t number, double time_s,
                        double position[2], double *heading, double *along)
{
    const struct fv_sim_mover *m = &d->mover[number];
    const struct fv_sim_drive_tick *t[2];
    const double f = find(d, time_s, t);
    *along = t[0] == t[1] ? t[0]->along[number]
                          : smooth(t[0]->along[number], t[1]->along[number], t[0]->pace[number],
                                   t[1]->pace[number], d->tick_s, f);
    mover_at(m, *along, position);
    *heading = fv_atan2(m->way[1], m->way[0]);
}

void fv_sim_drive_camera(double T_body_cam[12])
{
    const double c = fv_cos(camera_down), s = fv_sin(camera_down);
    const double rows[12] = {0, 0 - s, c, camera_ahead_m, -1,    0,
                             0, 0,     0, 0 - c,          0 - s, FV_SIM_DRIVE_CAMERA_M};
    memcpy(T_body_cam, rows, sizeof rows);
}

void fv_sim_drive_body(const struct fv_sim_drive *d, double time_s, double T_world_body[12])
{
    double position[2], yaw;
    fv_sim_drive_robot(d, time_s, position, &yaw);
    const double c = fv_cos(yaw), s = fv_sin(yaw);
    const double rows[12] = {c, 0 - s, 0, position[0], s, c, 0, position[1], 0, 0, 1, 0};
    memcpy(T_world_body, rows, sizeof rows);
}

double fv_sim_drive_seconds(const struct fv_sim_drive *d)
{
    return (double)d->tick_count * d->tick_s;
}

/* ---- along the path -------------------------------------------------------------------------- */

/* Index of the path's point that is `ahead_m` beyond the point `from`. */
static int32_t ahead_of(const struct fv_sim_drive *d, int32_t from, double ahead_m)
{
    double way = 0;
    while (from + 1 < d->path_count && way < ahead_m) {
        way += distance(d->path[from], d->path[from + 1]);
        from++;
    }
    return from;
}

/* The nearest point of the path, from the last one on. */
static int32_t follow(const struct fv_sim_drive *d, int32_t at, const double position[2])
{
    while (at + 1 < d->path_count &&
           distance(d->path[at + 1], position) <= distance(d->path[at], position))
        at++;
    return at;
}

static double turned(double angle) /* to [-pi, pi] */
{
    return angle - 2 * FV_PI * fv_floor((angle + FV_PI) / (2 * FV_PI));
}

/* Something that moves stands close ahead. */
static bool must_wait(const struct fv_sim_drive *d, const struct fv_sim_drive_tick *tick)
{
    const double close_m = 0.25, c = fv_cos(tick->yaw), s = fv_sin(tick->yaw);
    for (int32_t i = 0; i < d->mover_count; i++) {
        double at[2];
        mover_at(&d->mover[i], tick->along[i], at);
        const double dx = at[0] - tick->position[0], dy = at[1] - tick->position[1];
        if (__builtin_sqrt(dx * dx + dy * dy) - d->mover[i].radius - FV_SIM_DRIVE_RADIUS_M <
                close_m &&
            c * dx + s * dy > 0)
            return true;
    }
    return false;
}

/* A tick along the path: towards a point some way ahead, slower in bends and before the goal. */
static void follow_path(struct fv_sim_drive *d, int32_t *at)
{
    const double look_m = 0.45, arrive_m = 0.03;
    const struct fv_sim_drive_tick *tick = &d->tick[d->tick_count - 1];
    *at = follow(d, *at, tick->position);
    const double *target = d->path[ahead_of(d, *at, look_m)];
    const double left_m = distance(tick->position, d->goal);
    const double off =
        turned(fv_atan2(target[1] - tick->position[1], target[0] - tick->position[0]) - tick->yaw);
    const double bend = 1 - __builtin_fabs(off) / 0.8, most = __builtin_sqrt(2 * 0.3 * left_m);
    double speed = FV_SIM_DRIVE_SPEED_M_S * (bend > 0 ? bend : 0), turning = 2.2 * off;
    speed = speed < most ? speed : most;
    if ((double)d->tick_count * d->tick_s < stand_s || left_m < arrive_m) speed = turning = 0;
    if (must_wait(d, tick)) speed = 0;
    fv_sim_drive_step(d, speed, turning);
}

static bool make_room(struct fv_sim_drive *d, int64_t ticks)
{
    struct fv_sim_drive_tick *more = realloc(d->tick, (size_t)ticks * sizeof *more);
    if (more == NULL) return false;
    memset(more + d->tick_room, 0, (size_t)(ticks - d->tick_room) * sizeof *more);
    d->tick = more;
    d->tick_room = ticks;
    return true;
}

static void stand_at_start(struct fv_sim_drive *d)
{
    struct fv_sim_drive_tick *first = &d->tick[0];
    const double *ahead = d->path[ahead_of(d, 0, 0.5)];
    memcpy(first->position, d->path[0], sizeof first->position);
    first->yaw = fv_atan2(ahead[1] - d->path[0][1], ahead[0] - d->path[0][0]);
    for (int32_t i = 0; i < d->mover_count; i++) {
        first->along[i] = 0.5 * d->mover[i].length;
        first->direction[i] = (i & 1) ? 1 : -1;
    }
    d->tick_count = 1;
    d->reached = -1;
}

bool fv_sim_drive_begin(struct fv_sim_drive *d, double begin_s, double tick_hz, int64_t ticks)
{
    fv_sim_drive_free(d);
    d->begin_s = begin_s;
    d->tick_s = 1 / tick_hz;
    if (!make_room(d, ticks)) return false;
    d->touches = false;
    d->contacts = 0;
    stand_at_start(d);
    return true;
}

/* Until it has stood at the goal for a while. */
static bool drive_path(struct fv_sim_drive *d)
{
    const int64_t most = (int64_t)(FV_SIM_DRIVE_SECONDS_MAX / tick_s);
    int64_t stood = 0;
    int32_t at = 0;
    d->tick_s = tick_s;
    if (!make_room(d, 4096)) return false;
    stand_at_start(d);
    while (d->tick_count < most && (double)stood * tick_s < stand_s) {
        if (d->tick_count == d->tick_room && !make_room(d, 2 * d->tick_room)) return false;
        follow_path(d, &at);
        stood = d->reached >= 0 && d->tick[d->tick_count - 1].speed < 1e-6 ? stood + 1 : 0;
    }
    return true;
}

/* ---- beside the pit -------------------------------------------------------------------------- */

/* The robot stands where its camera may see the pit, more often near to it, whichever way it came.
 */
static void choose_stand(const struct fv_sim_drive *d, struct fv_random *random,
                         struct fv_sim_drive_tick *tick)
{
    enum { TRIES = 400 };
    const double gap_m = 0.02, aside = FV_PI / 3, *pit = d->pit;
    for (int32_t tries = 0; tries < TRIES; tries++) {
        const double reach = FV_SIM_DRIVE_RADIUS_M + draw(random, 0, draw(random, 0.1, 3.5));
        const double x = draw(random, pit[0] - reach, pit[1] + reach),
                     y = draw(random, pit[2] - reach, pit[3] + reach),
                     to_x = draw(random, pit[0], pit[1]), to_y = draw(random, pit[2], pit[3]),
                     off = draw(random, -aside, aside), at[2] = {x, y};
        if (gap_at(d, at, tick) < gap_m) continue;
        memcpy(tick->position, at, sizeof at);
        tick->yaw = fv_atan2(to_y - y, to_x - x) + off;
        return;
    }
}

/* In each second elsewhere; where the hall has no pit, about its middle. What moves stands, too. */
static bool stand_beside_pit(struct fv_sim_drive *d, uint64_t seed)
{
    struct fv_random random;
    if (!make_room(d, FV_SIM_DRIVE_STANDS)) return false;
    fv_random_seed(&random, seed ^ 0x57A2D5u);
    d->tick_s = 1;
    d->jumps = true;
    stand_at_start(d);
    for (; d->tick_count < FV_SIM_DRIVE_STANDS; d->tick_count++)
        d->tick[d->tick_count] = d->tick[0];
    for (int32_t i = 0; i < FV_SIM_DRIVE_STANDS; i++)
        choose_stand(d, &random, &d->tick[i]);
    return true;
}

/* ---- lanes ----------------------------------------------------------------------------------- */

static double radius_of(enum fovea_truth_class object_class)
{
    return object_class == FOVEA_TRUTH_PERSON ? 0.22
           : object_class == FOVEA_TRUTH_BALL ? 0.15
           : object_class == FOVEA_TRUTH_CONE ? 0.29
                                              : 0.25;
}

static double path_distance(const struct fv_sim_drive *d, const double point[2])
{
    double least = 1e9;
    for (int32_t i = 0; i < d->path_count; i++) {
        const double here = distance(d->path[i], point);
        least = here < least ? here : least;
    }
    return least;
}

/* Clear of all that stands, apart from other lanes, and wherever it stops there is a way past it.
 */
static bool is_lane(const struct fv_sim_drive *d, struct fv_sim_drive_search *search,
                    const struct fv_sim_mover *m)
{
    enum { STEPS = 12 };
    const double beside_m = 0.9, ends_m = 1.2;
    for (int32_t i = 0; i <= STEPS; i++) {
        double at[2];
        mover_at(m, m->length * i / STEPS, at);
        if (fv_sim_drive_gap(d, at, m->radius) < 0.12 || distance(at, d->path[0]) < ends_m ||
            distance(at, d->goal) < ends_m)
            return false;
        if (i % STEPS == 0 && path_distance(d, at) < beside_m) return false;
        for (int32_t k = 0; k < d->mover_count; k++) {
            for (int32_t j = 0; j <= STEPS; j++) {
                double other[2];
                mover_at(&d->mover[k], d->mover[k].length * j / STEPS, other);
                if (distance(at, other) < m->radius + d->mover[k].radius + 0.25) return false;
            }
        }
    }
    for (int32_t i = 0; i <= 2; i++) {
        struct fv_sim_block block = {.radius = m->radius};
        mover_at(m, 0.5 * m->length * i, block.center);
        if (!fv_sim_drive_has_way(search, &block)) return false;
    }
    return true;
}

static bool choose_lane(const struct fv_sim_drive *d, struct fv_sim_drive_search *search,
                        struct fv_random *random, struct fv_sim_mover *m)
{
    enum { TRIES = 400 };
    for (int32_t tries = 0; tries < TRIES; tries++) {
        m->from[0] = draw(random, -d->half[0], d->half[0]);
        m->from[1] = draw(random, -d->half[1], d->half[1]);
        const double heading = draw(random, -FV_PI, FV_PI);
        m->way[0] = fv_cos(heading);
        m->way[1] = fv_sin(heading);
        m->length = draw(random, 0.6, tries < TRIES / 2 ? 3.0 : 1.0);
        m->speed = draw(random, 0.15, 0.45);
        if (is_lane(d, search, m)) return true;
    }
    return false;
}

/* Those for which there is no lane are left out. */
static bool choose_lanes(struct fv_sim_world *world)
{
    struct fv_sim_drive *d = &world->drive;
    struct fv_sim_drive_search *search = fv_sim_drive_search_open(d);
    struct fv_random random;
    if (search == NULL) return false;
    fv_random_seed(&random, world->seed ^ 0x1A9E5u);
    for (int32_t i = 0; i < world->object_count; i++) {
        struct fv_sim_mover mover = {.radius = radius_of(world->object[i].object_class)};
        if (d->mover_count == FV_SIM_DRIVE_MOVERS_MAX || !choose_lane(d, search, &random, &mover))
            continue;
        world->object[d->mover_count] = world->object[i];
        d->mover[d->mover_count++] = mover;
    }
    world->object_count = d->mover_count;
    fv_sim_drive_search_close(search);
    return true;
}

bool fv_sim_drive_create(struct fv_sim_world *world, const struct fv_sim_options *options)
{
    struct fv_sim_drive *d = &world->drive;
    return choose_lanes(world) &&
           (options->stands ? stand_beside_pit(d, world->seed) : drive_path(d));
}

void fv_sim_drive_free(struct fv_sim_drive *d)
{
    free(d->tick);
    d->tick = NULL;
    d->tick_count = d->tick_room = 0;
}
