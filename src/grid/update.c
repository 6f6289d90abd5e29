/* An update of the grid in pieces (grid.h): what the cells forget, and the evidence that they take;
 * and the grid's results. */
#include "grid/grid.h"

#include <string.h>

#include "base/elementary.h"
#include "grid/cells.h"

/* Log-odds in thousandths; OctoMap's limits: from -2 to 3.5. */
enum { HIT = FV_GRID_HIT, MISS = FV_GRID_MISS, LEAST = -2000, MOST = 3500 };
enum { TABLE_SIZE = MOST - LEAST + 1, TABLE_STEP = 10 };
enum { ONE = 65536 }; /* of what stays in a decay */

/* ---- set-up ---------------------------------------------------------------------------------- */

enum fovea_status fv_grid_check(const struct fovea_grid_config *c, struct fovea_error *error)
{
    const struct {
        const char *name;
        double value, least, most;
    } members[] = {{"resolution_m", c->resolution_m, 0.02, 1},
                   {"side_cells", c->side_cells, 16, 512},
                   {"range_m", c->range_m, 0.5, 100},
                   {"rays", c->rays, 16, 1440},
                   {"robot_radius_m", c->robot_radius_m, 0, 10},
                   {"half_life_s", c->half_life_s, 0.1, 10000},
                   {"movable_half_life_s", c->movable_half_life_s, 0.1, 10000},
                   {"floor_confidence", c->floor_confidence, 0, 1},
                   {"heights_max_m", c->heights_max_m, 0.1, 10}};
    for (size_t i = 0; i < sizeof members / sizeof *members; i++)
        if (!(members[i].value >= members[i].least && members[i].value <= members[i].most))
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "grid.%s: found %g, expected %g to %g", members[i].name,
                                   members[i].value, members[i].least, members[i].most);
    const double reach = 0.5 * c->side_cells * c->resolution_m;
    if (c->range_m > reach * (1 + 1e-9))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "grid.range_m: found %g, expected at most half the side, %g",
                               c->range_m, reach);
    return FOVEA_OK;
}

void fv_grid_carve(struct fv_grid *grid, const struct fovea_grid_config *config,
                   struct fv_arena *arena)
{
    const size_t cells = (size_t)config->side_cells * config->side_cells;
    grid->config = *config;
    grid->state = fv_arena_take(arena, 1, sizeof *grid->state);
    grid->odds = fv_arena_take(arena, cells, sizeof *grid->odds);
    grid->movable = fv_arena_take(arena, cells, 1);
    grid->marks = fv_arena_take(arena, cells, 1);
    grid->heights = config->heights ? fv_arena_take(arena, cells, sizeof *grid->heights) : NULL;
    grid->rays = fv_arena_take(arena, config->rays, sizeof *grid->rays);
    grid->percent = fv_arena_take(arena, TABLE_SIZE, 1);
}

static int32_t log_odds(double probability)
{
    return (int32_t)(1000 * fv_log(probability / (1 - probability)));
}

/* Of all log-odds, in steps of TABLE_STEP, which no percent is as fine as; of 0 nothing is known.
 */
static void fill_percent(int8_t *percent)
{
    int8_t here = 0;
    for (int i = 0; i < TABLE_SIZE; i++) {
        const int step = (i + TABLE_STEP / 2) / TABLE_STEP, odds = LEAST + step * TABLE_STEP;
        if (i == 0 || odds == LEAST + i + TABLE_STEP / 2)
            here = (int8_t)(100 / (1 + fv_exp(-0.001 * odds)) + 0.5);
        percent[i] = here;
    }
    percent[-LEAST] = FOVEA_GRID_UNKNOWN;
}

