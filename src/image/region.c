#include "image/region.h"

#include "base/elementary.h"

static const double density_least = 0.7; /* aligned pixels per pixel of the rectangle */

/* A region under way: its pixels are the first `count` of segments->region. */
struct growth {
    const struct fv_segments *segments;
    uint32_t count;
    double x, y;     /* sum of directions */
    double cosine;   /* of the largest difference from it */
    int64_t *visits; /* counted down */
};

static size_t index_of(const struct fv_segments *segments, struct fv_segment_pixel at)
{
    return (size_t)at.y * (size_t)segments->columns + (size_t)at.x;
}

static double length_of(struct fv_level_line line)
{
    return __builtin_sqrt((double)(line.x * line.x + line.y * line.y));
}

/* Whether a direction differs from the region's by no more than allowed: compared as cosines, whose
 * squares need no root. */
static bool is_aligned(const struct growth *g, struct fv_level_line line)
{
    const double dot = line.x * g->x + line.y * g->y,
                 limit = g->cosine * g->cosine * (double)(line.x * line.x + line.y * line.y) *
                         (g->x * g->x + g->y * g->y);
    if (g->cosine >= 0) return dot > 0 && dot * dot >= limit;
    return dot >= 0 || dot * dot <= limit;
}

static void add(struct growth *g, struct fv_segment_pixel at)
{
    const size_t i = index_of(g->segments, at);
    const struct fv_level_line line = g->segments->line[i];
    const double length = length_of(line);
    g->segments->used[i] = 1;
    g->segments->region[g->count++] = at;
    g->x += line.x / length;
    g->y += line.y / length;
}

/* The neighbours of one pixel of the region that belong to it too. */
static void add_neighbours(struct growth *g, struct fv_segment_pixel at)
{
    const struct fv_segments *s = g->segments;
    const int32_t left = at.x > 0 ? at.x - 1 : 0, top = at.y > 0 ? at.y - 1 : 0;
    const int32_t right = at.x + 1 < s->columns ? at.x + 1 : at.x,
                  bottom = at.y + 1 < s->rows ? at.y + 1 : at.y;
    for (int32_t y = top; y <= bottom; y++)
        for (int32_t x = left; x <= right && g->count < FV_REGION_MAX; x++) {
            const struct fv_segment_pixel near = {(int16_t)x, (int16_t)y};
            const size_t i = index_of(s, near);
            const struct fv_level_line line = s->line[i];
            if (s->used[i] || (line.x == 0 && line.y == 0) || !is_aligned(g, line)) continue;
            add(g, near);
        }
}

static void grow(struct growth *g, struct fv_segment_pixel seed, double cosine)
{
    g->count = 0;
    g->x = g->y = 0;
    g->cosine = cosine;
    add(g, seed);
    for (uint32_t i = 0; i < g->count; i++)
        add_neighbours(g, g->segments->region[i]);
    *g->visits -= 9 * (int64_t)g->count;
}

/* Direction of the least inertia, turned as the region's directions are. */
static void turn(const struct growth *g, struct fv_rectangle *r, double xx, double yy, double xy)
{
    const double least = 0.5 * (xx + yy - __builtin_sqrt((xx - yy) * (xx - yy) + 4 * xy * xy));
    double dx = xx > yy ? xy : least - yy, dy = xx > yy ? least - xx : xy;
    const double length = __builtin_sqrt(dx * dx + dy * dy);
    if (length > 0) {
        dx /= length;
        dy /= length;
    } else { /* as wide as long */
        dx = 1;
        dy = 0;
    }
    const bool turned = dx * g->x + dy * g->y < 0;
    r->dx = turned ? -dx : dx;
    r->dy = turned ? -dy : dy;
}

