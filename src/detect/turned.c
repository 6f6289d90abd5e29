#include "detect/turned.h"

#include "base/elementary.h"

enum { COST_NEAR = 64, COST_FAR = 2 };

static double largest_variance(const struct fovea_detection *box)
{
    const double w = (double)box->x_max_px - (double)box->x_min_px,
                 h = (double)box->y_max_px - (double)box->y_min_px;
    return (w > h ? w * w : h * h) / 12;
}

struct fv_turned fv_turned_of(const struct fovea_detection *box)
{
    const double w = (double)box->x_max_px - (double)box->x_min_px,
                 h = (double)box->y_max_px - (double)box->y_min_px;
    const double cosine = fv_cos((double)box->angle), sine = fv_sin((double)box->angle);
    const double along = w * w / 12, across = h * h / 12;
    return (struct fv_turned){
        .x = 0.5 * ((double)box->x_min_px + (double)box->x_max_px),
        .y = 0.5 * ((double)box->y_min_px + (double)box->y_max_px),
        .a = along * cosine * cosine + across * sine * sine,
        .b = along * sine * sine + across * cosine * cosine,
        .c = (along - across) * cosine * sine,
        .largest = largest_variance(box),
    };
}

/* The distance of Bhattacharyya. */
static double distance(const struct fv_turned *p, const struct fv_turned *q)
{
    const double tiny = 1e-7;
    const double a = p->a + q->a, b = p->b + q->b, c = p->c + q->c, det = a * b - c * c;
    const double x = q->x - p->x, y = p->y - q->y;
    const double own_p = p->a * p->b - p->c * p->c, own_q = q->a * q->b - q->c * q->c;
    const double own = (own_p > 0 ? own_p : 0) * (own_q > 0 ? own_q : 0);
    const double apart =
                     0.25 * (a * y * y + b * x * x) / (det + tiny) + 0.5 * c * x * y / (det + tiny),
                 unlike = 0.5 * fv_log(det / (4 * __builtin_sqrt(own) + tiny) + tiny);
    return apart + unlike;
}

/* Above `least` means a distance below -log(1 - (1 - least)^2). A distance is at least an eighth of
 * the squared distance of the centres over the mean covariance, whose largest variance bounds it.
 */
bool fv_turned_overlaps(const struct fv_turned *one, const struct fovea_detection *other,
                        double least, int *cost)
{
    const double x = 0.5 * ((double)other->x_min_px + (double)other->x_max_px) - one->x,
                 y = 0.5 * ((double)other->y_min_px + (double)other->y_max_px) - one->y;
    const double far = 1 - least, rest = 1 - far * far, limit = rest > 1e-9 ? -fv_log(rest) : 1e9;
    *cost = COST_FAR;
    if (x * x + y * y > 4 * limit * (one->largest + largest_variance(other))) return false;
    const struct fv_turned two = fv_turned_of(other);
    *cost = COST_NEAR;
    return distance(one, &two) < limit;
}
