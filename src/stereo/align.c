/* A match refined along its curve, on the pixels of both images. */
#include "geometry/vec.h"
#include "stereo/stereo.h"

enum {
    SIDE = 8, /* of the patch, pixels of the feature's level */
    PIXELS = SIDE * SIDE,
    BORDERED = SIDE + 2,
    ONE = 1 << 16, /* a pixel, in fixed point */
    GREY = 1 << 3, /* a grey level of a sample: sums of 64 products fit 32 bits */
    STEPS_MAX = 5
};

static const double converged_px = 0.05; /* of the level: the next step would be far smaller */
static const double moved_max_px = 2;    /* from the match, likewise */
static const double agreement_min = 0.8; /* normalised cross-correlation */
/* What patches that are seen from two places differ by beside noise (slopes, edges in depth, the
 * pixels' own grid), as a standard deviation, pixels of the level; and the grey levels that count
 * as noise where two patches agree better by chance. */
static const double floor_px = 0.06, noise_grey = 1;

/* Grey at a place of a level (fixed point), in 1/GREY. */
static inline int32_t sample(const struct fv_plane *level, int32_t x, int32_t y)
{
    const uint8_t *p = level->pixels + (y >> 16) * level->stride + (x >> 16);
    const int32_t u = (x >> 8) & 255, v = (y >> 8) & 255;
    const int32_t above = (256 - u) * p[0] + u * p[1],
                  below = (256 - u) * p[level->stride] + u * p[level->stride + 1];
    return ((256 - v) * above + v * below) >> 13;
}

/* A grid of SIDE x SIDE places around (x, y), pixels of the level; rows and columns by `warp`. */
struct grid {
    int32_t x, y;           /* of the first */
    int32_t xx, xy, yx, yy; /* to the next column, and to the next row */
};

static int32_t fixed(double value)
{
    return (int32_t)(value * ONE);
}

/* False: it leaves the level. */
static bool place_grid(const struct fv_plane *level, const double at[2], const double warp[4],
                       int side, struct grid *g)
{
    const double half = 0.5 * (side - 1);
    const double reach_x = half * (fv_abs(warp[0]) + fv_abs(warp[1])) + 1,
                 reach_y = half * (fv_abs(warp[2]) + fv_abs(warp[3])) + 1;
    if (!(at[0] - reach_x >= 0 && at[1] - reach_y >= 0 && at[0] + reach_x < level->width - 1 &&
          at[1] + reach_y < level->height - 1))
        return false;
    g->xx = fixed(warp[0]);
    g->yx = fixed(warp[1]);
    g->xy = fixed(warp[2]);
    g->yy = fixed(warp[3]);
    g->x = fixed(at[0]) - (g->xx + g->yx) * (side - 1) / 2;
    g->y = fixed(at[1]) - (g->xy + g->yy) * (side - 1) / 2;
    return true;
}

static void sample_grid(const struct fv_plane *level, const struct grid *g, int side, int16_t *out)
{
    for (int r = 0; r < side; r++)
        for (int c = 0; c < side; c++)
            *out++ =
                (int16_t)sample(level, g->x + c * g->xx + r * g->yx, g->y + c * g->xy + r * g->yy);
}

static int32_t sum_of(const int16_t *a)
{
    int32_t sum = 0;
    for (int i = 0; i < PIXELS; i++)
        sum += a[i];
    return sum;
}

/* Sum of products of deviations from the means, times PIXELS. */
static int64_t product(const int16_t *a, int32_t sum_a, const int16_t *b, int32_t sum_b)
{
    int32_t sum = 0;
    for (int i = 0; i < PIXELS; i++)
        sum += a[i] * b[i];
    return (int64_t)sum * PIXELS - (int64_t)sum_a * sum_b;
}

/* The patch of the first image: greys, and twice their slopes along x and y. */
struct patch {
    int16_t grey[PIXELS], x[PIXELS], y[PIXELS];
    int32_t sum;
    int64_t square;
};

