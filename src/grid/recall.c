#include "grid/recall.h"

#include <string.h>

#include "grid/cells.h"

enum { FREE = 2 * FV_GRID_MISS, OCCUPIED = FV_GRID_HIT };
enum { SAMPLES_MAX = 4 };
static const double height_max_m = 0.3, upright_min = 0.96;

void fv_grid_recall_carve(struct fv_grid_recall *recall, const struct fovea_grid_config *config,
                          struct fv_arena *arena)
{
    recall->side_max = config->side_cells;
    recall->state = fv_arena_take(arena, 1, sizeof *recall->state);
    recall->percent = fv_arena_take(arena, (size_t)config->side_cells * config->side_cells, 1);
}

void fv_grid_recall_keep(struct fv_grid_recall *recall, uint32_t side, double resolution_m,
                         const int8_t *percent)
{
    const size_t bytes = (size_t)side * side;
    *recall->state = (struct fv_grid_recall_state){.side = side, .resolution_m = resolution_m};
    if (side > 0 && percent != recall->percent) memcpy(recall->percent, percent, bytes);
    memset(recall->percent + bytes, 0, (size_t)recall->side_max * recall->side_max - bytes);
}

void fv_grid_recall_forget(struct fv_grid_recall *recall)
{
    recall->state->busy = recall->state->any_offered = 0;
}

/* ---- what is kept ---------------------------------------------------------------------------- */

/* Never more than was kept. */
static int32_t evidence_of(int8_t percent)
{
    static const int16_t low[] = {-754, -708, -663}, high[] = {663, 708, 754, 800};
    if (percent < 0) return 0;
    if (percent < 50) return percent < 32 ? FREE : low[percent - 32];
    return percent > 69 ? OCCUPIED : high[percent - 66];
}

/* At a point of the odometry frame, in its cells. */
static int32_t kept_at(const struct fv_grid_recall *recall, double x, double y)
{
    const struct fv_grid_recall_state *s = recall->state;
    double at[3];
    for (int i = 0; i < 3; i++)
        at[i] = s->along[i][0] * x + s->along[i][1] * y + s->along[i][2];
    if (!(at[0] >= 0 && at[0] < s->side && at[1] >= 0 && at[1] < s->side)) return 0;
    if (at[2] > height_max_m || at[2] < -height_max_m) return 0;
    return evidence_of(recall->percent[(int64_t)at[1] * s->side + (int64_t)at[0]]);
}

/* Of a whole cell: the nearest obstacle in it; floor only where nothing else is. */
static int32_t kept_in(const struct fv_grid_recall *recall, int64_t x, int64_t y)
{
    const int32_t n = recall->state->samples;
    int32_t most = 0, least = 0;
    bool all = true;
    for (int32_t i = 0; i < n * n; i++) {
        const int32_t column = i % n, row = i / n;
        const int32_t found =
            kept_at(recall, (double)x + (column + 0.5) / n, (double)y + (row + 0.5) / n);
        most = found > most ? found : most;
        least = found < least ? found : least;
        all = all && found != 0;
    }
    return most > 0 ? most : all ? least : 0;
}

/* ---- offering it ----------------------------------------------------------------------------- */

bool fv_grid_recall_begin(struct fv_grid_recall *recall, const struct fv_grid *grid,
                          const double P[12], double floor_m)
{
    struct fv_grid_recall_state *s = recall->state;
    const int64_t *corner = grid->state->corner;
    s->busy = 0;
    if (s->side == 0 || !grid->state->begun) return false;
    if (s->any_offered && s->offered[0] == corner[0] && s->offered[1] == corner[1]) return false;
    const double cell = grid->config.resolution_m,
                 scale = __builtin_sqrt(P[8] * P[8] + P[9] * P[9] + P[10] * P[10]),
                 ratio = cell * scale / s->resolution_m;
    if (!(P[10] > upright_min * scale) || !(ratio <= SAMPLES_MAX + 0.05)) return false;
    s->samples = 1;
    while (s->samples + 0.05 < ratio)
        s->samples++;
    for (int i = 0; i < 3; i++) {
        const double unit = i < 2 ? 1 / s->resolution_m : 1;
        s->along[i][0] = P[4 * i] * cell * unit;
        s->along[i][1] = P[4 * i + 1] * cell * unit;
        s->along[i][2] = (P[4 * i + 2] * floor_m + P[4 * i + 3]) * unit;
    }
    s->row = 0;
    s->busy = 1;
    return true;
}

