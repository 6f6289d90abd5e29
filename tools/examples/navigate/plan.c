#include "plan.h"

#include <math.h>
#include <string.h>

static const float no_way = 1e8f;
/* Beyond the radius: kept, and preferred, for an edge may be a cell or two nearer than the grid has
 * it: what the nearest way that is kept costs more. */
static const double margin_m = 0.12, wide_m = 0.6, near_price = 8;
static const double unknown_price = 3, squeeze_price = 60;
static const double look_m = 0.35, goal_m = 0.2, creep_m_s = 0.12;
/* So much asked for and so little of it driven is a touch; how long it is kept in mind, what of the
 * robot's edge it may be at, to either side of ahead, and how deep it is taken to be. */
static const double touch_due_m = 0.4, touch_moved_m = 0.05, touch_s = 30, touch_rad = 1.2,
                    touch_deep_m = 0.1;
static const double back_m = 0.25, back_m_s = 0.2, back_s = 3, step_s_most = 0.5;
enum { FREE_BELOW = 35, OCCUPIED_ABOVE = 65, LOOK_STEPS = 20 };

void navigate_init(struct navigate *n, const struct navigate_robot *robot, const double goal[2])
{
    memset(n, 0, sizeof *n);
    n->robot = *robot;
    memcpy(n->goal, goal, sizeof n->goal);
}

/* ---- the map --------------------------------------------------------------------------------- */

static void lower(float *to, float from)
{
    if (from < *to) *to = from;
}

/* Distances to occupied cells, over straight and diagonal steps: a pass from each end. */
static void find_gaps(struct navigate *n)
{
    const int32_t w = n->width, cells = w * n->height;
    const float straight = (float)n->cell_m, across = straight * 1.41421356f;
    for (int32_t i = 0; i < cells; i++)
        n->gap[i] = n->kind[i] == NAVIGATE_OCCUPIED ? 0 : 1e6f;
    for (int32_t pass = 0; pass < 2; pass++)
        for (int32_t k = 0; k < cells; k++) {
            const int32_t i = pass == 0 ? k : cells - 1 - k, back = pass == 0 ? -1 : 1;
            const int32_t x = i % w, before = i + back * w;
            const bool inside = before >= 0 && before < cells;
            if (x + back >= 0 && x + back < w) lower(&n->gap[i], n->gap[i + back] + straight);
            if (inside) lower(&n->gap[i], n->gap[before] + straight);
            if (inside && x > 0) lower(&n->gap[i], n->gap[before - 1] + across);
            if (inside && x + 1 < w) lower(&n->gap[i], n->gap[before + 1] + across);
        }
}

/* Price of a metre in a cell. Nearer to what is occupied than the robot's radius allows it is a
 * squeeze: only to get out of where the robot already is. */
static double price_of(const struct navigate *n, int32_t cell)
{
    const double gap = (double)n->gap[cell], least = n->robot.radius_m + margin_m;
    double price = n->kind[cell] == NAVIGATE_UNKNOWN ? unknown_price : 1;
    if (gap < least) {
        price *= squeeze_price;
    } else if (gap < least + wide_m) {
        const double near = (least + wide_m - gap) / wide_m;
        price *= 1 + near_price * near * near;
    }
    return price;
}

/* ---- Dijkstra -------------------------------------------------------------------------------- */

static void put(struct navigate *n, int32_t at, int32_t cell)
{
    n->heap[at] = cell;
    n->place[cell] = at;
}

static void offer(struct navigate *n, int32_t cell, float cost)
{
    if (cost >= n->cost[cell]) return;
    int32_t at = n->place[cell] >= 0 ? n->place[cell] : n->queued++;
    n->cost[cell] = cost;
    for (; at > 0 && n->cost[n->heap[(at - 1) / 2]] > cost; at = (at - 1) / 2)
        put(n, at, n->heap[(at - 1) / 2]);
    put(n, at, cell);
}

static int32_t take(struct navigate *n)
{
    const int32_t first = n->heap[0], last = n->heap[--n->queued];
    int32_t at = 0;
    n->place[first] = -1;
    for (int32_t child = 1; child < n->queued; child = 2 * at + 1) {
        if (child + 1 < n->queued && n->cost[n->heap[child + 1]] < n->cost[n->heap[child]]) child++;
        if (n->cost[n->heap[child]] >= n->cost[last]) break;
        put(n, at, n->heap[child]);
        at = child;
    }
    if (n->queued > 0) put(n, at, last);
    return first;
}

