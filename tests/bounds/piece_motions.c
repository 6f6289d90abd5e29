/* Of motions that two views allow. */
#include "odometry/initialise_motions.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct moving {
    struct fv_initialiser *in;
    uint32_t count, found;
    struct fv_se3 T, list[FV_INITIALISE_MOTIONS_MAX];
    double costs[FV_INITIALISE_MOTIONS_MAX];
};

static void add(void *context)
{
    struct moving *m = context;
    m->found = add_motion(m->in, m->count, &m->T, m->found, m->list, m->costs);
}

static void follow(void *context)
{
    struct moving *m = context;
    const uint32_t some = m->count < PAIRS_FOLLOWED ? m->count : PAIRS_FOLLOWED;
    fv_essential_refine(m->in->pairs, some, 1, REFINE_STEPS, &m->T);
    face_points(m->in->pairs, some, &m->T);
}

static void guess(void *context)
{
    struct moving *m = context;
    (void)fv_initialise_inverse_depth(m->in, &m->in->pairs[0], &m->T, &m->costs[0]);
}

/* After pieces_of_bundle, whose pairs it takes. */
void pieces_of_motions(struct fovea *rt)
{
    static struct moving m;
    const uint32_t features = rt->odometry.map.limits.features;
    m.in = &rt->odometry.initialiser;
    m.count = features < 800 ? features : 800;
    fv_se3_identity(&m.T);
    for (int k = 0; k < 4; k++) {
        m.T.t[0] = 1;
        m.T.t[1] = 0.3 * k;
        (void)fv_normalise3(m.T.t);
        NOTE(motion_added, add, &m, 1);
    }
    NOTE(track_guessed, guess, &m, 1);
    NOTE(motion_followed, follow, &m, 1);
}
