/* A frame's pose held by the gyro: the update is that of a Kalman filter, and nothing happens where
 * nothing is measured, where pictures are not trusted, or where both contradict each other. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/vec.h"
#include "odometry/odometry.h"

enum { SIDE = 0, TURN = 4 }; /* x of the position and the turn about y: seen nearly alike */

struct fixture {
    struct fv_odometry odometry;
    struct fv_odometry_state state;
    struct fv_turns turns;
    struct fv_pose_fit fit;
    struct fv_se3 last;
};

/* A frame whose turns are good to .5 mrad, and whose ways sideways hang on them at a depth of 4. */
static void build(struct fixture *f)
{
    memset(f, 0, sizeof *f);
    f->odometry.state = &f->state;
    f->odometry.turns = &f->turns;
    for (int i = 0; i < 6; i++)
        f->fit.information[7 * i] = i < 3 ? 1e8 : 4e6;
    f->fit.information[7 * TURN] = 4e6 + 16e8;
    f->fit.information[6 * SIDE + TURN] = f->fit.information[6 * TURN + SIDE] = -4e8;
    fv_se3_identity(&f->last);
    fv_odometry_hold_turn(&f->odometry, &f->last, &f->fit, true, &f->last);
    assert_true(fabs(f->state.turn.variance - 2.5e-7) < 1e-12);
    f->state.state = FOVEA_TRACKING_OK;
    f->state.turn.rated = true;
    f->state.localise.hint.measured = true;
    fv_turn_begin(&f->state.localise.hint.turned, f->state.localise.hint.gyro.bias);
    f->state.localise.hint.turned.variance = 1e-8;
}

/* A frame that by its matches turned by `rad` about y, where the gyro measured none. */
static struct fv_se3 frame(struct fixture *f, double rad, bool trusted)
{
    const double step[6] = {0, 0, 0, 0, rad, 0};
    struct fv_se3 T = f->last;
    fv_se3_move(&T, step);
    fv_odometry_hold_turn(&f->odometry, &f->last, &f->fit, trusted, &T);
    return T;
}

static double turned(const struct fv_se3 *T)
{
    double r[3];
    fv_so3_log(T->R, r);
    return r[1];
}

static void test_both_count_by_their_variances(void **state)
{
    (void)state;
    struct fixture f;
    build(&f);
    const double own = 2.5e-7, measured = 2.5e-7 + 1e-8, kept = own / (own + measured);
    const struct fv_se3 T = frame(&f, 1e-3, true);
    assert_true(fabs(turned(&T) - 1e-3 * (1 - kept)) < 1e-6);
    /* what looked like a turn was a way sideways: the position follows */
    assert_true(fabs(T.t[0] + 4 * 1e-3 * kept) < 1e-5);
    assert_true(fabs(f.state.turn.held[1] + 1e-3 * kept) < 1e-6);
    double seen[9] = {0};
    struct fv_se3 T_world_cam;
    fv_se3_invert(&T, &T_world_cam);
    memcpy(seen, T_world_cam.R, sizeof seen);
    fv_odometry_seen_attitude(&f.odometry, seen);
    const struct fv_se3 alone = {
        {seen[0], seen[1], seen[2], seen[3], seen[4], seen[5], seen[6], seen[7], seen[8]},
        {0, 0, 0}};
    assert_true(fabs(turned(&alone) + 1e-3) < 1e-9); /* of the camera in the world: the other way */
    assert_true(fabs(f.state.turn.variance - own * measured / (own + measured)) < 1e-8);
    f.state.covariance.own_position = 1;
    fv_odometry_reduce_own(&f.odometry);
    /* a third of its variance is that of the way sideways, which hangs on the turn */
    assert_true(f.state.covariance.own_position > 0.7 && f.state.covariance.own_position < 0.75);
}

static void test_what_may_be_wrong_weighs_less(void **state)
{
    (void)state;
    struct fixture f;
    build(&f);
    struct fv_motion_hint *hint = &f.state.localise.hint;
    hint->gyro.bias_sigma = 1e-2; /* over .05 s: half a milliradian */
    for (int i = 0; i < 3; i++)
        hint->turned.by_bias[4 * i] = -0.05;
    const double own = 2.5e-7, measured = 2.5e-7 + 1e-8 + 2.5e-7;
    const struct fv_se3 T = frame(&f, 1e-3, true);
    assert_true(fabs(turned(&T) - 1e-3 * measured / (own + measured)) < 1e-6);
}

