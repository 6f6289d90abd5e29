/* Of the covariance of a pose. */
#include "odometry/covariance.c"

#include <stdlib.h>

#include "odometry/covariance_unit.h"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct covarying {
    struct fv_odometry *o;
    struct fv_map_frame frame;
    struct fv_pose_fit fit;
    struct fv_pose_part parts[FV_MAP_PARTS];
    double covariance[21], variance;
    struct fv_pose_shown shown;
};

static void collect(void *context)
{
    struct covarying *c = context;
    collect_parts(&c->o->map, &c->frame, c->parts);
    const double t[3] = {1, 1, 1};
    c->variance = map_bend(&c->o->map, c->o->focal_px, &c->frame, 0.1);
    fv_covariance_add_unit(c->o, &c->frame, 0.1, false, t, c->covariance);
}

static void spread_units(void *context)
{
    struct covarying *c = context;
    fv_covariance_spread_units(c->o);
}

static void joint(void *context)
{
    struct covarying *c = context;
    MUST(solve_joint(c->o, &c->frame, c->frame.keyframe->features, 1, c->covariance));
}

static void jackknife(void *context)
{
    struct covarying *c = context;
    MUST(fv_pose_jackknife(&c->fit, c->parts, FV_MAP_PARTS, &c->shown));
    fv_pose_spread(&c->fit, 0, &c->shown);
}

static void lens_current(void *context)
{
    struct covarying *c = context;
    (void)fv_covariance_add_lens(c->o, 0, 0, c->covariance);
}

/* Parts of one weight each. */
static void make_parts(struct covarying *c)
{
    struct fv_random random;
    fv_random_seed(&random, 3);
    memset(&c->fit, 0, sizeof c->fit);
    memset(c->parts, 0, sizeof c->parts);
    for (int p = 0; p < FV_MAP_PARTS; p++)
        for (int n = 0; n < 20; n++) {
            double row[6];
            for (int k = 0; k < 6; k++)
                row[k] = fv_random_normal(&random);
            fv_pose_part_add(&c->parts[p], 1, fv_random_normal(&random), row);
        }
    for (int p = 0; p < FV_MAP_PARTS; p++)
        for (int k = 0; k < 36; k++)
            c->fit.information[k] += c->parts[p].information[k];
}

void pieces_of_covariance(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    const struct crowd crowd = full_map_crowd(o);
    static struct covarying c;
    c.o = o;
    c.frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    full_map_view(o, &crowd, FULL_MAP_PLACES / 2);
    const struct fv_map_frame newest = fv_map_frame_at(&o->map, o->state->newest);
    for (uint32_t f = 0; f < c.frame.keyframe->features; f++)
        c.frame.landmark[f] = newest.landmark[f];
    NOTE(parts_collected, collect, &c, 1);
    NOTE(units_spread, spread_units, &c, 1);
    NOTE(joint, joint, &c, 1);
    NOTE(lens_current, lens_current, &c, 1);
    make_parts(&c);
    NOTE(jackknife, jackknife, &c, 1);
}
