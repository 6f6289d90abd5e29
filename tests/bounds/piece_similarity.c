/* Of similarities from correspondences. */
#include "geometry/sim3_align.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct aligning {
    const struct fv_correspondence *correspondences;
    uint32_t count, at;
    struct fv_sim3_search search;
    struct fv_random random;
    bool agrees;
};

static void test(void *context)
{
    struct aligning *a = context;
    struct fv_sim3 S;
    fv_sim3_identity(&S);
    a->agrees = correspondence_agrees(&a->correspondences[a->at], &S, &S, 1e300);
}

static void solve(void *context)
{
    struct aligning *a = context;
    a->search.done = 0;
    a->search.bound = 1;
    a->search.best_inliers = a->count; /* no test gains anything: one is made */
    (void)fv_sim3_search_more(&a->search, a->correspondences, a->count, 1, 9, &a->random);
}

/* After pieces_of_closure, whose correspondences it takes. */
void pieces_of_similarity(struct fovea *rt)
{
    static struct aligning a;
    a.correspondences = rt->odometry.closure.correspondences;
    a.count = rt->odometry.closure.state->correspondence_count;
    fv_random_seed(&a.random, 7);
    for (a.at = 0; a.at < a.count && a.at < 100; a.at++)
        NOTE(similarity_tested, test, &a, 1);
    for (int n = 0; n < 500; n++)
        NOTE(similarity_solved, solve, &a, 1);
}
