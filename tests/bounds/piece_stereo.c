/* Of distances by two cameras: rays, and what sorts them. */
#include "stereo/stereo.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"
#include "bounds/two_cameras.h"

struct raying {
    struct fovea *rt;
    struct fv_stereo_view views[FV_STEREO_CAMERAS];
};

static void rays(void *context)
{
    struct raying *r = context;
    for (int i = 0; i < FV_STEREO_CAMERAS; i++)
        find_rays(&r->rt->stereo, &r->views[i], i);
    fv_stereo_sort(&r->rt->stereo, &r->views[1]);
}

void pieces_of_stereo(struct fovea *rt)
{
    static struct raying r;
    r.rt = rt;
    two_cameras_see(rt, r.views);
    NOTE(rays_found, rays, &r, 1);
}
