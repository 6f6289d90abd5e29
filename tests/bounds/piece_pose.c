/* Of the pose of a frame from its observations. */
#include "geometry/pose.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

enum { SAMPLES_TRIED = 2000 };

struct posing {
    struct fv_observation *observations;
    uint32_t count;
    struct fv_se3 T;
    struct fv_pose_fit fit;
    double bearings[3][3], points[3][3];
    struct fv_se3 solutions[FV_P3P_SOLUTIONS_MAX];
    double moved;
    struct fv_random random;
};

static void step(void *context)
{
    struct posing *p = context;
    (void)refine_step(p->observations, NULL, p->count, &p->T, &p->moved);
}

static void sort(void *context)
{
    struct posing *p = context;
    sort_observations(p->observations, p->count, &p->T, 1e9);
}

static void fit(void *context)
{
    struct posing *p = context;
    fit_of(p->observations, NULL, p->count, &p->T, &p->fit);
}

static void cost(void *context)
{
    struct posing *p = context;
    p->moved = sample_cost(&p->T, p->observations, p->count, 1, 1e300);
}

static void angular(void *context)
{
    struct posing *p = context;
    angular_refine(p->observations, p->count, 4, 1, &p->T);
}

static void three(void *context)
{
    struct posing *p = context;
    uint32_t index[3];
    fv_sample_distinct(&p->random, p->count, 3, index);
    for (int k = 0; k < 3; k++) {
        fv_copy3(p->observations[index[k]].bearing, p->bearings[k]);
        fv_copy3(p->observations[index[k]].point, p->points[k]);
    }
    (void)fv_p3p(p->bearings, p->points, p->solutions);
    p->moved += fv_sample_bound(0.3, 3, 0.99);
}

/* Points all around before the camera, seen with errors beyond what counts in full. */
static void observe(struct posing *p, struct fv_random *random)
{
    for (uint32_t i = 0; i < p->count; i++) {
        struct fv_observation *s = &p->observations[i];
        double *b = s->bearing;
        for (int k = 0; k < 3; k++)
            b[k] = s->point[k] = k == 2 ? 3 + fv_random_unit(random) : fv_random_normal(random);
        b[0] += 0.1 * fv_random_normal(random);
        (void)fv_normalise3(b);
        const double side[3] = {1, 0, 0};
        double across[3];
        fv_cross3(b, side, across);
        (void)fv_normalise3(across);
        fv_cross3(across, b, s->A);
        for (int k = 0; k < 3; k++) {
            s->A[k] *= 320;
            s->A[3 + k] = 320 * across[k];
        }
        s->weight = 1;
        s->inlier = true;
    }
}

void pieces_of_pose(struct fovea *rt)
{
    struct posing p = {.observations = rt->odometry.localiser.observations,
                       .count = rt->odometry.map.limits.features};
    fv_random_seed(&p.random, 1);
    observe(&p, &p.random);
    fv_se3_identity(&p.T);
    NOTE(pose_step, step, &p, 1);
    fv_se3_identity(&p.T);
    NOTE(pose_sorted, sort, &p, 1);
    NOTE(pose_fit, fit, &p, 1);
    NOTE(pose_cost, cost, &p, 1);
    NOTE(pose_angular, angular, &p, 1);
    for (int n = 0; n < SAMPLES_TRIED; n++)
        NOTE(pose_sampled, three, &p, 1);
}