static int32_t cell_at(const struct navigate *n, double x, double y)
{
    const double column = floor((x - n->origin[0]) / n->cell_m),
                 row = floor((y - n->origin[1]) / n->cell_m);
    if (column < 0 || row < 0 || column >= n->width || row >= n->height) return -1;
    return (int32_t)row * n->width + (int32_t)column;
}

static double middle(const struct navigate *n, int32_t cell, int axis)
{
    return n->origin[axis] + ((axis == 0 ? cell % n->width : cell / n->width) + 0.5) * n->cell_m;
}

static void spread(struct navigate *n)
{
    static const int8_t dx[8] = {1, 0, -1, 0, 1, -1, -1, 1}, dy[8] = {0, 1, 0, -1, 1, 1, -1, -1};
    while (n->queued > 0) {
        const int32_t cell = take(n), x = cell % n->width, y = cell / n->width;
        for (int32_t k = 0; k < 8; k++) {
            const int32_t nx = x + dx[k], ny = y + dy[k], next = ny * n->width + nx;
            if (nx < 0 || ny < 0 || nx >= n->width || ny >= n->height ||
                n->kind[next] == NAVIGATE_OCCUPIED)
                continue;
            const double step = (k < 4 ? 1 : 1.41421356) * n->cell_m;
            offer(n, next, n->cost[cell] + (float)(step * price_of(n, next)));
        }
    }
}

/* ---- what the grid does not show --------------------------------------------------------------
 */

static double turned(double angle) /* to [-pi, pi] */
{
    return remainder(angle, 6.283185307179586);
}

/* The cells just ahead of the robot's edge, as it stood there. */
static void mark_touch(struct navigate *n, const struct navigate_touch *touch)
{
    for (int32_t i = 0; i < n->width * n->height; i++) {
        const double x = middle(n, i, 0) - touch->position[0],
                     y = middle(n, i, 1) - touch->position[1], beyond = hypot(x, y);
        if (beyond < n->robot.radius_m || beyond > n->robot.radius_m + touch_deep_m) continue;
        if (fabs(turned(atan2(y, x) - touch->yaw)) < touch_rad) n->kind[i] = NAVIGATE_OCCUPIED;
    }
}

static void mark_touches(struct navigate *n)
{
    for (int64_t i = 0; i < n->touches && i < NAVIGATE_TOUCHES_MAX; i++)
        if (n->touch[i].until_s > n->now_s) mark_touch(n, &n->touch[i]);
}

/* The way to the goal from all cells, by their kinds. */
static void find_ways(struct navigate *n)
{
    const int32_t width = n->width, height = n->height;
    for (int32_t i = 0; i < width * height; i++) {
        n->cost[i] = no_way;
        n->place[i] = -1;
    }
    find_gaps(n);
    n->queued = 0;
    const int32_t goal = cell_at(n, n->goal[0], n->goal[1]);
    if (goal >= 0) offer(n, goal, 0);
    for (int32_t i = 0; goal < 0 && i < width * height; i++) { /* beyond the edge it is unknown */
        const int32_t x = i % width, y = i / width;
        if ((x > 0 && y > 0 && x + 1 < width && y + 1 < height) || n->kind[i] == NAVIGATE_OCCUPIED)
            continue;
        const double way = hypot(middle(n, i, 0) - n->goal[0], middle(n, i, 1) - n->goal[1]);
        offer(n, i, (float)(unknown_price * way));
    }
    spread(n);
}

bool navigate_plan(struct navigate *n, const int8_t *cells, int32_t width, int32_t height,
                   double cell_m, const double origin[2])
{
    if (width < 1 || height < 1 || width > NAVIGATE_CELLS_MAX / height) return false;
    n->width = width;
    n->height = height;
    n->cell_m = cell_m;
    memcpy(n->origin, origin, sizeof n->origin);
    for (int32_t i = 0; i < width * height; i++)
        n->kind[i] = cells[i] > OCCUPIED_ABOVE                ? NAVIGATE_OCCUPIED
                     : cells[i] >= 0 && cells[i] < FREE_BELOW ? NAVIGATE_FREE
                                                              : NAVIGATE_UNKNOWN;
    mark_touches(n);
    find_ways(n);
    return true;
}

/* ---- steering -------------------------------------------------------------------------------- */

/* The next cell on the way to the goal; itself where there is none better. */
static int32_t step_down(const struct navigate *n, int32_t cell)
{
    int32_t best = cell;
    for (int32_t y = -1; y <= 1; y++)
        for (int32_t x = -1; x <= 1; x++) {
            const int32_t column = cell % n->width + x, row = cell / n->width + y;
            if (column < 0 || row < 0 || column >= n->width || row >= n->height) continue;
            const int32_t next = row * n->width + column;
            if (n->cost[next] < n->cost[best]) best = next;
        }
    return best;
}

