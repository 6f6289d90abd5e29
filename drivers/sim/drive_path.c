#include "drive.h"

#include <stdlib.h>
#include <string.h>

/* Paths through the hall, on cells: which are clear, the cheapest way over them, and its corners
 * rounded. */

static const double cell_m = 0.1;
/* Between the middles of two neighbours a gap is at most half a diagonal smaller than at both. */
static const double clear_m = 0.5 * FV_SIM_DRIVE_WAY_M + 0.0708;
static const double wide_m = 0.8; /* the path prefers gaps up to this */

struct fv_sim_drive_search {
    double half[2];
    int32_t width, height, start, goal;
    float *gap;      /* of each cell's middle */
    float *cost;     /* of the way from the start */
    int32_t *before; /* the cell that the way comes from */
    int32_t *queue;  /* a heap by cost, or a list */
    int32_t *place;  /* of a cell in the heap; -1: not in it */
    int32_t queued;
    const struct fv_sim_block *more;
};

double fv_sim_block_distance(const struct fv_sim_block *block, double x, double y)
{
    const double dx = x - block->center[0], dy = y - block->center[1];
    if (block->radius > 0) return __builtin_sqrt(dx * dx + dy * dy) - block->radius;
    const double along = block->cosine * dx + block->sine * dy,
                 across = block->cosine * dy - block->sine * dx;
    const double a = __builtin_fabs(along) - block->half[0],
                 b = __builtin_fabs(across) - block->half[1];
    if (a <= 0 && b <= 0) return a > b ? a : b;
    const double out = a > 0 ? a : 0, aside = b > 0 ? b : 0;
    return __builtin_sqrt(out * out + aside * aside);
}

static double wall_distance(const double half[2], double x, double y)
{
    const double a = half[0] - __builtin_fabs(x), b = half[1] - __builtin_fabs(y);
    return a < b ? a : b;
}

double fv_sim_drive_gap(const struct fv_sim_drive *drive, const double point[2], double radius_m)
{
    double least = wall_distance(drive->half, point[0], point[1]);
    for (int32_t i = 0; i < drive->block_count; i++) {
        const double here = fv_sim_block_distance(&drive->block[i], point[0], point[1]);
        least = here < least ? here : least;
    }
    return least - radius_m;
}

/* ---- cells ----------------------------------------------------------------------------------- */

static void middle(const struct fv_sim_drive_search *s, int32_t cell, double point[2])
{
    point[0] = (cell % s->width + 0.5) * cell_m - s->half[0];
    point[1] = (int32_t)(cell / s->width) * cell_m + 0.5 * cell_m - s->half[1];
}

static int32_t cell_at(const struct fv_sim_drive_search *s, const double point[2])
{
    const int32_t x = (int32_t)((point[0] + s->half[0]) / cell_m),
                  y = (int32_t)((point[1] + s->half[1]) / cell_m);
    return y * s->width + x;
}

struct fv_sim_drive_search *fv_sim_drive_search_open(const struct fv_sim_drive *drive)
{
    struct fv_sim_drive_search *s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    memcpy(s->half, drive->half, sizeof s->half);
    s->width = (int32_t)(2 * s->half[0] / cell_m);
    s->height = (int32_t)(2 * s->half[1] / cell_m);
    const size_t cells = (size_t)s->width * (size_t)s->height;
    s->gap = malloc(cells * sizeof *s->gap);
    s->cost = malloc(cells * sizeof *s->cost);
    s->before = malloc(cells * sizeof *s->before);
    s->queue = malloc(cells * sizeof *s->queue);
    s->place = malloc(cells * sizeof *s->place);
    if (!s->gap || !s->cost || !s->before || !s->queue || !s->place) {
        fv_sim_drive_search_close(s);
        return NULL;
    }
    for (size_t i = 0; i < cells; i++) {
        double point[2];
        middle(s, (int32_t)i, point);
        s->gap[i] = (float)fv_sim_drive_gap(drive, point, 0);
    }
    s->start = cell_at(s, drive->start);
    s->goal = cell_at(s, drive->goal);
    return s;
}

void fv_sim_drive_search_close(struct fv_sim_drive_search *s)
{
    if (s == NULL) return;
    free(s->gap);
    free(s->cost);
    free(s->before);
    free(s->queue);
    free(s->place);
    free(s);
}

void fv_sim_drive_search_add(struct fv_sim_drive_search *s, const struct fv_sim_block *block)
{
    for (int32_t i = 0; i < s->width * s->height; i++) {
        double point[2];
        middle(s, i, point);
        const float here = (float)fv_sim_block_distance(block, point[0], point[1]);
        s->gap[i] = here < s->gap[i] ? here : s->gap[i];
    }
}

static bool is_clear(const struct fv_sim_drive_search *s, int32_t cell)
{
    double point[2];
    if ((double)s->gap[cell] < clear_m) return false;
    if (s->more == NULL) return true;
    middle(s, cell, point);
    return fv_sim_block_distance(s->more, point[0], point[1]) >= clear_m;
}

/* The k-th of eight neighbours; -1: there is none. */
static int32_t neighbour(const struct fv_sim_drive_search *s, int32_t cell, int32_t k)
{
    static const int32_t dx[8] = {1, 0, -1, 0, 1, -1, -1, 1}, dy[8] = {0, 1, 0, -1, 1, 1, -1, -1};
    const int32_t x = cell % s->width + dx[k], y = cell / s->width + dy[k];
    return x < 0 || y < 0 || x >= s->width || y >= s->height ? -1 : y * s->width + x;
}

