/* Of distances by two cameras: patches aligned. */
#include "stereo/align.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"
#include "bounds/two_cameras.h"

LIMIT(STEPS_MAX, STEREO_STEPS);

struct aligning {
    struct fovea *rt;
    struct fv_stereo_view views[FV_STEREO_CAMERAS];
    struct fv_inverse_distance measured;
    struct patch patch;
    struct alignment now;
    struct fv_stereo_place place;
    bool good;
};

static void align(void *context)
{
    struct aligning *a = context;
    (void)fv_stereo_align(&a->rt->stereo, a->views, 0, a->views[1].count - 1, &a->measured);
}

static void step(void *context)
{
    struct aligning *a = context;
    const struct fv_plane *image = fv_pyramid_level(a->views[1].pyramid, 0);
    const double centre[2] = {image->width / 2 + 0.3, image->height / 2 + 0.4},
                 warp[4] = {1, 0.01, 0.01, 1};
    int16_t seen[PIXELS];
    struct grid g;
    double turned[3];
    a->good = place_grid(image, centre, warp, SIDE, &g);
    sample_grid(image, &g, SIDE, seen);
    a->good = compare(&a->patch, a->patch.x, seen, &a->now) && a->good;
    fv_stereo_turn(&a->rt->stereo, a->rt->stereo.ray[0].bearing, turned);
    a->good = fv_stereo_project(&a->rt->stereo, turned, 0.1, &a->place) && a->good;
}

/* After pieces_of_stereo, whose rays it takes. */
void pieces_of_stereo_align(struct fovea *rt)
{
    static struct aligning a;
    a.rt = rt;
    two_cameras_see(rt, a.views);
    const struct fv_plane *image = fv_pyramid_level(a.views[0].pyramid, 0);
    const double at[2] = {image->width / 2 + 0.3, image->height / 2 + 0.4};
    MUST(take_patch(image, at, &a.patch));
    NOTE(patch_step, step, &a, 1);
    NOTE(patch_aligned, align, &a, 1);
}
