/* Steering: a pursuit of the way that was planned, and what is done when the robot is held. */
#include <math.h>
#include <string.h>

#include "map.h"
#include "ways.h"

static const double look_m = 0.35, far_m = 1.2, goal_m = 0.2, creep_m_s = 0.12;
/* It turns on the spot where the way leads off its heading by more than turn_rad, or, where it has
 * open_m more room than it must keep, by more than turn_rad + turn_more_rad. */
static const double turn_rad = 0.5, turn_more_rad = 0.5, open_m = 0.4;
/* How long it looks at what it cannot see, or at a way that is too narrow, before it goes on slowly
 * or gives that up. */
static const double look_s = 1, give_up_s = 2;
/* It can stop stop_m before the end of what is free, when it begins to brake stop_s late. */
static const double stop_m = 0.1, stop_s = 0.4, brake_m_s2 = 0.6;
/* So much asked for and so little of it driven is a touch; how long it is kept in mind. */
static const double touch_due_m = 0.4, touch_moved_m = 0.05, touch_s = 30;
static const double back_m = 0.25, back_m_s = 0.2, back_s = 3, step_s_most = 0.5;
/* From a way that is too narrow it backs farther: its camera does not see what is beside it. It
 * gives the way up when it is too narrow a second time within again_m of the first place. */
static const double back_to_look_m = 0.5, again_m = 0.5;

/* Whether a cell has too little room for a robot that is now in the cell `here`. A cell with more
 * room than `here` is always allowed; beside what is only suspected, one with as much, too. */
static bool is_narrow(const struct navigate *n, int32_t cell, int32_t here)
{
    const float least = (float)(n->robot.radius_m + 0.5 * navigate_margin_m);
    if (n->gap[cell] >= least) return false;
    if (here < 0) return true;
    return n->hold[cell] < least ? n->gap[cell] <= n->gap[here] : n->gap[cell] < n->gap[here];
}

/* How far the robot may go straight ahead over cells that are known to be free; `*blocked`: up to
 * where it is too narrow. */
static double free_ahead(const struct navigate *n, const double position[2], double yaw,
                         bool *blocked)
{
    const double step = 0.5 * n->cell_m, reach = 1.0;
    const int32_t here = navigate_cell(n, position[0], position[1]);
    *blocked = false;
    for (int32_t i = 0; i * step < reach; i++) {
        const double way = i * step;
        const int32_t cell =
            navigate_cell(n, position[0] + way * cos(yaw), position[1] + way * sin(yaw));
        if (cell < 0 || n->kind[cell] == NAVIGATE_UNKNOWN) return way;
        if (is_narrow(n, cell, here) && way > 0.1) {
            *blocked = true;
            return way - step; /* for its middle may be as much nearer to that than the cell's */
        }
    }
    return reach;
}