/* Filled when first used: carving takes memory and nothing else. */
static void make_tables(const struct fv_grid *g)
{
    const double turn = 6.283185307179586;
    if (g->state->made) return;
    for (uint32_t i = 0; i < g->config.rays; i++) {
        g->rays[i][0] = fv_cos(turn * i / g->config.rays);
        g->rays[i][1] = fv_sin(turn * i / g->config.rays);
    }
    fill_percent(g->percent);
    g->state->free_below = log_odds(FOVEA_GRID_FREE_BELOW);
    g->state->occupied_above = log_odds(FOVEA_GRID_OCCUPIED_ABOVE);
    g->state->made = 1;
}

/* ---- cells ----------------------------------------------------------------------------------- */

void fv_grid_forget(struct fv_grid *g)
{
    const size_t cells = (size_t)(fv_grid_side(g) * fv_grid_side(g));
    memset(g->odds, 0, cells * sizeof *g->odds);
    memset(g->movable, 0, cells);
    memset(g->marks, 0, cells);
    if (g->heights != NULL) memset(g->heights, 0, cells * sizeof *g->heights);
    g->state->begun = 0;
    g->state->phase = FV_GRID_IDLE;
    g->state->stamp_ns = 0;
}

static void clear(struct fv_grid *g, size_t from, size_t count)
{
    memset(g->odds + from, 0, count * sizeof *g->odds);
    memset(g->movable + from, 0, count);
    if (g->heights != NULL) memset(g->heights + from, 0, count * sizeof *g->heights);
}

/* `count` cells of a line of `side` that begins at `start`, from `first` on: what passes its end is
 * kept at its beginning. */
static void clear_wrapped(struct fv_grid *g, size_t start, int64_t first, int64_t count,
                          int64_t side)
{
    const int64_t at = (int64_t)fv_grid_wrapped(first, side),
                  whole = count < side - at ? count : side - at;
    clear(g, start + (size_t)at, (size_t)whole);
    clear(g, start, (size_t)(count - whole));
}

/* Follow the body along one axis: cells that come in are unknown. */
static void follow(struct fv_grid *g, int axis)
{
    const int64_t side = fv_grid_side(g), old = g->state->corner[axis],
                  corner =
                      fv_grid_whole(g->state->position_m[axis] / g->config.resolution_m) - side / 2;
    int64_t first = corner > old ? old + side : corner, last = corner > old ? corner + side : old;
    g->state->corner[axis] = corner;
    g->state->corner_kept[axis] = (int64_t)fv_grid_wrapped(corner, side);
    if (!g->state->begun) return;                  /* all are unknown */
    if (last - first >= side) first = last - side; /* of the old ones none stays */
    if (axis == 0)
        for (int64_t row = 0; row < side; row++)
            clear_wrapped(g, (size_t)(row * side), first, last - first, side);
    else
        for (int64_t line = first; line < last; line++)
            clear(g, fv_grid_wrapped(line, side) * (size_t)side, (size_t)side);
}

/* The parts that stay by now, in steps of a twentieth of the half-life: smaller ones would round
 * the log-odds away. */
static void begin_decay(struct fv_grid *g, int64_t stamp_ns)
{
    enum { PARTS = 20 };
    const int64_t least_ns = 100000000;
    const double half_life_s[2] = {g->config.half_life_s, g->config.movable_half_life_s};
    struct fv_grid_state *s = g->state;
    for (int k = 0; k < 2; k++) {
        const int64_t part_ns = (int64_t)(half_life_s[k] * 1e9 / PARTS),
                      step_ns = part_ns > least_ns ? part_ns : least_ns,
                      steps = (int64_t)(((uint64_t)stamp_ns - (uint64_t)s->decayed_ns[k]) /
                                        (uint64_t)step_ns);
        s->decayed_ns[k] += steps * step_ns;
        s->left[k] = (int32_t)(ONE * fv_exp(-0.6931471805599453 * (double)steps * (double)step_ns *
                                            1e-9 / half_life_s[k]) +
                               0.5);
    }
}

