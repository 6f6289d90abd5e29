/* The chain of measured turns between keyframes: what is joined, what breaks it, what it forgets.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/se3.h"
#include "map/turns.h"

static const struct fv_gyro_known known = {{0, 0, 0}, 1e-4, {{0}, 0, 0}, 0};
static const double none[3] = {0, 0, 0};

static void follow(struct fv_turns *turns, double about_z)
{
    const double by[3] = {0, 0, about_z};
    struct fv_turn turn;
    fv_turn_begin(&turn, none);
    fv_so3_exp(by, turn.R);
    turn.variance = 1e-8;
    fv_turns_follow(turns, &turn, &known);
}

static double turned(const struct fv_turn *turn)
{
    double r[3];
    fv_so3_log(turn->R, r);
    return r[2];
}

static void test_frames_between_keyframes_are_joined(void **state)
{
    (void)state;
    struct fv_turns turns = {0};
    struct fv_turn turn;
    follow(&turns, 9); /* leads to the first keyframe, from none */
    fv_turns_keyframe(&turns, 10);
    follow(&turns, 0.1);
    follow(&turns, 0.2);
    fv_turns_keyframe(&turns, 11);
    follow(&turns, 0.05);
    fv_turns_keyframe(&turns, 13);
    assert_true(fv_turns_between(&turns, 10, 11, &turn));
    assert_true(fabs(turned(&turn) - 0.3) < 1e-12 && fabs(turn.variance - 2e-8) < 1e-14);
    assert_true(fv_turns_between(&turns, 10, 13, &turn)); /* 11 may be gone from the map */
    assert_true(fabs(turned(&turn) - 0.35) < 1e-12 && fabs(turn.variance - 3e-8) < 1e-14);
    assert_false(fv_turns_between(&turns, 10, 12, &turn));
    assert_false(fv_turns_between(&turns, 9, 11, &turn));
    assert_false(fv_turns_between(&turns, 11, 11, &turn));
    assert_true(turns.gyro.bias_sigma == known.bias_sigma);
    fv_turns_forget(&turns);
    assert_false(fv_turns_between(&turns, 10, 11, &turn));
}

static void test_a_frame_without_a_turn_breaks_the_chain(void **state)
{
    (void)state;
    struct fv_turns turns = {0};
    struct fv_turn turn;
    fv_turns_keyframe(&turns, 1);
    follow(&turns, 0.1);
    fv_turns_follow(&turns, NULL, NULL);
    assert_true(turns.gyro.bias_sigma == 0); /* nothing is used until turns are measured again */
    follow(&turns, 0.1);
    assert_true(turns.gyro.bias_sigma == known.bias_sigma);
    fv_turns_keyframe(&turns, 2);
    follow(&turns, 0.1);
    fv_turns_keyframe(&turns, 3);
    assert_false(fv_turns_between(&turns, 1, 2, &turn));
    assert_false(fv_turns_between(&turns, 1, 3, &turn));
    assert_true(fv_turns_between(&turns, 2, 3, &turn));
}

/* Samples of another clock, and a bias that is not zero. */
static void test_turns_of_another_clock_are_forgotten(void **state)
{
    (void)state;
    const struct fv_gyro_known moved = {{0.1, 0, 0}, 1e-4, {{0}, 0, 0}, 2000000};
    struct fv_turns turns = {0};
    struct fv_turn turn, next;
    fv_turns_keyframe(&turns, 1);
    follow(&turns, 0.1);
    fv_turns_keyframe(&turns, 2);
    assert_true(fv_turns_between(&turns, 1, 2, &turn));
    fv_turn_begin(&next, moved.bias);
    next.by_bias[0] = -0.05;
    fv_turns_follow(&turns, &next, &moved);
    assert_false(fv_turns_between(&turns, 1, 2, &turn));
    fv_turns_keyframe(&turns, 3);
    assert_false(fv_turns_between(&turns, 2, 3, &turn));
    fv_turns_follow(&turns, &next, &moved);
    fv_turns_keyframe(&turns, 4);
    assert_true(fv_turns_between(&turns, 3, 4, &turn));
    assert_true(turn.bias[0] == 0.1 &&
                turn.R[0] == 1); /* by the bias that the samples were rid of */
}

static void test_the_oldest_are_forgotten(void **state)
{
    (void)state;
    struct fv_turns turns = {0};
    struct fv_turn turn;
    for (uint64_t number = 0; number < FV_TURNS_MAX + 5; number++) {
        fv_turns_keyframe(&turns, number);
        follow(&turns, 0.01);
    }
    assert_false(fv_turns_between(&turns, 3, 4, &turn));
    assert_true(fv_turns_between(&turns, 4, FV_TURNS_MAX + 4, &turn));
    assert_true(fabs(turned(&turn) - 0.01 * FV_TURNS_MAX) < 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_between_keyframes_are_joined),
        cmocka_unit_test(test_a_frame_without_a_turn_breaks_the_chain),
        cmocka_unit_test(test_turns_of_another_clock_are_forgotten),
        cmocka_unit_test(test_the_oldest_are_forgotten),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
