/* Of agreement of the pictures with the map. */
#include "odometry/agreement.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

static void match(void *context)
{
    struct fovea *rt = context;
    match_unit(&rt->odometry, &rt->kernels);
}

static void hold(void *context)
{
    struct fovea *rt = context;
    struct fv_odometry *o = &rt->odometry;
    const struct fv_map_frame a = fv_map_frame_at(&o->map, o->state->agreement.before),
                              b = fv_map_frame_at(&o->map, o->state->agreement.slot);
    judge(o, &a, &b, a.keyframe->features < SAMPLED_MAX ? a.keyframe->features : SAMPLED_MAX);
}

static void fit(void *context)
{
    struct fovea *rt = context;
    fit_unit(&rt->odometry);
}

static void give_up(void *context)
{
    struct fovea *rt = context;
    fv_odometry_give_up(&rt->odometry);
}

void pieces_of_agreement(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    o->config.localise_only = false;
    fv_odometry_agreement_queue(o, o->state->newest);
    NOTE(agreement_matched, match, rt, 1); /* the first clears what was */
    const uint32_t features = o->map.limits.features,
                   sampled = features < SAMPLED_MAX ? features : SAMPLED_MAX;
    for (uint32_t i = 0; i < sampled; i++) { /* all match, one to one */
        o->agreement.nearest[i] = i;
        o->agreement.second[i] = 200u << FV_MATCH_INDEX_BITS;
    }
    for (uint32_t f = 0; f < features; f++)
        o->agreement.distance[f] = 0;
    NOTE(agreement_judged, hold, rt, 1);
    o->state->agreement.motion_bias.pairs = 1; /* one before has asked for a correction */
    NOTE(agreement_fitted, fit, rt, 1);        /* with the evidence */
    NOTE(map_given_up, give_up, rt, 1);
}
