/* Of homographies. */
#include "geometry/homography.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct planing {
    const struct fv_pair *pairs;
    uint32_t count;
    uint8_t *inlier;
    double H[9], cost;
    struct fv_random random;
};

static void cost(void *context)
{
    struct planing *p = context;
    p->cost = homography_cost(p->H, p->pairs, p->count, 1, 1e300);
}

static void four(void *context)
{
    struct planing *p = context;
    uint32_t index[4];
    fv_sample_distinct(&p->random, p->count, 4, index);
    (void)homography_fit(p->pairs, index, 4, 0, p->H);
    p->cost += fv_sample_bound(0.3, 4, 0.99);
}

static void fit(void *context)
{
    struct planing *p = context;
    p->cost = 1e300;
    (void)homography_optimise(p->pairs, p->count, 10, p->inlier, p->H, &p->cost);
}

/* After pieces_of_bundle, whose pairs it takes. */
void pieces_of_homography(struct fovea *rt)
{
    static struct planing p;
    const uint32_t features = rt->odometry.map.limits.features;
    p.pairs = rt->odometry.initialiser.pairs;
    p.count = features < 800 ? features : 800;
    p.inlier = rt->odometry.initialiser.inlier;
    p.H[0] = p.H[4] = p.H[8] = 1;
    NOTE(homography_cost, cost, &p, 1);
    NOTE(homography_fit, fit, &p, 1);
    fv_random_seed(&p.random, 11);
    for (int n = 0; n < 100; n++)
        NOTE(homography_four, four, &p, 1);
}
