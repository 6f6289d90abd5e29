/* Of a map in metres by two cameras: landmarks of measured distances, and the pieces of the window,
 * whose observations may have a distance each. */
#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"
#include "odometry/distances.h"

struct measuring {
    struct fv_odometry *o;
    uint32_t keyframe, count;
};

static void create(void *context)
{
    struct measuring *m = context;
    (void)fv_odometry_create_measured(m->o, m->keyframe, 0, m->count);
}

/* A keyframe without landmarks, the distances of its features known or not. */
static void of_features(struct measuring *m, bool known)
{
    const struct crowd crowd = full_map_crowd(m->o);
    full_map_fill(m->o, FV_MAP_OBSERVERS_MAX);
    fv_map_remove_keyframe(&m->o->map, 0);
    for (uint32_t i = 0; i < m->o->map.limits.features; i++)
        fv_map_remove_landmark(&m->o->map, i);
    full_map_view(m->o, &crowd, 3);
    m->keyframe = fv_map_add_keyframe(&m->o->map, fv_map_current(&m->o->map));
    struct fv_inverse_distance *distances = fv_map_distances(&m->o->map, m->keyframe);
    for (uint32_t f = 0; f < m->o->map.limits.features; f++)
        distances[f] = (struct fv_inverse_distance){.value = 0.2f, .weight = known ? 1e6f : 0};
    const uint32_t before = m->o->map.state->landmark_count;
    m->count = CREATION_FEATURES;
    if (known)
        NOTE(feature_measured, create, m, CREATION_FEATURES);
    else
        NOTE(feature_unmeasured, create, m, m->o->map.limits.features);
    MUST(m->o->map.state->landmark_count == before + (known ? CREATION_FEATURES : 0));
}

void pieces_of_distances(struct fovea *rt)
{
    struct measuring m = {.o = &rt->odometry};
    MUST(m.o->map.distances != NULL);
    of_features(&m, true);
    of_features(&m, false);
    MUST(fv_map_metric(&m.o->map));
    pieces_of_window(rt);
    pieces_of_window_copy(rt);
}
