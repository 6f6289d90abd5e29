/* When a camera stands by what the inertial stage knows: with a pose that is sound and a velocity
 * that is known, never without. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "geometry/se3.h"
#include "scale/inertial.h"

enum { RATE_HZ = 200, SAMPLE_NS = 5000000, SAMPLES_A_FRAME = 10, FRAMES_A_SECOND = 20 };

static struct fv_inertial_stage_state s;
static struct fv_inertial_stage stage;
static struct fv_random noise;
static int64_t now_ns;
static double sway; /* to and fro from frame to frame, in the unit of the poses */

/* A camera that has moved, and whose velocity is known. */
static int set_up(void **state)
{
    (void)state;
    memset(&s, 0, sizeof s);
    stage = (struct fv_inertial_stage){.enabled = true,
                                       .imu.rate_hz = RATE_HZ,
                                       .gyro_noise = 1.7e-4,
                                       .acceleration_noise = 2e-3,
                                       .state = &s};
    fv_imu_still_init(&s.still);
    s.known.claimed = s.live.moving = true;
    s.known.scale = 1;
    s.depth = 3;
    s.live.variance = 1e-4;
    now_ns = 0;
    sway = 0;
    fv_random_seed(&noise, 1);
    return 0;
}

/* A frame of a camera that does not move, with a pose in this state. */
static bool stands(enum fovea_tracking_state tracking)
{
    const double root = __builtin_sqrt((double)RATE_HZ);
    const struct fovea_pose pose = {.state = tracking, .posed = true};
    for (int k = 0; k < SAMPLES_A_FRAME; k++) {
        struct fv_imu_reading sample = {.stamp_ns = now_ns += SAMPLE_NS};
        for (int i = 0; i < 3; i++) {
            sample.gyro[i] = root * stage.gyro_noise * fv_random_normal(&noise);
            sample.acceleration[i] = 5 + root * stage.acceleration_noise * fv_random_normal(&noise);
        }
        fv_inertial_stage_still_take(&stage, &sample);
    }
    fv_se3_identity(&s.T_world_cam);
    sway = -sway;
    s.T_world_cam.t[1] = sway;
    s.T_world_cam.t[0] = 40; /* where a better scale would move it, were it in metres */
    s.known.scale *= 1.001;
    fv_inertial_stage_still_see(&stage, &pose, now_ns);
    return s.still.standing;
}

static int count(int frames, enum fovea_tracking_state tracking)
{
    int standing = 0;
    for (int n = 0; n < frames; n++)
        standing += stands(tracking);
    return standing;
}

static void test_it_stands_by_sound_poses(void **state)
{
    (void)state;
    assert_true(count(2 * FRAMES_A_SECOND, FOVEA_TRACKING_OK) > FRAMES_A_SECOND);
    assert_true(s.still.standing);
}

/* Poses 7 mrad apart, of what is seen: no unit makes them one place. */
static void test_it_does_not_stand_while_it_sways(void **state)
{
    (void)state;
    s.known.scale = 20;
    sway = 0.01;
    assert_int_equal(count(2 * FRAMES_A_SECOND, FOVEA_TRACKING_OK), 0);
}

/* A weak pose may lie where it was put because nothing pulls at it: a picture that is stuck, torn
 * or dark shows no standing, however quiet the samples, and ends it. */
static void test_a_weak_pose_does_not_stand(void **state)
{
    (void)state;
    assert_int_equal(count(5 * FRAMES_A_SECOND, FOVEA_TRACKING_WEAK), 0);
    assert_true(count(2 * FRAMES_A_SECOND, FOVEA_TRACKING_OK) > FRAMES_A_SECOND);
    assert_false(stands(FOVEA_TRACKING_WEAK));
    /* Sound poses then begin anew with half a second in one place. */
    assert_int_equal(count(FRAMES_A_SECOND / 2, FOVEA_TRACKING_OK), 0);
    assert_true(stands(FOVEA_TRACKING_OK));
}

/* Nothing that is known says how fast it is: it stands neither then nor at once afterwards. */
static void test_without_a_velocity_nothing_stands(void **state)
{
    bool *const unknown[] = {&s.known.claimed, &s.live.moving, &s.doubted};
    for (size_t i = 0; i < sizeof unknown / sizeof unknown[0]; i++) {
        set_up(state);
        *unknown[i] = !*unknown[i];
        assert_int_equal(count(2 * FRAMES_A_SECOND, FOVEA_TRACKING_OK), 0);
        *unknown[i] = !*unknown[i];
        assert_int_equal(count(FRAMES_A_SECOND / 2, FOVEA_TRACKING_OK), 0);
        assert_true(stands(FOVEA_TRACKING_OK));
        *unknown[i] = !*unknown[i];
        assert_false(stands(FOVEA_TRACKING_OK));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_it_stands_by_sound_poses, set_up),
        cmocka_unit_test_setup(test_it_does_not_stand_while_it_sways, set_up),
        cmocka_unit_test_setup(test_a_weak_pose_does_not_stand, set_up),
        cmocka_unit_test_setup(test_without_a_velocity_nothing_stands, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