/* How far the robot may go straight ahead over cells that are known to be free; `*blocked`: up to
 * what is occupied. */
static double free_ahead(const struct navigate *n, const double position[2], double yaw,
                         bool *blocked)
{
    const double step = 0.5 * n->cell_m, reach = 1.0;
    *blocked = false;
    for (double way = 0; way < reach; way += step) {
        const int32_t cell = cell_at(n, position[0] + way * cos(yaw), position[1] + way * sin(yaw));
        if (cell < 0 || n->kind[cell] == NAVIGATE_UNKNOWN) return way;
        if ((double)n->gap[cell] < n->robot.radius_m + 0.5 * margin_m && way > 0.1) {
            *blocked = true;
            return way;
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
    const bool drives = n->asked.speed_m_s > 0 && step_s > 0 && step_s < step_s_most;
    n->now_s = time_s;
    if (step_s < 0) navigate_forget(n); /* of another clock */
    if (hypot(position[0] - n->stood[0], position[1] - n->stood[1]) > touch_moved_m ||
        n->due_m == 0) {
        memcpy(n->stood, position, sizeof n->stood);
        n->due_m = 0;
    }
    if (drives) n->due_m += n->asked.speed_m_s * step_s;
    return n->due_m > touch_due_m;
}

static void take_touch(struct navigate *n, const double position[2], double yaw)
{
    n->touch[n->touches++ % NAVIGATE_TOUCHES_MAX] =
        (struct navigate_touch){{position[0], position[1]}, yaw, n->now_s + touch_s};
    n->backs_until_s = n->now_s + back_s;
    n->due_m = 0;
    mark_touches(n);
    find_ways(n);
}

/* Whether the robot's width is free behind it, for as far as it goes until it stands. */
static bool may_back(const struct navigate *n, const double position[2], double yaw)
{
    const double radius = n->robot.radius_m, end = radius + margin_m;
    for (int32_t side = -1; side <= 1; side++)
        for (double way = 0; way < end; way += 0.5 * n->cell_m) {
            const double x = position[0] - way * cos(yaw) - side * radius * sin(yaw),
                         y = position[1] - way * sin(yaw) + side * radius * cos(yaw);
            const int32_t cell = cell_at(n, x, y);
            if (way > (side == 0 ? 0 : margin_m) && (cell < 0 || n->kind[cell] != NAVIGATE_FREE))
                return false;
        }
    return true;
}

/* Off from the last touch, for as long as that takes and is possible. */
static bool backs(struct navigate *n, const double position[2], double yaw)
{
    if (n->now_s >= n->backs_until_s) return false;
    const double *from = n->touch[(n->touches - 1) % NAVIGATE_TOUCHES_MAX].position;
    const bool on =
        hypot(position[0] - from[0], position[1] - from[1]) < back_m && may_back(n, position, yaw);
    if (!on) n->backs_until_s = n->now_s;
    return on;
}

void navigate_forget(struct navigate *n)
{
    n->touches = 0;
    n->backs_until_s = n->now_s;
    n->due_m = 0;
}

/* Along the way that was planned. */
static struct navigate_motion pursue(struct navigate *n, const double position[2], double yaw)
{
    const double left = hypot(n->goal[0] - position[0], n->goal[1] - position[1]);
    const int32_t here = cell_at(n, position[0], position[1]);
    int32_t target = here;
    bool blocked;
    if (left < goal_m) return (struct navigate_motion){.arrived = true};
    if (here < 0 || n->cost[here] >= no_way) return (struct navigate_motion){0};
    for (double way = 0; way < look_m; way += n->cell_m)
        target = step_down(n, target);
    double to[2] = {middle(n, target, 0), middle(n, target, 1)};
    if (left < look_m) memcpy(to, n->goal, sizeof to);
    const double off = turned(atan2(to[1] - position[1], to[0] - position[0]) - yaw);
    const double ahead = free_ahead(n, position, yaw, &blocked);
    double speed = n->robot.speed_m_s * between(1 - fabs(off) / 0.5, 0, 1);
    speed = between(speed, 0, between(ahead - 0.1, 0, 1)); /* it stops within what is free */
    /* Nothing more can be seen of what is ahead: on, slowly. */
    const bool stuck = speed < 0.02 && fabs(off) < 0.25 && !blocked;
    n->looked = stuck ? n->looked + 1 : 0;
    if (n->looked > LOOK_STEPS) speed = creep_m_s;
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
