/* What the covariance makes of a map whose unit of length is another from place to place: a real
 * frame of one simulated camera. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "geometry/vec.h"
#include "odometry/covariance.h"
#include "odometry/covariance_unit.h"
#include "odometry/localise.h"
#include "runtime/state.h"

enum { FRAMES = 80, YOUNG_KEYFRAMES = 10 };

static struct sim_rig rig;
static struct fv_odometry *o;
static struct fv_map_frame frame;
static struct fv_pose_fit fit;

static int set_up(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:corridor?width=400&height=300&rate=20&seed=2", 0, FRAMES);
    sim_rig_build(&rig);
    o = &rig.rt->odometry;
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    assert_true(o->state->pose.posed && !fv_map_metric(&o->map));
    struct fv_se3 T = frame.keyframe->T_cam_world;
    assert_true(fv_localiser_refine(&o->localiser, &o->map, &frame, 3, 5, &T, &fit) > 20);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sim_rig_close(&rig);
    return 0;
}

/* Each keyframe of the map has this variance; from the frame's landmarks so much noise over
 * parallax that the bend is `bend`. Returns whether the pose is to be relied on. */
static bool write_with(double variance, double bend)
{
    const double noise_px = sqrt(fmax(fv_pose_variance(&fit), FV_MAP_VARIANCE_MIN)),
                 spread = sqrt(noise_px * 20 / bend) / o->focal_px;
    for (uint32_t k = 0; k < o->map.limits.keyframes; k++)
        o->map.keyframes[k].unit_variance = (float)variance;
    for (uint32_t f = 0; f < frame.keyframe->features; f++)
        if (frame.landmark[f] != FV_MAP_NONE)
            o->map.landmarks[frame.landmark[f]].spread = (float)spread;
    memset(&o->state->covariance, 0, sizeof o->state->covariance);
    return fv_covariance_write(o, &frame, &fit);
}

static double next_variance(void)
{
    return (double)o->state->covariance.unit_variance;
}

/* Where the reference is, seen from the frame. */
static void way_from_reference(double t[3])
{
    struct fv_se3 inverse, T_frame_ref;
    fv_se3_invert(&o->map.keyframes[o->state->newest].T_cam_world, &inverse);
    fv_se3_compose(&frame.keyframe->T_cam_world, &inverse, &T_frame_ref);
    fv_copy3(T_frame_ref.t, t);
}

/* Every other keyframe has this variance, and the rest none. Returns that of a unit of
 * `variance_of_frame` about the mean unit of all. */
static double halve(float variance, double variance_of_frame)
{
    uint32_t count = 0, with = 0;
    for (uint32_t k = 0; k < o->map.limits.keyframes; k++) {
        struct fv_keyframe *keyframe = &o->map.keyframes[k];
        if (!keyframe->used) continue;
        keyframe->unit_variance = count % 2 == 0 ? variance : 0;
        with += count % 2 == 0;
        count++;
    }
    const double share = (double)with / count, of_those = (double)variance;
    return share * fabs(of_those - variance_of_frame) + (1 - share) * variance_of_frame -
           share * (1 - share) * of_those;
}

/* Where all keyframes have one unit it is that of the map. Else the share that it is off by is
 * added to the way, along the way, and nothing else. */
static void the_way_since_the_reference_has_its_unit(void **state)
{
    double none[21], t[3];
    const float variance = 0.04F;
    const double *now = o->state->pose.covariance;
    (void)state;
    assert_true(write_with(0, 0.01));
    memcpy(none, now, sizeof none);
    assert_true(next_variance() < 1e-9);
    assert_true(write_with((double)variance, 0.01));
    assert_true(fabs(next_variance() / (double)variance - 1) < 1e-6);
    assert_memory_equal(now, none, sizeof none);
    (void)halve(variance, 0);
    fv_covariance_spread_units(o);
    assert_true(fv_covariance_write(o, &frame, &fit));
    const double about = halve(variance, next_variance());
    way_from_reference(t);
    assert_true(about > 0.1 * (double)variance && fv_norm3(t) > 0.001);
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++) {
            const double more = row < 3 && column < 3 ? about * t[row] * t[column] : 0;
            assert_true(fabs(now[k] - none[k] - more) < 1e-5 * about * fv_dot3(t, t));
        }
}

/* Only keyframes from which the frame's landmarks come count, by their number. */
static void landmarks_bring_the_unit_they_were_made_in(void **state)
{
    uint32_t of_newest = 0, all = 0;
    (void)state;
    (void)write_with(0, 0.01);
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        all++;
        of_newest += o->map.landmarks[frame.landmark[f]].observers[0].keyframe == o->state->newest;
    }
    assert_true(of_newest > 0 && of_newest < all);
    o->map.keyframes[o->state->newest].unit_variance = 1;
    (void)fv_covariance_write(o, &frame, &fit);
    assert_true(fabs(next_variance() - (double)of_newest / all) < 1e-6);
}

/* A bend of half and more is not to be relied on, and what is made of such a frame has another
 * unit by .4 of the bend's cube. */
static void a_passage_without_parallax_changes_the_unit(void **state)
{
    (void)state;
    assert_true(write_with(0, 0.45) && !write_with(0, 0.55));
    for (int tenths = 2; tenths <= 10; tenths += 2) {
        const double bend = 0.1 * tenths, passed = 0.4 * bend * bend * bend;
        (void)write_with(0.01, bend);
        assert_true(fabs(next_variance() / (0.01 + passed * passed) - 1) < 1e-3);
    }
}

/* A young map is not to be relied on from a tenth on, and has no unit before its own. */
static void a_young_map_has_its_own_unit(void **state)
{
    const uint64_t first = o->state->first_keyframe;
    (void)state;
    o->state->first_keyframe = o->map.state->keyframe_number - YOUNG_KEYFRAMES + 1;
    assert_true(write_with(0, 0.09) && !write_with(0, 0.11));
    assert_true(next_variance() == 0);
    o->state->first_keyframe--;
    assert_true(write_with(0, 0.11) && next_variance() > 0);
    o->state->first_keyframe = first;
}

/* The last, since it makes a keyframe of the frame. */
static void a_keyframe_keeps_the_unit_of_its_frame(void **state)
{
    (void)state;
    (void)write_with(0.01, 0.8);
    const float passed = o->state->covariance.unit_variance;
    fv_odometry_make_keyframe(o);
    assert_true(passed > 0.04F && o->map.keyframes[o->state->newest].unit_variance == passed);
    const uint32_t other = fv_map_add_keyframe(&o->map, fv_map_current(&o->map));
    assert_true(o->map.keyframes[other].unit_variance == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_way_since_the_reference_has_its_unit),
        cmocka_unit_test(landmarks_bring_the_unit_they_were_made_in),
        cmocka_unit_test(a_passage_without_parallax_changes_the_unit),
        cmocka_unit_test(a_young_map_has_its_own_unit),
        cmocka_unit_test(a_keyframe_keeps_the_unit_of_its_frame),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
