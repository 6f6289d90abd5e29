/* Matches by descriptor along epipolar planes. */
#include <string.h>

#include "geometry/vec.h"
#include "stereo/stereo.h"

enum {
    DISTANCE_MAX = 64, /* Hamming, of two features that are the same point */
    LEVELS_APART = 1   /* of the level that the cameras' focal lengths make likely */
};

static const double off_px = 2;      /* of the plane, times the level's scale */
static const double same_px = 3;     /* along the curve: nearer candidates are one place */
static const double ratio_max = 0.9; /* D. Lowe, 2004 */
/* Sine of the angle to the baseline below which a ray is left out: it hardly moves with distance.
 */
static const double sine_min = 0.1;
static const double nearest_baselines = 1.5; /* of the centre: no thing is nearer */

/* Angle around the baseline, [0, 4): 2 is ahead. It grows with the angle at a rate of 1/2 to 1
 * (of the square |x| + |y| = 1 in place of the circle). 0 along the baseline itself. */
static double angle_of(const struct fv_stereo *s, const double b[3])
{
    const double x = fv_dot3(b, s->ahead), y = fv_dot3(b, s->aside), sum = fv_abs(x) + fv_abs(y);
    if (!(sum > 0)) return 0;
    const double side = y / sum; /* -1 to 1 */
    return x > 0 ? 2 + side : (y > 0 ? 4 - side : -side);
}

static uint32_t bin_of(double angle)
{
    const int32_t bin = (int32_t)(angle * (0.25 * FV_STEREO_BINS));
    return (uint32_t)bin & (FV_STEREO_BINS - 1);
}

void fv_stereo_sort(struct fv_stereo *s, const struct fv_stereo_view *view)
{
    memset(s->first, 0, (FV_STEREO_BINS + 1) * sizeof *s->first);
    for (uint32_t f = 0; f < view->count; f++) {
        const double b[3] = {(double)s->bearing[f][0], (double)s->bearing[f][1],
                             (double)s->bearing[f][2]};
        s->bin_of[f] = (uint16_t)bin_of(angle_of(s, b));
        s->first[s->bin_of[f] + 1]++;
    }
    for (uint32_t b = 0; b < FV_STEREO_BINS; b++)
        s->first[b + 1] = (uint16_t)(s->first[b + 1] + s->first[b]);
    for (uint32_t f = 0; f < view->count; f++) /* bins move on to their ends */
        s->order[s->first[s->bin_of[f]]++] = (uint16_t)f;
    for (uint32_t b = FV_STEREO_BINS; b > 0; b--)
        s->first[b] = s->first[b - 1];
    s->first[0] = 0;
}

/* A feature of the first camera, and what a match with it must be like. */
struct query {
    double turned[3], normal[3]; /* its ray from the second camera; unit normal of its plane */
    double sine;                 /* of the angle between ray and baseline */
    double limit;                /* of bearings' distance from the plane */
    double step;                 /* inverse distance of a pixel along the curve */
    double least, most;          /* inverse distances */
    int level;
};

/* Level at which the second camera sees what the first sees at level 0. */
static int level_shift(const struct fv_stereo *s)
{
    double ratio = s->focal_px[1] / s->focal_px[0];
    int shift = 0;
    for (; ratio > 1.0954 && shift < 8; ratio /= 1.2)
        shift++;
    for (; ratio < 0.9129 && shift > -8; ratio *= 1.2)
        shift--;
    return shift;
}

static bool begin_query(const struct fv_stereo *s, const struct fv_stereo_view *view, uint32_t f,
                        int shift, struct query *q)
{
    if (!s->ray[f].seen) return false;
    q->level = (int)view->features[f].level + shift;
    const double scale = (double)fv_pyramid_scale(q->level < 0 ? 0
                                                  : q->level > FOVEA_PYRAMID_LEVELS_MAX - 1
                                                      ? FOVEA_PYRAMID_LEVELS_MAX - 1
                                                      : (uint32_t)q->level);
    fv_stereo_turn(s, s->ray[f].bearing, q->turned);
    fv_cross3(s->axis, q->turned, q->normal);
    q->sine = fv_norm3(q->normal);
    if (q->sine < sine_min || !fv_normalise3(q->normal)) return false;
    q->limit = off_px * scale / s->focal_px[1];
    q->step = scale / (s->focal_px[1] * s->baseline_m * q->sine);
    q->least = -off_px * q->step;
    q->most = 1 / (nearest_baselines * s->baseline_m);
    return true;
}

