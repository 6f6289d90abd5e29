/* Of essential matrices. */
#include "geometry/essential.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(REFINE_SAMPLES_MAX, ESSENTIAL_TRACKS);
LIMIT(REFINE_STEPS, ESSENTIAL_STEPS);

enum { SAMPLES_TRIED = 2000 };

struct estimating {
    const struct fv_pair *pairs;
    uint32_t count;
    double E[9], cost, found[FV_ESSENTIAL_SOLUTIONS_MAX][9];
    struct fv_pair five[5];
    struct fv_se3 T;
    struct fv_random random;
};

static void cost(void *context)
{
    struct estimating *e = context;
    e->cost = cost_of(e->E, e->pairs, e->count, 1, 1e300);
}

static void vote(void *context)
{
    struct estimating *e = context;
    (void)pick_motion(e->E, e->pairs, e->count, 4, &e->T);
}

static void refine(void *context)
{
    struct estimating *e = context;
    fv_essential_refine(e->pairs, e->count, 10, 1, &e->T);
}

static void five(void *context)
{
    struct estimating *e = context;
    uint32_t index[5];
    fv_sample_distinct(&e->random, e->count, 5, index);
    e->cost += fv_sample_bound(0.3, 5, 0.99);
    (void)fv_essential_five_point(e->five, e->found);
}

/* After pieces_of_bundle, whose pairs it takes. */
void pieces_of_essential(struct fovea *rt)
{
    static struct estimating e;
    const uint32_t features = rt->odometry.map.limits.features;
    fv_random_seed(&e.random, 5);
    e.pairs = rt->odometry.initialiser.pairs;
    e.count = features < 800 ? features : 800;
    fv_se3_identity(&e.T);
    e.T.t[0] = 1;
    fv_essential_from_motion(&e.T, e.E);
    NOTE(essential_cost, cost, &e, 1);
    NOTE(motion_picked, vote, &e, 1);
    fv_se3_identity(&e.T);
    e.T.t[0] = 1;
    NOTE(motion_refined, refine, &e, 1);
    for (int n = 0; n < SAMPLES_TRIED; n++) {
        for (int i = 0; i < 5; i++)
            for (int k = 0; k < 3; k++) {
                e.five[i].x1[k] = k == 2 ? 1 : fv_random_normal(&e.random);
                e.five[i].x2[k] = e.five[i].x1[k] + 0.2 * fv_random_normal(&e.random);
            }
        for (int i = 0; i < 5; i++) {
            (void)fv_normalise3(e.five[i].x1);
            (void)fv_normalise3(e.five[i].x2);
        }
        NOTE(five_point, five, &e, 1);
    }
}