static void offer(const struct fv_grid_recall *recall, struct fv_grid *grid, int64_t column,
                  int64_t row)
{
    const int64_t at = fv_grid_kept(grid, column, row);
    const struct fv_grid_state *g = grid->state;
    if (grid->odds[at] < g->free_below || grid->odds[at] > g->occupied_above) return;
    const int32_t kept = kept_in(recall, column + g->corner[0], row + g->corner[1]);
    if (kept == 0) return;
    grid->odds[at] = (int16_t)(grid->odds[at] + kept);
    grid->movable[at] = 0;
}

/* Cells of a row that the grid had before, and were offered theirs then: from *first up to *end. */
static void offered_part(const struct fv_grid_recall_state *s, const struct fv_grid *grid,
                         int64_t row, int64_t *first, int64_t *end)
{
    const int64_t side = grid->config.side_cells, *corner = grid->state->corner,
                  line = corner[1] + row - s->offered[1], from = s->offered[0] - corner[0];
    *first = *end = side;
    if (!s->any_offered || line < 0 || line >= side || from >= side || from <= -side) return;
    *first = from > 0 ? from : 0;
    *end = from > 0 ? side : from + side;
}

bool fv_grid_recall_advance(struct fv_grid_recall *recall, struct fv_grid *grid)
{
    struct fv_grid_recall_state *s = recall->state;
    const int64_t side = grid->config.side_cells, samples = (int64_t)s->samples * s->samples;
    for (int64_t left = FV_GRID_RECALL_SAMPLES; s->busy && s->row < side && left > 0; s->row++) {
        int64_t first, end;
        offered_part(s, grid, s->row, &first, &end);
        for (int64_t column = 0; column < first; column++)
            offer(recall, grid, column, s->row);
        for (int64_t column = end; column < side; column++)
            offer(recall, grid, column, s->row);
        left -= (side - (end - first)) * samples + samples;
    }
    if (s->busy && s->row < side) return false;
    s->busy = 0;
    s->any_offered = 1;
    s->offered[0] = grid->state->corner[0];
    s->offered[1] = grid->state->corner[1];
    return true;
}

/* ---- saving ---------------------------------------------------------------------------------- */

static bool is_known(int8_t percent)
{
    return percent >= 0 &&
           (percent < 100 * FOVEA_GRID_FREE_BELOW || percent > 100 * FOVEA_GRID_OCCUPIED_ABOVE);
}

bool fv_grid_recall_any(const struct fv_grid *grid)
{
    const size_t side = grid->config.side_cells;
    const int32_t low = grid->state->free_below, high = grid->state->occupied_above;
    int32_t any = 0;
    for (size_t row = 0; row < side && !any; row++)
        for (size_t i = row * side; i < (row + 1) * side; i++)
            any |= ((grid->odds[i] < low) | (grid->odds[i] > high)) & (grid->movable[i] == 0);
    return any != 0;
}

void fv_grid_recall_rows(const struct fv_grid *grid, const int64_t corner[2], int64_t row_first,
                         int64_t row_count, int8_t *cells)
{
    const int64_t side = grid->config.side_cells, right = corner[0] - grid->state->corner[0],
                  up = corner[1] - grid->state->corner[1];
    for (int64_t row = row_first; row < row_first + row_count; row++, cells += side) {
        memset(cells, FOVEA_GRID_UNKNOWN, (size_t)side);
        if (row + up < 0 || row + up >= side) continue;
        int8_t now[512];
        fv_grid_rows(grid, row + up, 1, now);
        for (int64_t column = 0; column < side; column++) {
            const int64_t at = column + right;
            if (at >= 0 && at < side && is_known(now[at]) &&
                !grid->movable[fv_grid_kept(grid, at, row + up)])
                cells[column] = now[at];
        }
    }
}