/* Whether GROUP bytes are all 0: most cells have no mark, and nothing that moves. */
enum { GROUP = 8 };
static bool are_zeros(const uint8_t *bytes)
{
    uint64_t group;
    memcpy(&group, bytes, GROUP);
    return group == 0;
}

/* A part of ONE changes nothing. */
static void decay(struct fv_grid *g, int64_t from, int64_t to)
{
    const int32_t *left = g->state->left;
    if (left[0] == ONE && left[1] == ONE) return;
    for (int64_t i = from; i < to; i++) {
        if (left[0] == ONE)
            while (i + GROUP <= to && are_zeros(g->movable + i))
                i += GROUP;
        if (i == to) return;
        if (g->heights != NULL)
            fv_grid_height_decay(&g->heights[i], g->movable[i] != 0 ? left[1] : left[0]);
        const int32_t product = g->odds[i] * (g->movable[i] != 0 ? left[1] : left[0]);
        g->odds[i] = (int16_t)((product + (product < 0 ? -ONE / 2 : ONE / 2)) / ONE);
    }
}

struct span {
    int64_t first, last; /* last exclusive */
};

/* Of the cells at most `reach` from one along an axis those of the grid. */
static struct span reached(const struct fv_grid *g, int axis, int64_t cell, int64_t reach)
{
    const int64_t first = g->state->corner[axis], last = first + fv_grid_side(g);
    return (struct span){cell - reach > first ? cell - reach : first,
                         cell + reach + 1 < last ? cell + reach + 1 : last};
}

static void stand(struct fv_grid *g)
{
    const double r = g->config.robot_radius_m, cell = g->config.resolution_m;
    const int64_t reach = (int64_t)(r / cell) + 1;
    const int64_t cx = fv_grid_whole(g->state->position_m[0] / cell),
                  cy = fv_grid_whole(g->state->position_m[1] / cell);
    const struct span rows = reached(g, 1, cy, reach), columns = reached(g, 0, cx, reach);
    for (int64_t y = rows.first; y < rows.last; y++) {
        for (int64_t x = columns.first; x < columns.last; x++) {
            const double dx = ((double)x + 0.5) * cell - g->state->position_m[0],
                         dy = ((double)y + 0.5) * cell - g->state->position_m[1];
            if (dx * dx + dy * dy <= r * r)
                fv_grid_mark(g, ((double)x + 0.5) * cell, ((double)y + 0.5) * cell,
                             FV_GRID_MARK_FREE);
        }
    }
}

/* Log-odds of a cell by one view more. What may move came just now to floor that was free: what was
 * known of that counts no more, as far as the view says that it is there. */
static int32_t updated(int32_t odds, uint8_t kind)
{
    if (kind == FV_GRID_MARK_FREE) return odds + MISS;
    const int32_t eighths = kind / 2, hit = HIT * eighths / FV_GRID_MARK_EIGHTHS;
    if (kind % 2 == 0 || odds > 0) return odds + hit;
    return odds * (FV_GRID_MARK_EIGHTHS - eighths) / FV_GRID_MARK_EIGHTHS + hit;
}

static void apply(struct fv_grid *g, int64_t from, int64_t to)
{
    for (int64_t i = from; i < to; i++) {
        while (i + GROUP <= to && are_zeros(g->marks + i))
            i += GROUP;
        if (i == to) return;
        const uint8_t kind = g->marks[i] & FV_GRID_MARK_KIND;
        g->marks[i] = FV_GRID_MARK_NONE;
        if (kind == FV_GRID_MARK_NONE) continue;
        const int32_t odds = updated(g->odds[i], kind);
        g->odds[i] = (int16_t)(odds < LEAST ? LEAST : odds > MOST ? MOST : odds);
        if (kind == FV_GRID_MARK_FREE && g->heights != NULL) fv_grid_height_floor(&g->heights[i]);
        if (kind != FV_GRID_MARK_FREE) g->movable[i] = kind % 2;
        if (kind == FV_GRID_MARK_FREE && g->odds[i] < 0) g->movable[i] = 0;
    }
}

