/* The motion since an earlier frame: poses of one stretch, links of the chain, and what ends it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "runtime/relative.h"

static struct fv_relative_state state;
static const struct fv_relative relative = {&state};

/* A camera that goes 1 along x per frame; sigma of x is `sigma`, of a turn about z 0.01. */
static struct fovea_pose pose_at(int frame, double sigma, int keyframe_frame)
{
    struct fovea_pose pose = {.posed = true, .keyframe_stamp_ns = 100 * (keyframe_frame + 1)};
    for (int k = 0; k < 3; k++)
        pose.T_world_cam[5 * k] = 1;
    pose.T_world_cam[3] = frame;
    pose.covariance[0] = sigma * sigma;
    pose.covariance[20] = 0.01 * 0.01;
    return pose;
}

static void note(int frame, struct fovea_pose pose, uint32_t changes)
{
    fv_relative_note(&relative, &pose, changes, 100 * (frame + 1));
}

static int begin(void **unused)
{
    (void)unused;
    memset(&state, 0, sizeof state);
    return 0;
}

static void near(double found, double expected)
{
    if (!(fabs(found - expected) <= 1e-12))
        fail_msg("found %.15g, expected %.15g", found, expected);
}

/* What the unit of length of a stretch errs by: .5 % of the way. */
static double unit_of(double way)
{
    return 0.005 * 0.005 * way * way;
}

/* Frames 0 and 2 are keyframes; motions sum what hangs in between, and the unit of length is off
 * along the way. */
static void links_add_up(void **unused)
{
    struct fovea_relative_pose motion;
    (void)unused;
    note(0, pose_at(0, 0.5, 0), 0);
    note(1, pose_at(1, 0.1, 0), 0);
    note(2, pose_at(2, 0.2, 2), 0);
    note(3, pose_at(3, 0.3, 2), 0);
    assert_true(fv_relative_get(&relative, 0, &motion));
    near(motion.covariance[0], 0);
    assert_true(fv_relative_get(&relative, 1, &motion)); /* since its own keyframe */
    assert_int_equal(motion.before_stamp_ns, 300);
    assert_int_equal(motion.stamp_ns, 400);
    near(motion.T_before_now[3], 1);
    near(motion.covariance[0], 0.09 + unit_of(1));
    assert_true(fv_relative_get(&relative, 2, &motion)); /* since a frame of the keyframe before */
    near(motion.T_before_now[3], 2);
    near(motion.covariance[0], 0.09 + 0.04 + 0.01 + unit_of(2));
    /* Turns at frames 1 and 2 move the camera aside by 2 and 1 times as much; y is element 6. */
    near(motion.covariance[6], 1e-4 * (4 + 1));
    assert_true(fv_relative_get(&relative, 3, &motion)); /* since a keyframe: nothing of its own */
    near(motion.covariance[0], 0.09 + 0.04 + unit_of(3));
    assert_false(fv_relative_get(&relative, 4, &motion));
}

/* In metres an error of the scale is the same in all links: of the whole way, not of each part. */
static void the_scale_errs_once(void **unused)
{
    enum { FRAMES = 7 };
    struct fovea_relative_pose motion;
    (void)unused;
    for (int frame = 0; frame < FRAMES; frame++) { /* each second one is a keyframe */
        const int keyframe = frame - frame % 2, before = frame % 2 == 0 && frame > 0 ? 2 : 0;
        struct fovea_pose pose = pose_at(frame, 0.1, keyframe);
        const int way = frame % 2 + before;
        for (int k = 0; k < 3; k++)
            pose.T_keyframe_cam[5 * k] = 1;
        pose.T_keyframe_cam[3] = 0.5 * way; /* the map's unit is 2 m */
        pose.scale_source = FOVEA_SCALE_INERTIAL;
        pose.scale = 2;
        pose.scale_sigma = 0.05;
        pose.covariance[0] += 0.05 * 0.05 * way * way;
        note(frame, pose, 0);
    }
    assert_true(fv_relative_get(&relative, FRAMES - 1, &motion));
    near(motion.T_before_now[3], 6);
    near(motion.covariance[0], 3 * 0.01 + 0.05 * 0.05 * 36);
}

static void only_poses_that_relate(void **unused)
{
    struct fovea_relative_pose motion;
    (void)unused;
    note(0, pose_at(0, 0.1, 0), 0);
    note(1, (struct fovea_pose){.posed = false}, 0);
    assert_false(fv_relative_get(&relative, 1, &motion)); /* lost now */
    note(2, pose_at(2, 0.1, 0), 0);
    assert_false(fv_relative_get(&relative, 1, &motion)); /* lost then */
    assert_false(fv_relative_get(&relative, 2, &motion)); /* found again: no chain of links */
    note(3, pose_at(3, 0.1, 0), 1);                       /* another unit */
    assert_false(fv_relative_get(&relative, 1, &motion));
    struct fovea_pose pose = pose_at(4, 0.1, 4);
    pose.map_id = pose.reset_counter = 1;
    note(4, pose, 0);
    assert_false(fv_relative_get(&relative, 1, &motion));
    note(4, (struct fovea_pose){.posed = false}, 0); /* the camera is gone: the frame's pose too */
    assert_int_equal(state.frames, 5);
    assert_false(fv_relative_get(&relative, 0, &motion));
}

static void a_ring_of_frames(void **unused)
{
    struct fovea_relative_pose motion;
    (void)unused;
    for (int frame = 0; frame < 3 * FOVEA_RELATIVE_FRAMES_MAX; frame++)
        note(frame, pose_at(frame, 0.1, 0), 0);
    assert_true(fv_relative_get(&relative, FOVEA_RELATIVE_FRAMES_MAX, &motion));
    near(motion.T_before_now[3], FOVEA_RELATIVE_FRAMES_MAX);
    near(motion.covariance[0], 2 * 0.01 + unit_of(FOVEA_RELATIVE_FRAMES_MAX));
    assert_false(fv_relative_get(&relative, FOVEA_RELATIVE_FRAMES_MAX + 1, &motion));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(links_add_up, begin),
        cmocka_unit_test_setup(the_scale_errs_once, begin),
        cmocka_unit_test_setup(only_poses_that_relate, begin),
        cmocka_unit_test_setup(a_ring_of_frames, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
