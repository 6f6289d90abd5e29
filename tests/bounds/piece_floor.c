/* Of the floor under the camera. */
#include "scale/floor.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"

struct flooring {
    struct fovea *rt;
    const struct fv_landmark *landmark;
    struct fv_floor_point point;
    struct fv_floor floor;
    double sum;
};

static void look(void *context)
{
    struct flooring *f = context;
    struct fv_scale *scale = &f->rt->scale;
    struct fv_floor_look where = {.takes = NULL};
    fv_copy3(scale->down, where.down);
    (void)landmark_as_point(&where, &f->rt->odometry, &f->rt->odometry.map.keyframes[0].T_cam_world,
                            f->landmark, &f->point);
    scale->points[fv_random_below(&scale->state->random, FV_FLOOR_POINTS_MAX)] = f->point;
}

static void estimate(void *context)
{
    struct flooring *f = context;
    struct fv_scale *scale = &f->rt->scale;
    struct fv_floor_prior prior = {.sigma_rad = prior_sigma_rad, .off_max_rad = 3};
    fv_copy3(scale->down, prior.down);
    MUST(fv_floor_estimate(scale->points, FV_FLOOR_POINTS_MAX, &prior, SAMPLES, INLIERS_MIN,
                           &scale->state->random, &f->floor));
}

void pieces_of_floor(struct fovea *rt)
{
    static struct flooring f;
    f.rt = rt;
    full_map_fill(&rt->odometry, FV_MAP_OBSERVERS_MAX);
    struct fv_scale *scale = &rt->scale;
    scale->down[0] = scale->down[1] = 0;
    scale->down[2] = 1; /* the scene lies below */
    const struct fv_map *map = &rt->odometry.map;
    const struct fv_map_frame newest = fv_map_frame_at(map, map->limits.keyframes - 1);
    for (uint32_t k = 0; k < newest.keyframe->features; k += 1 + newest.keyframe->features / 50) {
        f.landmark = &map->landmarks[newest.landmark[k]];
        NOTE(floor_looked, look, &f, 1);
    }
    for (int i = 0; i < FV_FLOOR_POINTS_MAX; i++) /* a plane, and all points in it */
        scale->points[i] = (struct fv_floor_point){
            .p = {i % 23 - 11, i / 23 - 11, 5 + 0.001 * (i % 7)}, .sigma = 0.05};
    NOTE(floor_estimated, estimate, &f, 1);
}