/* Features of the second camera on the curve, with the inverse distances that they mean; none where
 * more than can be compared lie on it or near it, since a rival might be overlooked. */
static int32_t gather(const struct fv_stereo *s, const struct fv_stereo_view *view,
                      const struct query *q, uint16_t *candidates, double *values)
{
    const double angle = angle_of(s, q->turned), width = q->limit / q->sine + 2.0 / FV_STEREO_BINS;
    const uint32_t from = bin_of(angle - width + 4), to = bin_of(angle + width + 4),
                   bins = ((to - from) & (FV_STEREO_BINS - 1)) + 1;
    int32_t count = 0, looked = 0;
    for (uint32_t i = 0; i < bins; i++) {
        const uint32_t bin = (from + i) & (FV_STEREO_BINS - 1);
        for (uint32_t k = s->first[bin]; k < s->first[bin + 1]; k++) {
            if (++looked > FV_STEREO_LOOKED_MAX) return 0;
            const uint32_t f = s->order[k];
            const int apart = (int)view->features[f].level - q->level;
            if (apart > LEVELS_APART || apart < -LEVELS_APART) continue;
            const float *b = s->bearing[f];
            const double off = q->normal[0] * (double)b[0] + q->normal[1] * (double)b[1] +
                               q->normal[2] * (double)b[2];
            if (!(off * off < q->limit * q->limit)) continue;
            const double value = fv_stereo_intersect(s, q->turned, b);
            if (!(value > q->least && value < q->most)) continue;
            if (count == FV_STEREO_CANDIDATES_MAX) return 0;
            candidates[count] = (uint16_t)f;
            values[count++] = value;
        }
    }
    return count;
}

/* The nearest candidate, unless another place on the curve is nearly as near. */
static int32_t choose(const struct query *q, const uint16_t *distances, const double *values,
                      int32_t count)
{
    int32_t best = -1;
    for (int32_t k = 0; k < count; k++)
        if (best < 0 || distances[k] < distances[best]) best = k;
    if (best < 0 || distances[best] > DISTANCE_MAX) return -1;
    for (int32_t k = 0; k < count; k++) {
        /* Inverse distance changes by one step with a pixel far away, by less near by. */
        if (fv_abs(values[k] - values[best]) > same_px * q->step &&
            distances[best] > ratio_max * distances[k])
            return -1;
    }
    return best;
}

uint32_t fv_stereo_match(struct fv_stereo *s, const struct fv_kernels *kernels,
                         const struct fv_stereo_view view[FV_STEREO_CAMERAS])
{
    const int shift = level_shift(s);
    uint32_t matches = 0;
    memset(s->owner, 0xff, view[1].count * sizeof *s->owner);
    for (uint32_t f = 0; f < view[0].count; f++) {
        uint16_t candidates[FV_STEREO_CANDIDATES_MAX], distances[FV_STEREO_CANDIDATES_MAX];
        double values[FV_STEREO_CANDIDATES_MAX];
        struct query q;
        s->match[f] = FV_STEREO_NONE;
        if (!begin_query(s, &view[0], f, shift, &q)) continue;
        const int32_t count = gather(s, &view[1], &q, candidates, values);
        if (count == 0) continue;
        kernels->hamming_some_u8(distances, view[0].descriptors + (size_t)f * 32,
                                 view[1].descriptors, candidates, count);
        const int32_t best = choose(&q, distances, values, count);
        if (best < 0) continue;
        const uint16_t other = candidates[best], before = s->owner[other];
        if (before != FV_STEREO_NONE && s->distance[before] <= distances[best]) continue;
        if (before != FV_STEREO_NONE)
            s->match[before] = FV_STEREO_NONE;
        else
            matches++;
        s->owner[other] = (uint16_t)f;
        s->match[f] = other;
        s->distance[f] = distances[best];
    }
    return matches;
}
