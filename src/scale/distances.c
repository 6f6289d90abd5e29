/* Scale of a map with a unit of its own, as one that was begun while the second camera was covered,
 * from distances that two cameras measure: the median of measured over the map's own. */
#include "base/elementary.h"
#include "geometry/vec.h"
#include "scale/scale.h"

enum {
    RATIOS_MIN = 30,
    HALVINGS = 24 /* of the logarithm's range */
};

static const double log_range = 14; /* either way: a unit is between a micrometre and 1000 km */
static const double parts = 10;     /* a distance is known to one part in this number */
static const double baseline_sigma = 0.005; /* of the baseline, relative: no measurement is surer */

/* Logarithm of measured over mapped distance of a feature of the frame. False: not both known. */
static bool log_ratio(const struct fv_map *map, const struct fv_map_frame *frame,
                      const struct fv_inverse_distance *measured, uint32_t feature, double *ratio)
{
    double q[3];
    if (frame->landmark[feature] == FV_MAP_NONE || !fv_inverse_distance_known(measured, parts))
        return false;
    fv_se3_apply(&frame->keyframe->T_cam_world, map->landmarks[frame->landmark[feature]].point, q);
    *ratio = -fv_log((double)measured->value * fv_norm3(q));
    return true;
}

/* Median of |ratio - centre|, or of the ratios themselves without `deviations`, by halving. */
static double median(const double *ratios, uint32_t count, double centre, bool deviations)
{
    double low = deviations ? 0 : -log_range, high = log_range;
    for (int step = 0; step < HALVINGS; step++) {
        const double middle = 0.5 * (low + high);
        uint32_t below = 0;
        for (uint32_t i = 0; i < count; i++)
            below += (deviations ? fv_abs(ratios[i] - centre) : ratios[i]) < middle;
        *(2 * below > count ? &high : &low) = middle;
    }
    return 0.5 * (low + high);
}

bool fv_scale_compare_distances(const struct fv_odometry *odometry, double *log_scale,
                                double *variance)
{
    enum { RATIOS_MAX = 400 };
    const struct fv_map *map = fv_odometry_map(odometry);
    const uint32_t current = fv_map_current(map);
    const struct fv_inverse_distance *distances = fv_map_distances(map, current);
    if (distances == NULL) return false;
    const struct fv_map_frame frame = fv_map_frame_at(map, current);
    double ratios[RATIOS_MAX];
    uint32_t count = 0;
    for (uint32_t f = 0; f < frame.keyframe->features && count < RATIOS_MAX; f++)
        count += log_ratio(map, &frame, &distances[f], f, &ratios[count]);
    if (count < RATIOS_MIN) return false;
    *log_scale = median(ratios, count, 0, false);
    /* Of the median, from the median of the deviations, as of a normal distribution. */
    const double sigma = 1.4826 * median(ratios, count, *log_scale, true);
    *variance = 1.571 * sigma * sigma / count + baseline_sigma * baseline_sigma;
    return true;
}
