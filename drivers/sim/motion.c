#include "sim.h"

#include <string.h>

/* Where the camera is: closed forms of time, so that any frame can be asked for. Positions are sums
 * of slow sinusoids or B-splines, so accelerations are continuous and bounded; a hand adds its
 * tremble (up to 0.16 m/s, 0.9 m/s^2). */

struct pose {
    double position[3], yaw, pitch, roll; /* yaw anticlockwise from +x, pitch up */
};

static const double kidnap_leave_s = 14.0, kidnap_return_s = 17.0, kidnap_back_s = 12.0;

/* ---- orientation ----------------------------------------------------------------------------- */

static void pose_matrix(const struct pose *pose, double T[12])
{
    const double cy = fv_cos(pose->yaw), sy = fv_sin(pose->yaw), cp = fv_cos(pose->pitch);
    const double sp = fv_sin(pose->pitch), cr = fv_cos(pose->roll), sr = fv_sin(pose->roll);
    const double forward[3] = {cy * cp, sy * cp, sp}, right[3] = {sy, -cy, 0.0};
    const double down[3] = {cy * sp, sy * sp, -cp}; /* forward x right */
    for (int32_t i = 0; i < 3; i++) {
        T[4 * i] = cr * right[i] + sr * down[i];
        T[4 * i + 1] = cr * down[i] - sr * right[i];
        T[4 * i + 2] = forward[i];
        T[4 * i + 3] = pose->position[i];
    }
}

static void look_at(struct pose *pose, double x, double y, double z)
{
    const double dx = x - pose->position[0], dy = y - pose->position[1], dz = z - pose->position[2];
    pose->yaw = fv_atan2(dy, dx);
    pose->pitch = fv_atan2(dz, __builtin_sqrt(dx * dx + dy * dy));
}

/* ---- a hand's tremble ------------------------------------------------------------------------ */

static double tremble(const double *phase, double t)
{
    return 1.00 * fv_sin(2.0 * t + phase[0]) + 0.40 * fv_sin(5.3 * t + phase[1]) +
           0.10 * fv_sin(11.9 * t + phase[2]);
}

static void hand(const struct fv_sim_motion *m, double t, double amount, struct pose *pose)
{
    for (int32_t i = 0; i < 3; i++)
        pose->position[i] += 0.026 * amount * tremble(m->phase + 3 * i, t * (1.0 + 0.07 * i));
    pose->yaw += 0.020 * amount * tremble(m->phase + 9, t * 0.93);
    pose->pitch += 0.018 * amount * tremble(m->phase + 12, t * 1.11);
    pose->roll += 0.022 * amount * tremble(m->phase + 15, t * 1.03);
}

/* ---- splines --------------------------------------------------------------------------------- */

static void spline_add(struct fv_sim_motion *m, double x, double y, double z, double yaw,
                       double pitch)
{
    if (m->control_count == FV_SIM_SPLINE_MAX) return;
    double *c = m->control[m->control_count++];
    c[0] = x;
    c[1] = y;
    c[2] = z;
    c[3] = yaw;
    c[4] = pitch;
}

/* Closed uniform cubic B-spline with one second per control point; yaw gains `turns` full turns per
 * round. */
