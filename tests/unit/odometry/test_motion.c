/* The motion model: constant speed by time stamps, not by frames. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "odometry/motion.h"

enum { MS = 1000000 };

/* T_cam_world of a camera that turns about y and moves along x, both evenly. */
static struct fv_se3 pose_at(double seconds)
{
    const double turn[3] = {0, 0.4 * seconds, 0};
    struct fv_se3 T;
    fv_so3_exp(turn, T.R);
    T.t[0] = -2 * seconds;
    T.t[1] = T.t[2] = 0;
    return T;
}

static double turned_rad(const struct fv_se3 *A, const struct fv_se3 *B)
{
    struct fv_se3 inverse, between;
    double turn[3];
    fv_se3_invert(A, &inverse);
    fv_se3_compose(B, &inverse, &between);
    fv_so3_log(between.R, turn);
    return sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
}

static void the_step_follows_the_stamps(void **state)
{
    (void)state;
    const struct fv_se3 before = pose_at(0), last = pose_at(0.05);
    struct fv_motion motion;
    fv_motion_note(&motion, &before, 0, &last, 50 * MS);
    for (int ms = 10; ms <= 150; ms += 10) {
        const struct fv_se3 truth = pose_at(0.05 + 0.001 * ms);
        struct fv_se3 T;
        fv_motion_predict(&motion, &last, (50 + ms) * (int64_t)MS, &T);
        assert_true(turned_rad(&T, &truth) < 1e-9);
        for (int k = 0; k < 3; k++) /* the way is straight, so it bends off by a turn's square */
            assert_true(fabs(T.t[k] - truth.t[k]) < 0.01);
    }
}

static void far_ahead_it_stops(void **state)
{
    (void)state;
    const struct fv_se3 before = pose_at(0), last = pose_at(0.05);
    struct fv_motion motion;
    struct fv_se3 forty, later;
    fv_motion_note(&motion, &before, 0, &last, 50 * MS);
    fv_motion_predict(&motion, &last, 2050 * (int64_t)MS, &forty);
    fv_motion_predict(&motion, &last, 9000 * (int64_t)MS, &later);
    assert_memory_equal(&forty, &later, sizeof forty);
}

static void what_is_not_known_stays(void **state)
{
    (void)state;
    const struct fv_se3 before = pose_at(0), last = pose_at(0.05);
    struct fv_motion motion;
    struct fv_se3 T;
    fv_motion_note(&motion, &before, INT64_MIN, &last, INT64_MAX); /* no such interval */
    fv_motion_predict(&motion, &last, 0, &T);
    assert_memory_equal(&T, &last, sizeof T);
    fv_motion_note(&motion, &before, 0, &last, 50 * MS);
    fv_motion_predict(&motion, &last, 50 * MS, &T); /* no time has passed */
    assert_memory_equal(&T, &last, sizeof T);
    fv_motion_forget(&motion);
    fv_motion_predict(&motion, &last, 100 * MS, &T);
    assert_memory_equal(&T, &last, sizeof T);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_step_follows_the_stamps),
        cmocka_unit_test(far_ahead_it_stops),
        cmocka_unit_test(what_is_not_known_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
