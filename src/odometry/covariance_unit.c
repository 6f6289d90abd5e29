/* What the unit of length adds to the covariance of a pose: see covariance_unit.h. */
#include "odometry/covariance_unit.h"

#include "odometry/odometry.h"

static const double passed_fraction =
    0.4; /* of the cube of the bend, behind which the unit of length is another by that */

double fv_covariance_half_difference(const float *variances, uint32_t count)
{
    double sum = 0;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < i; k++)
            sum += __builtin_fabs((double)variances[i] - (double)variances[k]);
    return count > 0 ? sum / count / count : 0;
}

double fv_covariance_unit_about(const float *variances, uint32_t count, double half_difference,
                                double variance)
{
    double sum = 0;
    for (uint32_t k = 0; k < count; k++)
        sum += __builtin_fabs((double)variances[k] - variance);
    const double about = count > 0 ? sum / count - half_difference : 0;
    return about > 0 ? about : 0;
}

/* Of the keyframes of the current map. */
static uint32_t list_variances(const struct fv_map *map, float variances[FV_MAP_KEYFRAMES_MAX])
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        if (keyframe->used && keyframe->map_id == map->state->map_id)
            variances[count++] = keyframe->unit_variance;
    }
    return count;
}

void fv_covariance_spread_units(struct fv_odometry *o)
{
    float variances[FV_MAP_KEYFRAMES_MAX];
    const uint32_t count = list_variances(&o->map, variances);
    o->state->covariance.unit_half_difference = fv_covariance_half_difference(variances, count);
}

/* Over the first keyframe's: that of the keyframes from which the frame's landmarks come. */
static double frame_variance(const struct fv_map *map, const struct fv_map_frame *frame)
{
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t f = 0; f < frame->keyframe->features; f++) {
        if (frame->landmark[f] == FV_MAP_NONE) continue;
        const struct fv_landmark *l = &map->landmarks[frame->landmark[f]];
        sum += (double)map->keyframes[l->observers[0].keyframe].unit_variance;
        count++;
    }
    return count > 0 ? sum / count : 0;
}

void fv_covariance_add_unit(struct fv_odometry *o, const struct fv_map_frame *frame, double bend,
                            bool is_young, const double t[3], double covariance[21])
{
    struct fv_covariance_state *s = &o->state->covariance;
    float variances[FV_MAP_KEYFRAMES_MAX];
    const uint32_t count = list_variances(&o->map, variances);
    const double variance = frame_variance(&o->map, frame),
                 about =
                     fv_covariance_unit_about(variances, count, s->unit_half_difference, variance),
                 passed = passed_fraction * bend * bend * bend;
    fv_se3_add_along(t, about, covariance);
    s->unit_variance = is_young ? 0 : (float)(variance + passed * passed);
}