static double between(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* Whether the last commands should have moved the robot, and did not. */
static bool is_held(struct navigate *n, const double position[2], double time_s)
{
    const double step_s = time_s - n->now_s;
    n->now_s = time_s;
    n->step_s = step_s > 0 && step_s < step_s_most ? step_s : 0;
    if (step_s < 0) navigate_forget(n); /* of another clock */
    if (hypot(position[0] - n->stood[0], position[1] - n->stood[1]) > touch_moved_m ||
        n->due_m == 0) {
        memcpy(n->stood, position, sizeof n->stood);
        n->due_m = 0;
    }
    if (n->asked.speed_m_s > 0) n->due_m += n->asked.speed_m_s * n->step_s;
    return n->due_m > touch_due_m;
}

static void begin_back(struct navigate *n, const double position[2], double way_m)
{
    memcpy(n->backs_from, position, sizeof n->backs_from);
    n->backs_m = way_m;
    n->backs_until_s = n->now_s + back_s;
    n->due_m = 0;
}

static void take_touch(struct navigate *n, const double position[2], double yaw)
{
    n->touch[n->touches++ % NAVIGATE_TOUCHES_MAX] =
        (struct navigate_touch){{position[0], position[1]}, yaw, n->now_s + touch_s};
    begin_back(n, position, back_m);
    navigate_map_touches(n);
    navigate_ways_change(n);
}

/* A way stays too narrow: the first time the robot backs to look at it, the second time it is
 * remembered as closed. */
static void take_narrow(struct navigate *n, const double position[2], double yaw)
{
    const bool again = n->narrow_until_s > n->now_s &&
                       hypot(position[0] - n->narrow[0], position[1] - n->narrow[1]) < again_m;
    memcpy(n->narrow, position, sizeof n->narrow);
    n->narrow_until_s = n->now_s + touch_s;
    n->stands_s = 0;
    if (again) {
        n->given_up++;
        take_touch(n, position, yaw);
    } else {
        begin_back(n, position, back_to_look_m);
    }
}

/* Whether the robot's width is free behind it, for as far as it goes until it stands. */
static bool may_back(const struct navigate *n, const double position[2], double yaw)
{
    const double radius = n->robot.radius_m, end = radius + navigate_margin_m,
                 step = 0.5 * n->cell_m;
    for (int32_t side = -1; side <= 1; side++)
        for (int32_t i = 0; i * step < end; i++) {
            const double way = i * step,
                         x = position[0] - way * cos(yaw) - side * radius * sin(yaw),
                         y = position[1] - way * sin(yaw) + side * radius * cos(yaw);
            const int32_t cell = navigate_cell(n, x, y);
            if (way > (side == 0 ? 0 : navigate_margin_m) &&
                (cell < 0 || n->kind[cell] != NAVIGATE_FREE))
                return false;
        }
    return true;
}

/* Whether it still drives back: for the way that was asked, while there is room behind it. */
static bool backs(struct navigate *n, const double position[2], double yaw)
{
    if (n->now_s >= n->backs_until_s) return false;
    const double way = hypot(position[0] - n->backs_from[0], position[1] - n->backs_from[1]);
    const bool on = way < n->backs_m && may_back(n, position, yaw);
    if (!on) n->backs_until_s = n->now_s;
    return on;
}

/* So fast that it stops within what is free ahead. */
static double stopping_speed(double ahead_m)
{
    const double way = fmax(ahead_m - stop_m, 0);
    return brake_m_s2 * (sqrt(stop_s * stop_s + 2 * way / brake_m_s2) - stop_s);
}

/* The part of the full speed that a way allows which leads off the heading by `off` rad. */
static double part_of_speed(const struct navigate *n, const double position[2], double off)
{
    const int32_t cell = navigate_cell(n, position[0], position[1]);
    const double room_m =
        cell < 0 ? 0 : (double)n->gap[cell] - n->robot.radius_m - navigate_margin_m;
    return between(1 - fabs(off) / (turn_rad + turn_more_rad * between(room_m / open_m, 0, 1)), 0,
                   1);
}

/* Along the way that was planned. */
static struct navigate_motion pursue(struct navigate *n, const double position[2], double yaw)
{
    const double left = hypot(n->goal[0] - position[0], n->goal[1] - position[1]);
    double to[2];
    bool blocked;
    if (left < goal_m) return (struct navigate_motion){.arrived = true};
    if (!navigate_ways_ahead(n, position, look_m, far_m, to)) return (struct navigate_motion){0};
    if (left < look_m) memcpy(to, n->goal, sizeof to);
    const double off = navigate_turned(atan2(to[1] - position[1], to[0] - position[0]) - yaw);
    const double ahead = free_ahead(n, position, yaw, &blocked);
    double speed = n->robot.speed_m_s * part_of_speed(n, position, off);
    speed = fmin(speed, stopping_speed(ahead));
    const bool stands = speed < 0.02 && fabs(off) < 0.25;
    n->stands_s = stands ? n->stands_s + n->step_s : 0;
    if (stands && blocked && n->stands_s > give_up_s) take_narrow(n, position, yaw);
    /* Nothing more can be seen of what is ahead: on, slowly. */
    if (stands && !blocked && n->stands_s > look_s) speed = creep_m_s;
    return (struct navigate_motion){
        speed, between(2 * off, -n->robot.turning_rad_s, n->robot.turning_rad_s), false};
}

struct navigate_motion navigate_steer(struct navigate *n, const double position[2], double yaw,
                                      double time_s)
{
    if (is_held(n, position, time_s)) take_touch(n, position, yaw);
    n->asked = backs(n, position, yaw) ? (struct navigate_motion){.speed_m_s = -back_m_s}
                                       : pursue(n, position, yaw);
    return n->asked;
}