bool fv_sim_drive_has_way(struct fv_sim_drive_search *s, const struct fv_sim_block *more)
{
    int32_t *seen = s->before, read = 0, count = 0;
    s->more = more;
    memset(seen, 0, (size_t)s->width * (size_t)s->height * sizeof *seen);
    if (is_clear(s, s->start)) s->queue[count++] = s->start;
    seen[s->start] = 1;
    while (read < count && seen[s->goal] == 0) {
        const int32_t cell = s->queue[read++];
        for (int32_t k = 0; k < 8; k++) {
            const int32_t next = neighbour(s, cell, k);
            if (next < 0 || seen[next] != 0 || !is_clear(s, next)) continue;
            seen[next] = 1;
            s->queue[count++] = next;
        }
    }
    s->more = NULL;
    return seen[s->goal] != 0 && count > 0;
}

/* ---- the cheapest way ------------------------------------------------------------------------ */

static void put(struct fv_sim_drive_search *s, int32_t at, int32_t cell)
{
    s->queue[at] = cell;
    s->place[cell] = at;
}

/* Move a cell that became cheaper, or is new, up the heap. */
static void rise(struct fv_sim_drive_search *s, int32_t at, int32_t cell)
{
    while (at > 0 && s->cost[s->queue[(at - 1) / 2]] > s->cost[cell]) {
        put(s, at, s->queue[(at - 1) / 2]);
        at = (at - 1) / 2;
    }
    put(s, at, cell);
}

static int32_t take_cheapest(struct fv_sim_drive_search *s)
{
    const int32_t cheapest = s->queue[0], cell = s->queue[--s->queued];
    int32_t at = 0;
    s->place[cheapest] = -1;
    while (2 * at + 1 < s->queued) {
        int32_t child = 2 * at + 1;
        if (child + 1 < s->queued && s->cost[s->queue[child + 1]] < s->cost[s->queue[child]])
            child++;
        if (s->cost[s->queue[child]] >= s->cost[cell]) break;
        put(s, at, s->queue[child]);
        at = child;
    }
    if (s->queued > 0) put(s, at, cell);
    return cheapest;
}

static float step_cost(const struct fv_sim_drive_search *s, int32_t cell, int32_t k, bool wide)
{
    const double length = k < 4 ? cell_m : 1.4142135623730951 * cell_m, gap = (double)s->gap[cell];
    return (float)(wide && gap < wide_m ? length * (1 + 4 * (wide_m - gap)) : length);
}

/* Dijkstra's, from the start to the goal. */
static void search(struct fv_sim_drive_search *s, bool wide)
{
    for (int32_t i = 0; i < s->width * s->height; i++) {
        s->cost[i] = 1e9f;
        s->place[i] = -1;
    }
    s->queued = 1;
    s->cost[s->start] = 0;
    s->before[s->start] = -1;
    put(s, 0, s->start);
    while (s->queued > 0) {
        const int32_t cell = take_cheapest(s);
        if (cell == s->goal) return;
        for (int32_t k = 0; k < 8; k++) {
            const int32_t next = neighbour(s, cell, k);
            if (next < 0 || !is_clear(s, next)) continue;
            const float cost = s->cost[cell] + step_cost(s, next, k, wide);
            if (cost >= s->cost[next]) continue;
            s->cost[next] = cost;
            s->before[next] = cell;
            rise(s, s->place[next] < 0 ? s->queued++ : s->place[next], next);
        }
    }
}

/* The way's points from start to goal, with its corners rounded: it moves by less than a cell. */
static int32_t way_of(const struct fv_sim_drive_search *s, double (*way)[2])
{
    int32_t count = 0;
    for (int32_t cell = s->goal; cell >= 0; cell = s->before[cell])
        count++;
    if (count > FV_SIM_DRIVE_PATH_MAX) count = FV_SIM_DRIVE_PATH_MAX;
    for (int32_t cell = s->goal, i = count - 1; cell >= 0 && i >= 0; cell = s->before[cell], i--)
        middle(s, cell, way[i]);
    for (int32_t round = 0; round < 24; round++) {
        double last[2] = {way[0][0], way[0][1]};
        for (int32_t i = 1; i + 1 < count; i++) {
            for (int32_t k = 0; k < 2; k++) {
                const double here = way[i][k];
                way[i][k] = 0.25 * last[k] + 0.5 * here + 0.25 * way[i + 1][k];
                last[k] = here;
            }
        }
    }
    return count;
}

static double length_of(double (*way)[2], int32_t count)
{
    double sum = 0;
    for (int32_t i = 1; i < count; i++) {
        const double dx = way[i][0] - way[i - 1][0], dy = way[i][1] - way[i - 1][1];
        sum += __builtin_sqrt(dx * dx + dy * dy);
    }
    return sum;
}

void fv_sim_drive_plan(struct fv_sim_drive_search *s, struct fv_sim_drive *drive)
{
    search(s, false);
    drive->path_count = way_of(s, drive->path);
    drive->shortest_m = length_of(drive->path, drive->path_count);
    search(s, true);
    drive->path_count = way_of(s, drive->path);
    memcpy(drive->goal, drive->path[drive->path_count - 1], sizeof drive->goal);
}