/* The rectangle that holds the region: around its centre, weighted by gradients. */
static void fit(const struct growth *g, struct fv_rectangle *r)
{
    const struct fv_segments *s = g->segments;
    double sum = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
    for (uint32_t i = 0; i < g->count; i++) {
        const double weight = length_of(s->line[index_of(s, s->region[i])]);
        sum += weight;
        x += weight * s->region[i].x;
        y += weight * s->region[i].y;
    }
    *r = (struct fv_rectangle){.x = x / sum, .y = y / sum};
    for (uint32_t i = 0; i < g->count; i++) {
        const double weight = length_of(s->line[index_of(s, s->region[i])]);
        const double rx = s->region[i].x - r->x, ry = s->region[i].y - r->y;
        xx += weight * ry * ry; /* inertia about the x axis */
        yy += weight * rx * rx;
        xy -= weight * rx * ry;
    }
    turn(g, r, xx, yy, xy);
    double low = 0, high = 0;
    for (uint32_t i = 0; i < g->count; i++) {
        const double rx = s->region[i].x - r->x, ry = s->region[i].y - r->y;
        const double along = rx * r->dx + ry * r->dy, across = ry * r->dx - rx * r->dy;
        r->begin = along < r->begin ? along : r->begin;
        r->end = along > r->end ? along : r->end;
        low = across < low ? across : low;
        high = across > high ? across : high;
    }
    r->width = high - low > 1 ? high - low : 1;
    *g->visits -= 3 * (int64_t)g->count;
}

static bool is_dense(const struct growth *g, const struct fv_rectangle *r)
{
    return g->count >= density_least * r->width * (r->end - r->begin);
}

static void release(const struct growth *g, uint32_t i)
{
    g->segments->used[index_of(g->segments, g->segments->region[i])] = 0;
}

static double squared_distance(struct fv_segment_pixel a, struct fv_segment_pixel b)
{
    const double dx = a.x - b.x, dy = a.y - b.y;
    return dx * dx + dy * dy;
}

/* Cosine of twice the deviation of directions from the seed's, of pixels as near as the rectangle
 * is wide. */
static double narrower(const struct growth *g, const struct fv_rectangle *r)
{
    const struct fv_segments *s = g->segments;
    const struct fv_level_line seed = s->line[index_of(s, s->region[0])];
    double sum = 0, squares = 0;
    int32_t near = 0;
    for (uint32_t i = 0; i < g->count; i++) {
        if (squared_distance(s->region[i], s->region[0]) >= r->width * r->width) continue;
        const struct fv_level_line line = s->line[index_of(s, s->region[i])];
        const double angle =
            fv_atan2(seed.x * line.y - seed.y * line.x, seed.x * line.x + seed.y * line.y);
        sum += angle;
        squares += angle * angle;
        near++;
    }
    const double mean = sum / near, variance = squares / near - mean * mean;
    return fv_cos(2 * __builtin_sqrt(variance > 0 ? variance : 0));
}

/* Leave out the pixels farthest from the seed until the rest fills its rectangle. */
static bool cut(struct growth *g, struct fv_rectangle *r)
{
    const struct fv_segments *s = g->segments;
    const struct fv_segment_pixel seed = s->region[0];
    double farthest = 0;
    for (uint32_t i = 0; i < g->count; i++) {
        const double squared = squared_distance(s->region[i], seed);
        farthest = squared > farthest ? squared : farthest;
    }
    while (!is_dense(g, r)) {
        uint32_t kept = 0;
        farthest *= 0.75 * 0.75;
        for (uint32_t i = 0; i < g->count; i++) {
            if (squared_distance(s->region[i], seed) > farthest)
                release(g, i);
            else
                s->region[kept++] = s->region[i];
        }
        g->count = kept;
        if (kept < 2) return false;
        fit(g, r);
    }
    return true;
}

bool fv_region_find(const struct fv_segments *segments, uint32_t seed, int64_t *visits,
                    struct fv_rectangle *rectangle)
{
    static const double cosine = 0.92387953251128674; /* of 22.5 degrees */
    const struct fv_segment_pixel at = {(int16_t)(seed % (uint32_t)segments->columns),
                                        (int16_t)(seed / (uint32_t)segments->columns)};
    struct growth g = {.segments = segments, .visits = visits};
    grow(&g, at, cosine);
    if (g.count < segments->region_least) return false;
    fit(&g, rectangle);
    if (is_dense(&g, rectangle)) return true;
    const double tighter = narrower(&g, rectangle);
    for (uint32_t i = 0; i < g.count; i++)
        release(&g, i);
    grow(&g, at, tighter);
    if (g.count < 2) return false;
    fit(&g, rectangle);
    return is_dense(&g, rectangle) || cut(&g, rectangle);
}
