#include "sim.h"

/* The way: straights and bends with transitions, whose curvature is linear in between (clothoids),
 * so that steering is continuous. Its heading stays within 85 degrees of one direction: it never
 * comes back to itself. Then the drive: as fast as allowed, with bounded braking and speeding up.
 */

static const double step_m = 1.0 / FV_SIM_ROAD_STEPS_PER_M, drive_step_s = 0.05;
static const double begin_m = 20.0;  /* where the drive begins: some road lies behind */
static const double ahead_m = 130.0; /* of road beyond where it ends */
static const double heading_most = 85.0 * FV_PI / 180.0;
static const double turn_most = 44.0 * FV_PI / 180.0; /* rad/s */
static const double lane_m = -1.75; /* of the camera, to the left of the middle line */
static const double brake_m_s2 = 3.5, throttle_m_s2 = 2.0;

/* By scenery: straights and bends. */
static const struct {
    double straight_low, straight_high, speed_low, speed_high; /* m, m/s */
    double radius_low, radius_high;                            /* m */
} ways[FV_SIM_SCENERY_COUNT] = {
    [FV_SIM_STREET] = {25, 70, 9, 14, 15, 28},
    [FV_SIM_SUBURB] = {20, 70, 11, 17, 18, 45},
    [FV_SIM_HIGHWAY] = {30, 120, 17, 25, 18, 60},
};

