#include "map.h"

#include <math.h>
#include <string.h>

/* Beyond the radius: kept, and preferred, for an edge may be a cell or two nearer than the grid has
 * it: what the nearest way that is kept costs more. */
static const double wide_m = 0.6, near_price = 8, unknown_price = 3, suspect_price = 20,
                    squeeze_price = 60;
/* What of the robot's edge a touch may be at, to either side of ahead, and how deep it is taken to
 * be. */
static const double touch_rad = 1.2, touch_deep_m = 0.1;
static const double come_s = 3; /* what may move is forgotten within */
enum { FREE_BELOW = 35, COME_ABOVE = 50, SUSPECTED_ABOVE = 65, OCCUPIED_ABOVE = 88 };

static void lower(float *to, float from)
{
    if (from < *to) *to = from;
}

/* Lower a cell's distance to that of a neighbour and the step from there. `back` -1: neighbours
 * before it, in its row and the row before; 1: those after it. */
static void take_nearest(const struct navigate *n, float *gap, int32_t x, int32_t y, int32_t back)
{
    const float straight = (float)n->cell_m, across = straight * 1.41421356f;
    const int32_t w = n->width, i = y * w + x, before = i + back * w;
    if (x + back >= 0 && x + back < w) lower(&gap[i], gap[i + back] + straight);
    if (y + back < 0 || y + back >= n->height) return;
    lower(&gap[i], gap[before] + straight);
    if (x > 0) lower(&gap[i], gap[before - 1] + across);
    if (x + 1 < w) lower(&gap[i], gap[before + 1] + across);
}

/* Distances to cells of a kind or worse, over straight and diagonal steps: a pass from each end. */
static void find_gaps(const struct navigate *n, enum navigate_kind kind, float *gap)
{
    const int32_t w = n->width, h = n->height;
    for (int32_t i = 0; i < w * h; i++)
        gap[i] = n->kind[i] >= kind ? 0 : 1e6f;
    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++)
            take_nearest(n, gap, x, y, -1);
    for (int32_t y = h - 1; y >= 0; y--)
        for (int32_t x = w - 1; x >= 0; x--)
            take_nearest(n, gap, x, y, 1);
}

/* Where the robot has not its margin beside what is occupied, the price is that of a squeeze, which
 * it pays to leave a place where it already is, and where no other way leads on. Beside what is
 * suspected the price is lower: from near the robot will see whether something is there. */
double navigate_price(const struct navigate *n, int32_t cell)
{
    const double gap = (double)n->gap[cell], fits = n->robot.radius_m + navigate_margin_m,
                 wide = n->robot.radius_m + navigate_margin_m + wide_m;
    if (n->kind[cell] >= NAVIGATE_SUSPECTED) return 0;
    const double price = n->kind[cell] == NAVIGATE_UNKNOWN ? unknown_price : 1;
    if ((double)n->hold[cell] < fits) return price * squeeze_price;
    if (gap < fits) return price + suspect_price;
    if (gap >= wide) return price;
    const double near = (wide - gap) / wide_m;
    return price + near_price * near * near;
}

int32_t navigate_cell(const struct navigate *n, double x, double y)
{
    const double column = floor((x - n->origin[0]) / n->cell_m),
                 row = floor((y - n->origin[1]) / n->cell_m);
    if (column < 0 || row < 0 || column >= n->width || row >= n->height) return -1;
    return (int32_t)row * n->width + (int32_t)column;
}

double navigate_middle(const struct navigate *n, int32_t cell, int axis)
{
    return n->origin[axis] + ((axis == 0 ? cell % n->width : cell / n->width) + 0.5) * n->cell_m;
}

double navigate_exit(const struct navigate *n, int32_t cell, int32_t goal)
{
    if (goal >= 0) return cell == goal ? 0 : -1;
    const int32_t x = cell % n->width, y = cell / n->width;
    const bool edge = x == 0 || y == 0 || x + 1 == n->width || y + 1 == n->height;
    if (!edge || n->kind[cell] >= NAVIGATE_SUSPECTED) return -1;
    return unknown_price * /* as is what lies beyond the edge */
           hypot(navigate_middle(n, cell, 0) - n->goal[0],
                 navigate_middle(n, cell, 1) - n->goal[1]);
}

double navigate_turned(double angle)
{
    return remainder(angle, 6.283185307179586);
}

/* The cells just ahead of the robot's edge, as it stood there. */
static void mark_touch(struct navigate *n, const struct navigate_touch *touch)
{
    for (int32_t i = 0; i < n->width * n->height; i++) {
        const double x = navigate_middle(n, i, 0) - touch->position[0],
                     y = navigate_middle(n, i, 1) - touch->position[1], beyond = hypot(x, y);
        if (beyond < n->robot.radius_m || beyond > n->robot.radius_m + touch_deep_m) continue;
        if (fabs(navigate_turned(atan2(y, x) - touch->yaw)) < touch_rad)
            n->kind[i] = NAVIGATE_OCCUPIED;
    }
}

void navigate_map_touches(struct navigate *n)
{
    for (int64_t i = 0; i < n->touches && i < NAVIGATE_TOUCHES_MAX; i++)
        if (n->touch[i].until_s > n->now_s) mark_touch(n, &n->touch[i]);
    find_gaps(n, NAVIGATE_SUSPECTED, n->gap);
    find_gaps(n, NAVIGATE_OCCUPIED, n->hold);
}

/* What speaks for an obstacle rather than for floor, but weakly, is suspected only where floor was
 * free so short a time ago that something may have come to it; elsewhere it is mostly the edge of
 * what was seen from afar. */
static enum navigate_kind kind_of(int8_t value, double free_for_s)
{
    if (value > OCCUPIED_ABOVE) return NAVIGATE_OCCUPIED;
    if (value > SUSPECTED_ABOVE) return NAVIGATE_SUSPECTED;
    if (value > COME_ABOVE && free_for_s < come_s) return NAVIGATE_SUSPECTED;
    return value >= 0 && value < FREE_BELOW ? NAVIGATE_FREE : NAVIGATE_UNKNOWN;
}

void navigate_map(struct navigate *n, const int8_t *cells)
{
    for (int32_t i = 0; i < n->width * n->height; i++) {
        double *free_s = &n->free_s[navigate_field(n, i)];
        n->kind[i] = (uint8_t)kind_of(cells[i], n->now_s - *free_s);
        if (n->kind[i] == NAVIGATE_FREE) *free_s = n->now_s;
    }
    navigate_map_touches(n);
}