/* A clock that is off, while the rate changes; and a bias that an estimate has corrected since. */
static void test_clock_and_bias_count(void **state)
{
    (void)state;
    struct fixture f;
    build(&f);
    struct fv_motion_hint *hint = &f.state.localise.hint;
    hint->gyro.doubt.clock_s = 1e-3;
    hint->rate[1] = 0.5; /* half a milliradian */
    const double own = 2.5e-7, measured = 2.5e-7 + 1e-8 + 2.5e-7;
    struct fv_se3 T = frame(&f, 1e-3, true);
    assert_true(fabs(turned(&T) - 1e-3 * measured / (own + measured)) < 2e-6);
    /* a rate that stays about an axis of the world changes nothing, though the camera turns */
    build(&f);
    const double half[3] = {0, 0.5, 0}, step[6] = {0, 0, 0, 0, 1e-3, 0};
    fv_so3_exp(half, hint->turned.R);
    hint->gyro.doubt.clock_s = 1e-2;
    f.state.turn.rate[0] = 1;
    fv_rotate_back3(hint->turned.R, f.state.turn.rate, hint->rate);
    fv_multiply_back33(hint->turned.R, f.last.R, T.R);
    fv_se3_move(&T, step);
    fv_odometry_hold_turn(&f.odometry, &f.last, &f.fit, true, &T);
    assert_true(fabs(f.state.turn.held[1] + 1e-3 * own / (own + 2.5e-7 + 1e-8)) < 2e-6);
    build(&f);
    for (int i = 0; i < 3; i++)
        hint->turned.by_bias[4 * i] = -0.05;
    hint->gyro.bias[1] = 0.02; /* a turn of R_last_now by -1 mrad, as the frame shows */
    T = frame(&f, 1e-3, true);
    assert_true(fabs(turned(&T) - 1e-3) < 1e-6);
}

static void assert_untouched(struct fixture *f, double rad, bool trusted)
{
    const double step[6] = {0, 0, 0, 0, rad, 0};
    struct fv_se3 alone = f->last;
    fv_se3_move(&alone, step);
    const struct fv_se3 T = frame(f, rad, trusted);
    assert_memory_equal(&T, &alone, sizeof T);
    for (int i = 0; i < 3; i++)
        assert_true(f->state.turn.held[i] == 0);
    f->state.covariance.own_position = 1;
    fv_odometry_reduce_own(&f->odometry);
    assert_true(f->state.covariance.own_position == 1);
}

static void test_frames_alone_count_otherwise(void **state)
{
    (void)state;
    struct fixture f;
    build(&f);
    assert_untouched(&f, 0.02, true); /* a picture that stands, a mount that is wrong */
    assert_true(fabs(f.state.turn.variance - 2.5e-7) < 1e-12);
    build(&f);
    assert_untouched(&f, 1e-3, false);
    assert_true(f.state.turn.variance == 0);
    assert_untouched(&f, 1e-3, true); /* the frame before is not known */
    build(&f);
    f.state.localise.hint.measured = false;
    assert_untouched(&f, 1e-3, true);
    build(&f);
    f.odometry.turns = NULL; /* there is no gyro */
    assert_untouched(&f, 1e-3, true);
    build(&f);
    f.state.turn.rated = false;
    assert_untouched(&f, 1e-3, true);
    build(&f);
    f.state.state = FOVEA_TRACKING_LOST; /* found again: perhaps in another map */
    assert_untouched(&f, 1e-3, true);
    build(&f);
    memset(f.fit.information, 0, sizeof f.fit.information);
    assert_untouched(&f, 1e-3, true);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_both_count_by_their_variances),
        cmocka_unit_test(test_what_may_be_wrong_weighs_less),
        cmocka_unit_test(test_clock_and_bias_count),
        cmocka_unit_test(test_frames_alone_count_otherwise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