static void spline_pose(const struct fv_sim_motion *m, double t, double turns, struct pose *pose)
{
    const double floor_t = fv_floor(t), f = t - floor_t, g = 1.0 - f;
    const double weight[4] = {g * g * g / 6.0, (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0,
                              (4.0 - 6.0 * g * g + 3.0 * g * g * g) / 6.0, f * f * f / 6.0};
    double sum[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    for (int32_t k = 0; k < 4; k++) {
        const double at = floor_t + k - 1, round = fv_floor(at / m->control_count);
        const double *c = m->control[(int32_t)(at - round * m->control_count)];
        for (int32_t i = 0; i < 5; i++)
            sum[i] += weight[k] * c[i];
        sum[3] += weight[k] * round * turns * 2.0 * FV_PI;
    }
    *pose = (struct pose){.position = {sum[0], sum[1], sum[2]}, .yaw = sum[3], .pitch = sum[4]};
}

static const double camera_corner_m = 1.1;

static void spline_ring(struct fv_sim_motion *m, double speed)
{
    const double length = fv_sim_ring_length(m->lane, camera_corner_m), start = m->phase[20];
    const int32_t count = (int32_t)(length / speed + 0.5);
    double last = 0.0, turns = 0.0;
    for (int32_t i = 0; i < count; i++) {
        double position[2], ahead[2], heading;
        const double along = start + m->direction * length * i / count;
        fv_sim_ring(m->lane, camera_corner_m, along + 0.4 * m->direction, ahead, &heading);
        fv_sim_ring(m->lane, camera_corner_m, along, position, &(double){0.0});
        if (m->direction < 0.0) heading += FV_PI;
        if (i > 0 && heading + turns - last > FV_PI) turns -= 2.0 * FV_PI;
        if (i > 0 && heading + turns - last < -FV_PI) turns += 2.0 * FV_PI;
        last = heading + turns;
        spline_add(m, position[0], position[1], 1.25, last, -0.06);
    }
}

/* The tour: round the room, a stop, a turn on the spot, out of the door, round the corridor, back
 * in, a quick look. */
static void spline_tour(struct fv_sim_motion *m)
{
    const double half = 0.5 * FV_PI, lane_y = -m->lane[1], door_y = -m->room[1];
    for (int32_t i = 0; i < 14; i++) {
        const double angle = half + 2.0 * FV_PI * (i + 7.6) / 14.0 - FV_PI * 0.1;
        spline_add(m, 1.7 * fv_cos(angle), 1.25 * fv_sin(angle), 1.45 + 0.15 * fv_sin(0.9 * i),
                   angle + FV_PI - 4.0 * half, -0.12);
    }
    for (int32_t i = 0; i < 5; i++)
        spline_add(m, 0.0, -1.3, 1.45, 5.0 * half, -0.1);
    for (int32_t i = 1; i <= 4; i++)
        spline_add(m, 0.0, -1.3, 1.45, (5.0 + 0.5 * i) * half, -0.05);
    spline_add(m, 0.0, -1.7, 1.45, 7.0 * half, -0.05);
    spline_add(m, 0.0, door_y + 0.7, 1.42, 7.0 * half, -0.05);
    spline_add(m, 0.0, door_y - 0.1, 1.40, 7.1 * half, -0.05);
    spline_add(m, 0.1, door_y - 0.8, 1.40, 7.45 * half, -0.05);
    spline_add(m, 0.5, lane_y + 0.2, 1.40, 7.8 * half, -0.05);
    const double length = fv_sim_ring_length(m->lane, camera_corner_m),
                 straight = 2.0 * (m->lane[0] - camera_corner_m);
    const int32_t count = 34;
    for (int32_t i = 0; i <= count; i++) {
        double position[2], ahead[2], heading;
        const double along = straight * 0.5 + 1.2 + (length - 2.4) * i / count;
        fv_sim_ring(m->lane, camera_corner_m, along + 0.4, ahead, &heading);
        fv_sim_ring(m->lane, camera_corner_m, along, position, &(double){0.0});
        if (along + 0.4 >= length) heading += 4.0 * half;
        spline_add(m, position[0], position[1], 1.4 + 0.05 * fv_sin(0.5 * i), 8.0 * half + heading,
                   -0.06);
    }
    spline_add(m, -0.4, lane_y + 0.1, 1.40, 12.3 * half, -0.05);
    spline_add(m, -0.1, door_y - 0.8, 1.40, 12.8 * half, -0.05);
    spline_add(m, 0.0, door_y, 1.40, 13.0 * half, -0.05);
    spline_add(m, 0.0, door_y + 0.8, 1.42, 13.0 * half, -0.08);
    spline_add(m, 0.0, -1.9, 1.45, 13.0 * half, -0.1);
    spline_add(m, -0.1, -1.6, 1.45, 13.0 * half, -0.1);
    spline_add(m, -0.2, -1.4, 1.45, 14.2 * half, -0.1);
    spline_add(m, -0.2, -1.3, 1.45, 14.2 * half, -0.1);
}

/* ---- trajectories ---------------------------------------------------------------------------- */

static void orbit(const struct fv_sim_motion *m, double t, struct pose *pose)
{
    const double *p = m->phase;
    const double angle = p[20] + m->direction * (0.26 * t + 0.25 * fv_sin(0.37 * t + p[21]));
    const double reach = 1.0 + 0.09 * fv_sin(0.23 * t + p[22]) + 0.03 * fv_sin(0.61 * t + p[23]);
    pose->position[0] = 1.9 * reach * fv_cos(angle);
    pose->position[1] = 1.45 * reach * fv_sin(angle);
    pose->position[2] = 1.45 + 0.15 * fv_sin(0.41 * t + p[24]);
    pose->roll = 0.0;
    look_at(pose, 0.7 * fv_sin(0.19 * t + p[25]), 0.6 * fv_sin(0.16 * t + p[26]),
            1.05 + 0.2 * fv_sin(0.29 * t + p[27]));
    hand(m, t, 1.0, pose);
}

/* Moving for 3 s (ramps of 0.5 s), standing for 2 s: the time that has passed on the way. */
static double stopgo_time(double t)
{
    const double period = 5.0, way = 2.5, rounds = fv_floor(t / period), x = t - rounds * period;
    double done = way;
    if (x < 0.5) {
        const double f = x / 0.5;
        done =
            0.5 * (f * f * f - 0.5 * f * f * f * f); /* integral of the smooth step 3 f^2 - 2 f^3 */
    } else if (x < 2.5) {
        done = 0.25 + x - 0.5;
    } else if (x < 3.0) {
        const double f = (3.0 - x) / 0.5;
        done = way - 0.5 * (f * f * f - 0.5 * f * f * f * f);
    }
    return rounds * way + done;
}

/* Moving for 6 s, then standing for good: the time that has passed on the way. The last 0.5 s slow
 * down. */
static double stand_time(double t)
{
    const double f = t < 5.5 ? 1.0 : t < 6.0 ? (6.0 - t) / 0.5 : 0.0;
    return t < 5.5 ? t : 5.75 - 0.5 * (f * f * f - 0.5 * f * f * f * f);
}

/* A turn of 110 degrees within `turn_s` at 3 s, and back at 5.5 s, every 7 s. At its fastest it has
 * 15/8 of its mean rate: 3.6 rad/s where it takes a second. */
static double fast_turn(double t, double turn_s)
{
    const double x = t - 7.0 * fv_floor(t / 7.0), there = 3.0 + turn_s, back = 5.5 + turn_s;
    double f = x < 3.0 || x >= back ? 0.0
               : x < there          ? (x - 3.0) / turn_s
               : x < 5.5            ? 1.0
                                    : (back - x) / turn_s;
    f = f * f * f * (10.0 - 15.0 * f + 6.0 * f * f);
    return f * 110.0 * FV_PI / 180.0;
}

static void wander(const struct fv_sim_motion *m, double t, struct pose *pose)
{
    const double *p = m->phase;
    pose->position[0] = 6.5 * (0.6 * fv_sin(0.0710 * t + p[20]) + 0.4 * fv_sin(0.1307 * t + p[21]));
    pose->position[1] = 4.2 * (0.6 * fv_sin(0.0837 * t + p[22]) + 0.4 * fv_sin(0.1573 * t + p[23]));
    pose->position[2] = 1.55 + 0.18 * fv_sin(0.211 * t + p[24]);
    pose->yaw = p[25] + m->direction * 0.09 * t + 0.9 * fv_sin(0.1271 * t + p[26]);
    pose->pitch = -0.06 + 0.08 * fv_sin(0.173 * t + p[27]);
    hand(m, t, 1.0, pose);
}

static void rotate(const struct fv_sim_motion *m, double t, struct pose *pose)
{
    const double *p = m->phase;
    const struct pose spot = {.position = {0.6 * fv_cos(p[20]), 0.9 * fv_sin(p[20]), 1.5}};
    *pose = spot;
    hand(m, t, 1.0, pose);
    for (int32_t i = 0; i < 3; i++)
        pose->position[i] = spot.position[i]; /* exactly: only the turning trembles */
    pose->yaw +=
        p[21] + m->direction * (1.6 * fv_sin(0.35 * t + p[22]) + 0.4 * fv_sin(0.83 * t + p[23]));
    pose->pitch += -0.08 + 0.14 * fv_sin(0.52 * t + p[24]);
}

static void kidnap(const struct fv_sim_motion *m, double t, struct pose *pose)
{
    if (t < kidnap_leave_s) {
        orbit(m, t, pose);
    } else if (t < kidnap_return_s) {
        orbit(m, t, pose);
        pose->position[0] = m->store[0] + 0.4 * pose->position[0];
        pose->position[1] = m->store[1] + 0.4 * pose->position[1];
    } else {
        orbit(m, t - kidnap_back_s, pose);
    }
}

/* A car: on its lane at the height of the camera, on springs that the road shakes. It nods when it
 * brakes, and leans out of bends. */
static void drive(const struct fv_sim_motion *m, double t, struct pose *pose)
{
    const double *b = m->road->bounce;
    double speed, before, after, heading, slope;
    const double along = fv_sim_road_way(m->road, t, &speed);
    fv_sim_road_way(m->road, t - 0.1, &before);
    fv_sim_road_way(m->road, t + 0.1, &after);
    fv_sim_road_at(m->road, along, pose->position, &heading, &slope);
    const double moves = speed < 5 ? speed / 5 : 1, nod = 0.004 * (after - before) / 0.2;
    const double swing = speed * speed * fv_sim_road_curvature(m->road, along);
    pose->position[0] += 1.75 * fv_sin(heading);
    pose->position[1] -= 1.75 * fv_cos(heading);
    pose->position[2] += FV_SIM_ROAD_HEIGHT_M + 0.008 * moves * fv_sin(9.3 * t + b[0]) +
                         0.005 * moves * fv_sin(23.0 * t + b[1]);
    pose->yaw = heading + 0.002 * moves * fv_sin(1.7 * t + b[2]);
    pose->pitch = fv_atan2(slope, 1.0) + nod - 0.01 + 0.003 * moves * fv_sin(8.1 * t + b[3]) +
                  0.0015 * moves * fv_sin(19.0 * t + b[4]);
    pose->roll = 0.003 * swing + 0.003 * moves * fv_sin(6.7 * t + b[5]);
}

/* ---- outside --------------------------------------------------------------------------------- */

void fv_sim_motion_create(struct fv_sim_motion *motion, const struct fv_sim_options *options,
                          const struct fv_sim_world *world)
{
    memset(motion, 0, sizeof *motion);
    motion->trajectory = options->trajectory;
    motion->turn_s = FV_SIM_TURN_DEG_S / options->turn_rate_deg_s;
    motion->half_view[0] = options->fov_deg * FV_PI / 360.0;
    motion->half_view[1] = motion->half_view[0] * options->height / options->width;
    memcpy(motion->room, world->room, sizeof motion->room);
    memcpy(motion->lane, world->lane, sizeof motion->lane);
    memcpy(motion->store, world->store, sizeof motion->store);
    motion->road = &world->road;
    motion->drive = &world->drive;
    struct fv_random random;
    fv_random_seed(&random, options->seed ^ 0x60A7E5u);
    for (int32_t i = 0; i < FV_SIM_PHASES; i++)
        motion->phase[i] = 2.0 * FV_PI * fv_random_unit(&random);
    motion->direction = fv_random_below(&random, 2) ? 1.0 : -1.0;
    if (options->trajectory == FV_SIM_CORRIDOR) spline_ring(motion, 0.75);
    if (options->trajectory == FV_SIM_TOUR) spline_tour(motion);
}

uint64_t fv_sim_motion_frames(enum fv_sim_trajectory trajectory, double rate_hz)
{
    double seconds = 30.0;
    if (trajectory == FV_SIM_WANDER) return 0;
    if (trajectory == FV_SIM_STAND) seconds = 306.0;
    if (trajectory == FV_SIM_TOUR) seconds = 68.0;
    if (trajectory == FV_SIM_ROAD) seconds = 12.0;
    if (trajectory == FV_SIM_CORRIDOR) seconds = 43.0; /* once round takes 36 s */
    return (uint64_t)(seconds * rate_hz + 0.5);
}

void fv_sim_motion_pose(const struct fv_sim_motion *m, double t, double T_world_cam[12])
{
    struct pose pose = {.position = {0.0, 0.0, 1.5}};
    if (m->trajectory == FV_SIM_DRIVE) {
        double T_body_cam[12];
        fv_sim_drive_camera(T_body_cam);
        fv_sim_drive_body(m->drive, t, T_world_cam);
        fv_sim_compose(T_world_cam, T_body_cam, T_world_cam);
        return;
    }
    switch (m->trajectory) {
    case FV_SIM_TOUR:
        spline_pose(m, t, 3.0, &pose);
        hand(m, t, 0.5, &pose);
        break;
    case FV_SIM_CORRIDOR:
        spline_pose(m, t, m->direction, &pose);
        hand(m, t, 0.35, &pose);
        break;
    case FV_SIM_ROTATE:
        rotate(m, t, &pose);
        break;
    case FV_SIM_STOPGO:
        orbit(m, stopgo_time(t), &pose);
        break;
    case FV_SIM_STAND:
        orbit(m, stand_time(t), &pose);
        break;
    case FV_SIM_FAST:
        orbit(m, 0.6 * t, &pose);
        pose.yaw += m->direction * fast_turn(t, m->turn_s);
        pose.pitch *= 0.4; /* not at the floor while turned outward */
        break;
    case FV_SIM_KIDNAP:
        kidnap(m, t, &pose);
        break;
    case FV_SIM_WANDER:
        wander(m, t, &pose);
        break;
    case FV_SIM_ROAD:
        drive(m, t, &pose);
        break;
    case FV_SIM_BOARD:
        fv_sim_board_pose(m, t, pose.position, &pose.yaw, &pose.pitch, &pose.roll);
        break;
    case FV_SIM_STILL:
        orbit(m, 0.0, &pose);
        break;
    default:
        orbit(m, t, &pose);
        break;
    }
    pose_matrix(&pose, T_world_cam);
}

void fv_sim_motion_body(const struct fv_sim_motion *m, double t, double T_world_body[12])
{
    if (m->trajectory == FV_SIM_DRIVE)
        fv_sim_drive_body(m->drive, t, T_world_body);
    else
        fv_sim_motion_pose(m, t, T_world_body);
}