static double draw(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

/* ---- the way --------------------------------------------------------------------------------- */

/* Set curvature and allowed speed of the points from `*at` on, `count` of them, the curvature from
 * `from` to `to`. */
static void lay(struct fv_sim_road *road, int32_t *at, int32_t count, double from, double to,
                double speed)
{
    for (int32_t i = 0; i < count && *at < FV_SIM_ROAD_POINTS; i++, ++*at) {
        road->point[*at].curvature = from + (to - from) * i / count;
        road->point[*at].speed = speed;
    }
}

static int32_t points_of(double length_m)
{
    return (int32_t)(length_m * FV_SIM_ROAD_STEPS_PER_M) + 1;
}

/* A bend that turns the heading as far as allowed. At the begin of the road it has no way in. */
static void lay_bend(struct fv_sim_road *road, struct fv_random *random, int32_t *at,
                     double *heading)
{
    const bool first = *at == 0;
    const double radius =
        draw(random, ways[road->scenery].radius_low, ways[road->scenery].radius_high);
    const double least_angle =
        first ? 48 / radius : 0.6; /* the first is still there at the begin */
    double angle = draw(random, 0.6, road->scenery == FV_SIM_HIGHWAY ? 2.9 : 2.2);
    const bool either = fv_random_below(random, 2) != 0, left = first ? *heading < 0 : either;
    angle = angle > least_angle ? angle : least_angle;
    const double room_left = heading_most - *heading, room_right = heading_most + *heading;
    const double side = (left ? room_left : room_right) > 0.5 ? (left ? 1 : -1) : (left ? -1 : 1);
    const double room = side > 0 ? room_left : room_right;
    angle = angle < room ? angle : room;
    double over = 0.25 * radius < 6 ? 6 : 0.25 * radius; /* of a transition, m */
    if (over > 0.45 * radius * angle) over = 0.45 * radius * angle;
    const double curvature = side / radius, swing = 1 - curvature * lane_m;
    const double least = 8.0 / swing,
                 most = 15.0 / swing < turn_most * radius ? 15.0 / swing : turn_most * radius;
    const double speed = draw(random, 0.3 * least + 0.7 * most, most);
    if (!first) lay(road, at, points_of(over), 0, curvature, speed);
    lay(road, at, points_of(radius * angle - (first ? 0.5 : 1.0) * over), curvature, curvature,
        speed);
    lay(road, at, points_of(over), curvature, 0, speed);
    *heading += side * angle;
}

static void lay_straight(struct fv_sim_road *road, struct fv_random *random, int32_t *at)
{
    const double length =
        draw(random, ways[road->scenery].straight_low, ways[road->scenery].straight_high);
    const double speed =
        draw(random, ways[road->scenery].speed_low, ways[road->scenery].speed_high);
    const bool slow = fv_random_below(random, 5) == 0; /* a crossing, traffic */
    lay(road, at, points_of(0.6 * length), 0, 0, speed);
    lay(road, at, points_of(0.1 * length), 0, 0, slow ? draw(random, 3.0, 5.0) : speed);
    lay(road, at, points_of(0.3 * length), 0, 0, speed);
}

static void lay_way(struct fv_sim_road *road, struct fv_random *random)
{
    int32_t at = 0;
    const double side = fv_random_below(random, 2) != 0 ? 1 : -1;
    double heading = side * draw(random, 0.9, 1.4);
    road->point[0].heading = heading + draw(random, 0, 2 * FV_PI);
    const bool bend_first = fv_random_below(random, 5) != 0;
    if (bend_first) lay_bend(road, random, &at, &heading);
    while (at < FV_SIM_ROAD_POINTS) {
        lay_straight(road, random, &at);
        lay_bend(road, random, &at, &heading);
    }
    for (int32_t i = 0; i + 1 < FV_SIM_ROAD_POINTS; i++) {
        struct fv_sim_road_point *a = &road->point[i], *b = &road->point[i + 1];
        const double middle = a->heading + step_m * (3 * a->curvature + b->curvature) / 8;
        b->heading = a->heading + step_m * (a->curvature + b->curvature) / 2;
        b->x = a->x + step_m * fv_cos(middle);
        b->y = a->y + step_m * fv_sin(middle);
    }
}

/* ---- the drive ------------------------------------------------------------------------------- */

/* Where it ends the camera stands. */
static void limit_speeds(struct fv_sim_road *road)
{
    struct fv_sim_road_point *p = road->point;
    const int32_t last = FV_SIM_ROAD_POINTS - 1,
                  end = last - (int32_t)(ahead_m * FV_SIM_ROAD_STEPS_PER_M);
    for (int32_t i = end; i <= last; i++)
        p[i].speed = 0;
    for (int32_t i = end; i-- > 0;) {
        const double most =
            __builtin_sqrt(p[i + 1].speed * p[i + 1].speed + 2 * brake_m_s2 * step_m);
        if (p[i].speed > most) p[i].speed = most;
    }
    for (int32_t i = 1; i < end; i++) {
        const double most =
            __builtin_sqrt(p[i - 1].speed * p[i - 1].speed + 2 * throttle_m_s2 * step_m);
        if (p[i].speed > most) p[i].speed = most;
    }
}

static double speed_at(const struct fv_sim_road *road, double along_m)
{
    const double at = along_m * FV_SIM_ROAD_STEPS_PER_M;
    const int32_t i = (int32_t)at;
    if (i + 1 >= FV_SIM_ROAD_POINTS) return 0;
    return road->point[i].speed + (road->point[i + 1].speed - road->point[i].speed) * (at - i);
}

static void drive(struct fv_sim_road *road)
{
    double way = begin_m;
    for (int32_t i = 0; i < FV_SIM_DRIVE_STEPS; i++) {
        road->way_m[i] = way;
        road->way_speed[i] = speed_at(road, way);
        /* the mean speed of the step (midpoint rule) */
        way += drive_step_s * speed_at(road, way + 0.5 * drive_step_s * road->way_speed[i]);
    }
}

void fv_sim_road_path_create(struct fv_sim_road *road, uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed ^ 0x40AD5EEDu);
    /* Three in five roads are highways with their ramps. */
    const uint32_t scenery = fv_random_below(&random, 5);
    road->scenery = scenery < 3 ? FV_SIM_HIGHWAY : scenery == 3 ? FV_SIM_STREET : FV_SIM_SUBURB;
    lay_way(road, &random);
    limit_speeds(road);
    drive(road);
    for (int32_t i = 0; i < 3; i++) {
        const double wave_m = draw(&random, 60, 200) / (i + 1);
        road->slope_rate[i] = 2 * FV_PI / wave_m;
        road->slope[i] = draw(&random, 0, 0.025) * wave_m / (2 * FV_PI);
        road->slope_phase[i] = draw(&random, 0, 2 * FV_PI);
    }
    for (int32_t i = 0; i < 6; i++)
        road->bounce[i] = draw(&random, 0, 2 * FV_PI);
}