static bool take_patch(const struct fv_plane *level, const double at[2], struct patch *p)
{
    static const double straight[4] = {1, 0, 0, 1};
    int16_t around[BORDERED * BORDERED];
    struct grid g;
    if (!place_grid(level, at, straight, BORDERED, &g)) return false;
    sample_grid(level, &g, BORDERED, around);
    for (int r = 0; r < SIDE; r++)
        for (int c = 0; c < SIDE; c++) {
            const int16_t *a = around + (r + 1) * BORDERED + c + 1;
            const int i = r * SIDE + c;
            p->grey[i] = a[0];
            p->x[i] = (int16_t)(a[1] - a[-1]);
            p->y[i] = (int16_t)(a[BORDERED] - a[-BORDERED]);
        }
    p->sum = sum_of(p->grey);
    p->square = product(p->grey, p->sum, p->grey, p->sum);
    return p->square > 0;
}

static double to_level(double raw_px, double scale)
{
    return (raw_px + 0.5) / scale - 0.5;
}

/* d(pixel of the second)/d(pixel of the first), both raw, of a surface across the ray. */
static void warp_of(const struct fv_stereo *s, const struct fv_ray *ray,
                    const struct fv_stereo_place *place, double warp[4])
{
    const double *A = ray->A;
    const double a = fv_dot3(A, A), b = fv_dot3(A, A + 3), d = fv_dot3(A + 3, A + 3),
                 determinant = a * d - b * b;
    /* Columns of A^T (A A^T)^-1: how the bearing moves with the pixel. */
    for (int column = 0; column < 2; column++) {
        double step[3], turned[3];
        for (int k = 0; k < 3; k++)
            step[k] =
                (column == 0 ? d * A[k] - b * A[3 + k] : a * A[3 + k] - b * A[k]) / determinant;
        fv_stereo_turn(s, step, turned);
        warp[column] = fv_dot3(place->J, turned);
        warp[2 + column] = fv_dot3(place->J + 3, turned);
    }
}

/* Level of the second image in which the patch keeps its size best. */
static uint32_t matching_level(const struct fv_pyramid *pyramid, const double warp[4], double scale)
{
    const double size = fv_abs(warp[0] * warp[3] - warp[1] * warp[2]) * scale * scale;
    uint32_t level = 0;
    while (level + 1 < pyramid->levels) {
        const double next = (double)fv_pyramid_scale(level + 1),
                     now = (double)fv_pyramid_scale(level);
        if (!(size > now * next)) break; /* areas: half a level is the geometric mean */
        level++;
    }
    return level;
}

/* Slopes of the patch along the curve, per pixel of it in the second image's level. */
static bool slopes_along(const struct patch *p, const double warp[4], const double way[2],
                         int16_t *slope)
{
    const double determinant = warp[0] * warp[3] - warp[1] * warp[2];
    if (!(fv_abs(determinant) > 0.05)) return false;
    /* Direction in the patch, 8 bits of fraction; greys are doubled slopes. */
    const double x = (warp[3] * way[0] - warp[1] * way[1]) / determinant,
                 y = (warp[0] * way[1] - warp[2] * way[0]) / determinant;
    if (!(fv_abs(x) + fv_abs(y) < 2.4)) return false; /* so that sums of products fit */
    const int32_t u = (int32_t)(x * 128), v = (int32_t)(y * 128);
    for (int i = 0; i < PIXELS; i++)
        slope[i] = (int16_t)((u * p->x[i] + v * p->y[i]) >> 8);
    return true;
}

struct alignment {
    double step_px;   /* along the curve, pixels of the level */
    double sigma_px;  /* of the place, likewise */
    double agreement; /* normalised cross-correlation */
};

