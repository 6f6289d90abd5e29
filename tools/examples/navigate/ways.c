#include "ways.h"

#include <math.h>
#include <string.h>

#include "map.h"

static const double unit_m = 1e-6; /* of the search's costs: so much of free floor */
static const double never_s = -1e9;
static const double exit_m_most = 1e12; /* wherever the goal is */
static const double off_most = 1e-3;    /* cells that two grids of the same cells may lie apart */

static int32_t wrapped(int32_t k)
{
    return (k % DSTAR_SIDE + DSTAR_SIDE) % DSTAR_SIDE;
}

int32_t navigate_field(const struct navigate *n, int32_t cell)
{
    return wrapped(n->corner[1] + cell / n->width) * DSTAR_SIDE +
           wrapped(n->corner[0] + cell % n->width);
}

static int64_t cost_of(const struct navigate *n, int32_t cell)
{
    return n->ways.g[navigate_field(n, cell)];
}

/* ---- the window ------------------------------------------------------------------------------ */

/* Whether a grid of the same size has the same cells, but for `by` columns and rows. */
static bool goes_on(const struct navigate *n, double cell_m, const double origin[2], int32_t by[2])
{
    if (!n->begun || cell_m != n->cell_m) return false;
    for (int32_t axis = 0; axis < 2; axis++) {
        const double cells = (origin[axis] - n->origin[axis]) / cell_m;
        if (!(fabs(cells) < DSTAR_SIDE)) return false;
        by[axis] = (int32_t)lround(cells);
        if (fabs(cells - by[axis]) > off_most) return false;
    }
    return true;
}

/* Close and forget the cells that the window leaves. */
static void leave(struct navigate *n, const int32_t by[2])
{
    for (int32_t i = 0; i < n->width * n->height; i++) {
        const int32_t x = i % n->width - by[0], y = i / n->width - by[1];
        if (x >= 0 && y >= 0 && x < n->width && y < n->height) continue;
        dstar_change(&n->ways, navigate_field(n, i), DSTAR_CLOSED, DSTAR_NO_WAY);
        n->free_s[navigate_field(n, i)] = never_s;
    }
}

void navigate_ways_move(struct navigate *n, int32_t width, int32_t height, double cell_m,
                        const double origin[2])
{
    int32_t by[2] = {0, 0};
    const bool goes = width == n->width && height == n->height && goes_on(n, cell_m, origin, by);
    if (goes && (by[0] != 0 || by[1] != 0)) leave(n, by);
    n->width = width;
    n->height = height;
    n->cell_m = cell_m;
    for (int32_t axis = 0; axis < 2; axis++) {
        n->origin[axis] = origin[axis];
        n->corner[axis] = goes ? wrapped(n->corner[axis] + by[axis]) : 0;
    }
    if (goes) return;
    const int32_t middle = height / 2 * width + width / 2; /* where the robot should be */
    dstar_begin(&n->ways, navigate_field(n, middle), (int32_t)lround(cell_m / unit_m));
    for (int32_t i = 0; i < DSTAR_SIDE * DSTAR_SIDE; i++)
        n->free_s[i] = never_s;
    n->begun = true;
}

/* ---- the search ------------------------------------------------------------------------------ */

void navigate_ways_change(struct navigate *n)
{
    const int32_t goal = navigate_cell(n, n->goal[0], n->goal[1]);
    for (int32_t i = 0; i < n->width * n->height; i++) {
        const double exit_m = navigate_exit(n, i, goal);
        dstar_change(&n->ways, navigate_field(n, i),
                     (int32_t)(navigate_price(n, i) * n->cell_m / unit_m + 0.5),
                     exit_m < 0 ? DSTAR_NO_WAY : (int64_t)(fmin(exit_m, exit_m_most) / unit_m));
    }
}

/* The neighbour that is nearest to the goal; the cell itself where none is nearer. */
static int32_t step_down(const struct navigate *n, int32_t cell)
{
    int32_t best = cell;
    for (int32_t y = -1; y <= 1; y++)
        for (int32_t x = -1; x <= 1; x++) {
            const int32_t column = cell % n->width + x, row = cell / n->width + y;
            if (column < 0 || row < 0 || column >= n->width || row >= n->height) continue;
            const int32_t next = row * n->width + column;
            if (cost_of(n, next) < cost_of(n, best)) best = next;
        }
    return best;
}

/* What the straight line from a place to the middle of a cell costs; DSTAR_NO_WAY: it is closed. */
static double line_cost(const struct navigate *n, const double from[2], const double to[2])
{
    const double length = hypot(to[0] - from[0], to[1] - from[1]);
    const int32_t parts = (int32_t)ceil(2 * length / n->cell_m);
    double cost = 0;
    for (int32_t k = 0; k < parts; k++) {
        const double f = (k + 0.5) / parts;
        const int32_t cell =
            navigate_cell(n, from[0] + f * (to[0] - from[0]), from[1] + f * (to[1] - from[1]));
        const double price = cell < 0 ? 0 : navigate_price(n, cell);
        if (price <= 0) return (double)DSTAR_NO_WAY;
        cost += price * length / parts;
    }
    return cost / unit_m;
}

bool navigate_ways_ahead(struct navigate *n, const double position[2], double look_m, double far_m,
                         double to[2])
{
    const int32_t near = (int32_t)ceil(look_m / n->cell_m), far = (int32_t)ceil(far_m / n->cell_m);
    const int32_t first = navigate_cell(n, position[0], position[1]);
    if (first < 0 || dstar_find(&n->ways, navigate_field(n, first), far) >= DSTAR_NO_WAY)
        return false;
    int32_t cell = first;
    for (int32_t step = 1; step <= far; step++) {
        cell = step_down(n, cell);
        const double on[2] = {navigate_middle(n, cell, 0), navigate_middle(n, cell, 1)};
        const double way = (double)(cost_of(n, first) - cost_of(n, cell)) + 0.5 * n->ways.least;
        if (step > near && line_cost(n, position, on) > way) break;
        memcpy(to, on, sizeof on);
    }
    return true;
}
