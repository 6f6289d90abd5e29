/* Of what a pose says. */
#include "odometry/odometry.c"

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(WINDOW_LANDMARKS, WINDOW_LANDMARKS_MOST);
LIMIT(WINDOW_OBSERVATIONS, WINDOW_OBSERVATIONS_MOST);
LIMIT(MAP_KEYFRAMES_MIN - 1, SMALL_MAP_KEYFRAMES_DROPPED);

static void publish(void *context)
{
    struct fovea *rt = context;
    const struct fv_inertial_known *known = fv_inertial_stage_known(&rt->inertial);
    const int64_t stamp_ns = (int64_t)rt->odometry.state->frame_number * 33000000;
    write_pose(&rt->odometry);
    write_map(&rt->odometry);
    fv_inertial_stage_step(&rt->inertial, &rt->odometry, stamp_ns);
    fv_scale_step(&rt->scale, &rt->odometry, known);
    fv_publish_step(&rt->publish, &rt->odometry, &rt->scale, known, stamp_ns);
    fv_relative_note(&rt->relative, fv_publish_pose(&rt->publish),
                     fv_publish_last_change(&rt->publish).count, stamp_ns);
}

void pieces_of_odometry(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    const struct crowd crowd = full_map_crowd(o);
    full_map_fill(o, FV_MAP_OBSERVERS_MAX);
    for (uint32_t place = 0; place < FULL_MAP_PLACES; place++) {
        full_map_view(o, &crowd, place);
        o->map.keyframes[fv_map_current(&o->map)].parent = (int32_t)o->state->newest;
        o->state->frame_number++;
        o->state->pose.state = FOVEA_TRACKING_OK;
        NOTE(published, publish, rt, 1);
    }
}