static bool compare(const struct patch *p, const int16_t *slope, const int16_t *seen,
                    struct alignment *out)
{
    const int32_t sum = sum_of(seen), sum_slope = sum_of(slope);
    const int64_t square = product(seen, sum, seen, sum),
                  cross = product(p->grey, p->sum, seen, sum),
                  steep = product(slope, sum_slope, slope, sum_slope);
    if (square <= 0 || cross <= 0 || steep <= 0) return false;
    const double gain = (double)cross / (double)p->square;
    /* Slope against what is left: seen - gain grey. */
    const double pull = (double)product(slope, sum_slope, seen, sum) -
                        gain * (double)product(slope, sum_slope, p->grey, p->sum);
    out->step_px = -pull / (gain * (double)steep);
    out->agreement =
        (double)cross / (__builtin_sqrt((double)p->square) * __builtin_sqrt((double)square));
    double left = ((double)square - gain * (double)cross) / ((double)PIXELS * (PIXELS - 3)),
           least = noise_grey * GREY * noise_grey * GREY;
    if (left < least) left = least;
    out->sigma_px = __builtin_sqrt(left * PIXELS / (gain * gain * (double)steep));
    return true;
}

bool fv_stereo_align(const struct fv_stereo *s, const struct fv_stereo_view view[FV_STEREO_CAMERAS],
                     uint32_t feature, uint32_t other, struct fv_inverse_distance *measured)
{
    const struct fovea_feature *f = &view[0].features[feature];
    const struct fv_ray *ray = &s->ray[feature];
    const double scale = (double)fv_pyramid_scale(f->level);
    const double at[2] = {to_level((double)f->x_px, scale), to_level((double)f->y_px, scale)};
    struct patch patch;
    struct fv_stereo_place place;
    struct alignment now = {0};
    double turned[3], warp[4], way[2], moved = 0;
    int16_t slope[PIXELS], seen[PIXELS];
    fv_stereo_turn(s, ray->bearing, turned);
    double value = fv_stereo_intersect(s, turned, s->bearing[other]);
    if (!fv_stereo_project(s, turned, value, &place) ||
        !take_patch(fv_pyramid_level(view[0].pyramid, f->level), at, &patch))
        return false;
    warp_of(s, ray, &place, warp);
    const uint32_t level = matching_level(view[1].pyramid, warp, scale);
    const double there = (double)fv_pyramid_scale(level);
    const struct fv_plane *image = fv_pyramid_level(view[1].pyramid, level);
    for (int i = 0; i < 4; i++)
        warp[i] *= scale / there;
    double rate = __builtin_sqrt(place.along[0] * place.along[0] + place.along[1] * place.along[1]);
    if (!(rate > 1e-6)) return false;
    way[0] = place.along[0] / rate;
    way[1] = place.along[1] / rate;
    if (!slopes_along(&patch, warp, way, slope)) return false;
    for (int step = 0; step < STEPS_MAX; step++) {
        const double centre[2] = {to_level(place.pixel[0], there), to_level(place.pixel[1], there)};
        struct grid g;
        if (!place_grid(image, centre, warp, SIDE, &g)) return false;
        sample_grid(image, &g, SIDE, seen);
        if (!compare(&patch, slope, seen, &now)) return false;
        moved += now.step_px;
        if (fv_abs(moved) > moved_max_px) return false;
        value += now.step_px * there / rate;
        if (fv_abs(now.step_px) < converged_px) break;
        if (!fv_stereo_project(s, turned, value, &place)) return false;
        rate = __builtin_sqrt(place.along[0] * place.along[0] + place.along[1] * place.along[1]);
        if (!(rate > 1e-6)) return false;
    }
    if (now.agreement < agreement_min || fv_abs(now.step_px) > 0.2) return false;
    const double sigma =
        __builtin_sqrt(now.sigma_px * now.sigma_px + floor_px * floor_px) * there / rate;
    measured->value = (float)value;
    measured->weight = (float)(1 / (sigma * sigma));
    return true;
}