/* ---- asked for ------------------------------------------------------------------------------- */

void fv_sim_road_at(const struct fv_sim_road *road, double along_m, double position[3],
                    double *heading, double *slope)
{
    const double most = FV_SIM_ROAD_LENGTH_M - 0.01;
    const double s = along_m < 0 ? 0 : along_m > most ? most : along_m;
    const int32_t i = (int32_t)(s * FV_SIM_ROAD_STEPS_PER_M);
    const struct fv_sim_road_point *a = &road->point[i], *b = &road->point[i + 1];
    const double f = s * FV_SIM_ROAD_STEPS_PER_M - i, g = 1 - f;
    /* Cubic Hermite polynomials */
    const double h0 = g * g * (1 + 2 * f), h1 = f * f * (1 + 2 * g), t0 = f * g * g * step_m,
                 t1 = -f * f * g * step_m;
    position[0] = h0 * a->x + h1 * b->x + t0 * fv_cos(a->heading) + t1 * fv_cos(b->heading);
    position[1] = h0 * a->y + h1 * b->y + t0 * fv_sin(a->heading) + t1 * fv_sin(b->heading);
    *heading = h0 * a->heading + h1 * b->heading + t0 * a->curvature + t1 * b->curvature;
    position[2] = 0;
    *slope = 0;
    for (int32_t k = 0; k < 3; k++) {
        const double angle = road->slope_rate[k] * s + road->slope_phase[k];
        position[2] += road->slope[k] * fv_sin(angle);
        *slope += road->slope[k] * road->slope_rate[k] * fv_cos(angle);
    }
}

double fv_sim_road_curvature(const struct fv_sim_road *road, double along_m)
{
    const double at = along_m * FV_SIM_ROAD_STEPS_PER_M;
    const int32_t i = at < 0                         ? 0
                      : at >= FV_SIM_ROAD_POINTS - 1 ? FV_SIM_ROAD_POINTS - 1
                                                     : (int32_t)at;
    return road->point[i].curvature;
}

double fv_sim_road_way(const struct fv_sim_road *road, double time_s, double *speed_m_s)
{
    const double at = time_s < 0 ? 0 : time_s / drive_step_s;
    const int32_t i = at >= FV_SIM_DRIVE_STEPS - 1 ? FV_SIM_DRIVE_STEPS - 2 : (int32_t)at;
    const double f = at >= FV_SIM_DRIVE_STEPS - 1 ? 1 : at - i, g = 1 - f;
    const double v0 = road->way_speed[i], v1 = road->way_speed[i + 1];
    *speed_m_s = g * v0 + f * v1;
    return g * g * (1 + 2 * f) * road->way_m[i] + f * f * (1 + 2 * g) * road->way_m[i + 1] +
           f * g * drive_step_s * (g * v0 - f * v1);
}

double fv_sim_road_clearance(const struct fv_sim_road *road, double x, double y)
{
    double least = 1e18;
    for (int32_t i = 0; i < FV_SIM_ROAD_POINTS; i += FV_SIM_ROAD_STEPS_PER_M) {
        const double dx = road->point[i].x - x, dy = road->point[i].y - y,
                     square = dx * dx + dy * dy;
        if (square < least) least = square;
    }
    return __builtin_sqrt(least);
}
