/* What a frame shows, in numbers: how far the points of surfaces are known, and where features of a
 * rolling shutter belong. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "odometry/rolling.h"
#include "odometry/surface.h"
#include "runtime/state.h"

static struct sim_rig rig;
static struct fv_surface_point points[4096];

/* Two cameras, after so many frames. */
static struct fv_odometry *after(int frames)
{
    sim_rig_open(&rig, "sim:corridor?width=400&height=300&rate=20&baseline=0.11&seed=2", 0, frames);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    assert_true(rig.pose[frames - 1].posed);
    return &rig.rt->odometry;
}

/* The frame that a map began with: a landmark is known as well as its one measurement says, and no
 * better. */
static void a_measurement_counts_once(void **state)
{
    (void)state;
    struct fv_odometry *o = after(1);
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    const struct fv_inverse_distance *measured = fv_map_distances(&o->map, fv_map_current(&o->map));
    uint32_t next = 0, landmarks = 0;
    while (fv_odometry_surface(o, &next, points, 1) == 1) {
        const uint32_t feature = next - 1;
        if (frame.landmark[feature] == FV_MAP_NONE) continue;
        const double value = (double)measured[feature].value,
                     sigma = 1 / (value * value * sqrt((double)measured[feature].weight));
        assert_true(fabs((double)points[0].along / sigma - 1) < 0.02);
        landmarks++;
    }
    assert_true(landmarks > 100);
    sim_rig_close(&rig);
}

/* Nearer by, and not measured anew: what a keyframe measured errs by as many metres as then. */
static void a_distance_keeps_its_error(void **state)
{
    (void)state;
    struct fv_odometry *o = after(8);
    const uint32_t current = fv_map_current(&o->map);
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, current);
    uint32_t next = 0, judged = 0, nearer = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++)
        fv_map_distances(&o->map, current)[f].weight = 0;
    while (fv_odometry_surface(o, &next, points, 1) == 1) {
        const struct fv_landmark *l = &o->map.landmarks[frame.landmark[next - 1]];
        if (l->observer_count != 1) continue;
        const struct fv_inverse_distance *m =
            &fv_map_distances(&o->map, l->observers[0].keyframe)[l->observers[0].feature];
        const double value = (double)m->value,
                     sigma = 1 / (value * value * sqrt((double)m->weight)),
                     now = sqrt((double)(points[0].position[0] * points[0].position[0] +
                                         points[0].position[1] * points[0].position[1] +
                                         points[0].position[2] * points[0].position[2]));
        assert_true(fabs((double)points[0].along / sigma - 1) < 0.02);
        judged++;
        nearer += now * value < 0.95;
    }
    assert_true(judged > 20 && nearer > 5);
    sim_rig_close(&rig);
}

/* Where a feature at (x, y) is moved to, its distance 2 m. */
static struct fovea_feature placed(const struct fv_odometry *o, const struct fv_rolling *rolling,
                                   float x_px, float y_px)
{
    const struct fovea_feature feature = {.x_px = x_px, .y_px = y_px};
    const struct fv_inverse_distance distance = {0.5F, 1e6F};
    const struct fv_motion *motion = &o->state->localise.motion;
    const struct fv_odometry_input input = {.stamp_ns = motion->stamp_ns + motion->interval_ns,
                                            .count = 1,
                                            .features = &feature,
                                            .distances = &distance};
    struct fovea_feature out;
    fv_odometry_place(o, rolling, &input, &out);
    return out;
}

/* By hand: the first rows were exposed before the stamp, so that what they show has come nearer by
 * then, and a camera that turns to the right sees it further to the left. */
static void a_row_is_of_its_instant(void **state)
{
    (void)state;
    struct fv_odometry *o = after(12);
    const struct fv_motion *motion = &o->state->localise.motion;
    struct fv_rolling rolling = {.readout_s = 0.04};
    const double seconds = 1e-9 * (double)motion->interval_ns;
    assert_true(motion->known && fv_map_metric(&o->map));
    for (int turns = 0; turns < 2; turns++) {
        rolling.rate[1] = turns ? 0.5 : 0;
        for (int row = 20; row < 300; row += 65) {
            const double pixel[2] = {120, row}, dt = (row / 300.0 - 0.5) * 0.04,
                         angle = rolling.rate[1] * dt;
            double b[3], p[3], expected[2];
            assert_int_equal(fovea_camera_unproject(&o->camera, pixel, b, NULL), FOVEA_OK);
            p[0] = 2 * (cos(angle) * b[0] + sin(angle) * b[2]);
            p[1] = 2 * b[1];
            p[2] = 2 * (cos(angle) * b[2] - sin(angle) * b[0]);
            for (int k = 0; k < 3; k++)
                p[k] -= motion->T_now_before.t[k] / seconds * dt;
            assert_int_equal(fovea_camera_project(&o->camera, p, expected, NULL), FOVEA_OK);
            const struct fovea_feature out = placed(o, &rolling, 120, (float)row);
            assert_true(fabs((double)out.x_px - expected[0]) < 0.01);
            assert_true(fabs((double)out.y_px - expected[1]) < 0.01);
        }
    }
    rolling.rate[1] = 0;
    const struct fovea_feature top = placed(o, &rolling, 120, 20);
    assert_true(hypot((double)top.x_px - 120, (double)top.y_px - 20) > 0.3); /* it has moved */
    rolling.rate[1] = 5;
    const double by_turn = (double)placed(o, &rolling, 200, 20).x_px;
    assert_true(by_turn < 190); /* dt is negative, and x = f X / Z falls with the angle */
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_measurement_counts_once),
        cmocka_unit_test(a_distance_keeps_its_error),
        cmocka_unit_test(a_row_is_of_its_instant),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