static bool plain(double value)
{
    return value > -1e6 && value < 1e6;
}

/* Rows of a rotation, as near as float readings leave them. */
static bool is_rotation(const double T[12])
{
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++) {
            double dot = 0;
            for (int k = 0; k < 3; k++)
                dot += T[4 * a + k] * T[4 * b + k];
            const double off = dot - (a == b ? 1 : 0);
            if (!(off <= 1e-3 && off >= -1e-3)) return false;
        }
    return true;
}

/* There is a mask, and a camera above the floor. */
static bool shows_floor(const struct fovea_grid_view *view)
{
    const struct fovea_segmentation *s = view->seen;
    const double least_m = 0.01;
    return s != NULL && s->pixels != NULL && s->index != NULL && s->width > 0 && s->height > 0 &&
           view->T_odom_cam[11] -
                   fv_grid_floor_at(view, view->T_odom_cam[3], view->T_odom_cam[7]) >=
               least_m;
}

/* A plane that a robot may stand on. */
static bool is_floor(const struct fovea_grid_view *view)
{
    const double *slope = view->floor_slope, *C = view->floor_covariance;
    bool good = plain(view->floor_m) && slope[0] >= -1 && slope[0] <= 1 && slope[1] >= -1 &&
                slope[1] <= 1 && C[0] >= 0 && C[3] >= 0 && C[5] >= 0;
    for (int i = 0; i < 6; i++)
        good = good && plain(C[i]);
    return good;
}

static bool is_usable(const struct fv_grid *g, const struct fovea_grid_view *view)
{
    bool good = view->point_count <= FOVEA_GRID_POINTS_MAX &&
                (view->points != NULL || view->point_count == 0) && plain(view->position_m[0]) &&
                plain(view->position_m[1]) && plain(view->yaw_rad) && is_floor(view) &&
                view->stamp_ns >= 0 && (!g->state->begun || view->stamp_ns >= g->state->stamp_ns);
    for (int i = 0; i < 12; i++)
        good = good && plain(view->T_odom_cam[i]);
    return good && is_rotation(view->T_odom_cam) && shows_floor(view);
}

static uint32_t after_decay(const struct fovea_grid_view *view)
{
    return view->point_count > 0 ? FV_GRID_POINTS_TAKEN : FV_GRID_RAYS;
}

bool fv_grid_begin(struct fv_grid *g, const struct fovea_grid_view *view)
{
    struct fv_grid_state *s = g->state;
    if (!is_usable(g, view)) return false;
    make_tables(g);
    if (s->phase != FV_GRID_IDLE) memset(g->marks, 0, (size_t)(fv_grid_side(g) * fv_grid_side(g)));
    if (!s->begun) s->decayed_ns[0] = s->decayed_ns[1] = view->stamp_ns;
    s->stamp_ns = view->stamp_ns;
    s->position_m[0] = view->position_m[0];
    s->position_m[1] = view->position_m[1];
    s->yaw_rad = view->yaw_rad;
    follow(g, 0);
    follow(g, 1);
    s->begun = 1;
    begin_decay(g, view->stamp_ns);
    s->cell = 0;
    s->point = 0;
    s->ray = 0;
    s->step = -1;
    s->phase = s->left[0] == ONE && s->left[1] == ONE ? after_decay(view) : FV_GRID_DECAY;
    return true;
}

/* The next cells of a phase that goes over all; true: those are the last. */
static bool some_cells(struct fv_grid *g, int64_t *from, int64_t *to)
{
    const int64_t cells = fv_grid_side(g) * fv_grid_side(g);
    *from = g->state->cell;
    *to = cells - *from < FV_GRID_CELLS ? cells : *from + FV_GRID_CELLS;
    g->state->cell = *to < cells ? *to : 0;
    return *to == cells;
}

