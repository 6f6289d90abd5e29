/* Of distances by two cameras: a feature's candidates. */
#include "bounds/counter.h"
#include "bounds/pieces.h"
#include "bounds/two_cameras.h"

/* After the headers, whose names it hides. */
#include "stereo/candidates.c"

struct querying {
    struct fovea *rt;
    struct fv_stereo_view views[FV_STEREO_CAMERAS];
    int32_t count;
};

static void query(void *context)
{
    struct querying *q = context;
    uint16_t candidates[FV_STEREO_CANDIDATES_MAX], distances[FV_STEREO_CANDIDATES_MAX];
    double values[FV_STEREO_CANDIDATES_MAX];
    struct query asked;
    if (!begin_query(&q->rt->stereo, &q->views[0], 0, 0, &asked)) return;
    q->count = gather(&q->rt->stereo, &q->views[1], &asked, candidates, values);
    q->rt->kernels.hamming_some_u8(distances, q->views[0].descriptors, q->views[1].descriptors,
                                   candidates, q->count);
    (void)choose(&asked, distances, values, q->count);
}

/* After pieces_of_stereo, whose rays it takes. */
void pieces_of_stereo_match(struct fovea *rt)
{
    static struct querying q;
    q.rt = rt;
    two_cameras_see(rt, q.views);
    NOTE(stereo_matched, query, &q, 1);
    MUST(q.count == FV_STEREO_CANDIDATES_MAX);
}