bool fv_grid_advance(struct fv_grid *g, const struct fovea_grid_view *view)
{
    struct fv_grid_state *s = g->state;
    int64_t from, to;
    bool last;
    switch (s->phase) {
    case FV_GRID_DECAY:
        last = some_cells(g, &from, &to);
        decay(g, from, to);
        if (last) s->phase = after_decay(view);
        return false;
    case FV_GRID_POINTS_TAKEN:
        s->point = fv_grid_take_points(g, view, s->point);
        if (s->point >= view->point_count) s->phase = FV_GRID_RAYS;
        return false;
    case FV_GRID_RAYS:
        if (!fv_grid_follow_rays(g, view)) return false;
        stand(g);
        s->phase = FV_GRID_APPLY;
        return false;
    case FV_GRID_APPLY:
        last = some_cells(g, &from, &to);
        apply(g, from, to);
        if (last) s->phase = FV_GRID_IDLE;
        return last;
    default:
        return true;
    }
}

/* ---- results --------------------------------------------------------------------------------- */

struct fovea_grid_place fv_grid_place(const struct fv_grid *g)
{
    const struct fv_grid_state *s = g->state;
    const uint32_t side = g->config.side_cells;
    return (struct fovea_grid_place){.stamp_ns = s->stamp_ns,
                                     .width = side,
                                     .height = side,
                                     .resolution_m = g->config.resolution_m,
                                     .origin_m = {(double)s->corner[0] * g->config.resolution_m,
                                                  (double)s->corner[1] * g->config.resolution_m}};
}

void fv_grid_rows(const struct fv_grid *g, int64_t row_first, int64_t row_count, int8_t *cells)
{
    const int64_t side = fv_grid_side(g), first = g->state->corner_kept[0];
    const int8_t *percent = g->percent - LEAST;
    make_tables(g);
    for (int64_t y = row_first; y < row_first + row_count; y++, cells += side) {
        const int16_t *odds = g->odds + fv_grid_kept(g, 0, y) - first; /* of the line */
        for (int64_t x = first; x < side; x++)
            cells[x - first] = percent[odds[x]];
        for (int64_t x = 0; x < first; x++)
            cells[side - first + x] = percent[odds[x]];
    }
}

void fv_grid_scan_begin(struct fv_grid *g)
{
    make_tables(g);
    g->state->scanned = 0;
}

static float range_of(const struct fv_grid *g, double dx, double dy, int32_t steps)
{
    const struct fv_grid_state *s = g->state;
    float range = s->begun ? __builtin_inff() : __builtin_nanf("");
    for (int32_t k = 0; k <= steps; k++) {
        const int64_t at =
            fv_grid_place_at(g, s->position_m[0] + dx * k, s->position_m[1] + dy * k);
        const int32_t odds = at < 0 ? 0 : g->odds[at];
        if (odds > s->occupied_above)
            return (float)(g->config.resolution_m / FV_GRID_RAY_STEPS * k);
        if (odds >= s->free_below) range = __builtin_nanf("");
    }
    return range;
}

bool fv_grid_scan_advance(struct fv_grid *g, float *ranges_m)
{
    struct fv_grid_state *s = g->state;
    const double step = g->config.resolution_m / FV_GRID_RAY_STEPS, cosine = fv_cos(s->yaw_rad),
                 sine = fv_sin(s->yaw_rad);
    const int32_t steps = fv_grid_steps(g), rays = (int32_t)g->config.rays;
    for (int32_t left = FV_GRID_SCAN_STEPS; s->scanned < rays && left > 0; left -= steps + 1) {
        const double *ray = g->rays[s->scanned];
        ranges_m[s->scanned++] = range_of(g, (cosine * ray[0] - sine * ray[1]) * step,
                                          (sine * ray[0] + cosine * ray[1]) * step, steps);
    }
    return s->scanned == rays;
}
