/* Bias of a map's motion: a motion that is off alike in pair after pair is found, and the fit
 * behind it comes to the truth; a right one, one whose errors are each pair's own, and one that is
 * off by less than matters are not. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "base/elementary.h"
#include "geometry/vec.h"
#include "odometry/motion_bias.h"

enum { MATCHES = 160, WRONG = 24, PAIRS = 8 };
enum quality { NOISY, EXACT };
#define FOCAL_PX 700.0

static struct fv_motion_bias_match matches[MATCHES];
static struct fv_random random_numbers;

static double draw(double low, double high)
{
    return low + (high - low) * fv_random_unit(&random_numbers);
}

/* About a third of a pixel, either way. */
static double noise(void)
{
    return (draw(-0.5, 0.5) + draw(-0.5, 0.5)) / FOCAL_PX;
}

/* The true motion of a car's camera: 2 m ahead, in a slight bend. */
static void true_motion(struct fv_se3 *T)
{
    const double turn[3] = {0.001, -0.02, 0.002};
    fv_so3_exp(turn, T->R);
    T->t[0] = 0.03;
    T->t[1] = 0;
    T->t[2] = -2;
}

static void unit_bearing(const double p[3], enum quality quality, float x[3])
{
    double q[3] = {p[0] / p[2], p[1] / p[2], 1};
    for (int k = 0; k < 2 && quality == NOISY; k++)
        q[k] += noise();
    (void)fv_normalise3(q);
    for (int k = 0; k < 3; k++)
        x[k] = (float)q[k];
}

/* Points 6 to 60 m ahead, and some matches that are none. */
static void make_pair(const struct fv_se3 *T, enum quality quality)
{
    for (int i = 0; i < MATCHES; i++) {
        const double z = draw(6, 60), p[3] = {draw(-0.8, 0.8) * z, draw(-0.25, 0.25) * z, z};
        double q[3];
        fv_se3_apply(T, p, q);
        if (i < WRONG && quality == NOISY) q[0] += 0.2 * z, q[1] -= 0.1 * z;
        unit_bearing(p, quality, matches[i].x1);
        unit_bearing(q, quality, matches[i].x2);
        matches[i].weight = 1;
    }
}

/* The map's motion of a pair: the true one, turned about the vertical and its way bent to the side
 * so that points at 20 m hardly tell. */
static void map_motion(const struct fv_se3 *T, double turn_rad, struct fv_se3 *map)
{
    const double turn[3] = {0, turn_rad, 0};
    double exp[9];
    fv_so3_exp(turn, exp);
    fv_multiply33(exp, T->R, map->R);
    fv_copy3(T->t, map->t);
    map->t[0] -= 20 * turn_rad;
}

/* Pairs whose maps are off by what `turns` says; the state behind them. */
static void run(const double turns[PAIRS], struct fv_motion_bias_state *s)
{
    int far = 0;
    fv_random_seed(&random_numbers, 5);
    fv_motion_bias_forget(s);
    for (int n = 0; n < PAIRS; n++) {
        struct fv_se3 T, map;
        uint32_t units = 1;
        true_motion(&T);
        make_pair(&T, NOISY);
        map_motion(&T, turns[n], &map);
        assert_true(fv_motion_bias_begin(s, &map, false));
        while (!fv_motion_bias_unit(s, matches, MATCHES, FOCAL_PX))
            units++;
        assert_int_equal(units, 4);
        (void)fv_normalise3(T.t);
        double off[3];
        fv_subtract3(s->fit.t, T.t, off);
        far += fv_norm3(off) > 0.01; /* rad */
    }
    assert_true(far <= 2);
    assert_true(s->evidence >= 0);
    printf("evidence %.1f, turned way %.3f rad\n", s->evidence, fv_norm3(s->way) / s->pairs);
}

static void a_lasting_error_is_found(void **state)
{
    (void)state;
    static const double turns[PAIRS] = {0.008, 0.008, 0.009, 0.008, 0.007, 0.008, 0.008, 0.009};
    struct fv_motion_bias_state s;
    run(turns, &s);
    assert_true(fv_motion_bias_found(&s));
    assert_false(fv_motion_bias_clear(&s));
    assert_true(fv_norm3(s.way) / s.pairs > 0.06 && fv_norm3(s.turn) / s.pairs > 0.006);
    s.evidence = 50; /* enough of a young map */
    assert_true(fv_motion_bias_found(&s));
    s.seen = 13;
    assert_false(fv_motion_bias_found(&s));
    fv_motion_bias_forget(&s);
    assert_false(fv_motion_bias_found(&s));
    assert_true(fv_motion_bias_clear(&s));
}

static void a_right_motion_is_not(void **state)
{
    (void)state;
    static const double turns[PAIRS] = {0};
    struct fv_motion_bias_state s;
    run(turns, &s);
    assert_false(fv_motion_bias_found(&s));
    assert_true(fv_motion_bias_clear(&s));
    assert_true(s.evidence < 5);
}

/* As large as those that are found, but each pair's own. */
static void errors_of_single_pairs_are_not(void **state)
{
    (void)state;
    static const double turns[PAIRS] = {0.008, -0.008, -0.007, 0.009, -0.009, 0.008, 0.007, -0.008};
    struct fv_motion_bias_state s;
    run(turns, &s);
    assert_false(fv_motion_bias_found(&s));
    assert_true(s.evidence < 5);
}

/* Evidence of a small one keeps a suspect map back, and ends none. */
static void a_small_error_matters_not(void **state)
{
    (void)state;
    static const double turns[PAIRS] = {0.003, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003};
    struct fv_motion_bias_state s;
    run(turns, &s);
    assert_false(fv_motion_bias_found(&s));
    assert_false(fv_motion_bias_clear(&s));
}

/* Where a gyro has measured the turns, a way that is off is found all the same, and a turn that the
 * pictures ask for together with another way is none of the map's errors. */
static void measured_turns_are_left_alone(void **state)
{
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        struct fv_motion_bias_state s;
        fv_random_seed(&random_numbers, 9);
        fv_motion_bias_forget(&s);
        for (int n = 0; n < PAIRS; n++) {
            struct fv_se3 T, map;
            true_motion(&T);
            make_pair(&T, NOISY);
            map = T;
            if (turned)
                map_motion(&T, 0.008, &map);
            else
                map.t[0] += 0.1 * map.t[2];
            assert_true(fv_motion_bias_begin(&s, &map, true));
            while (!fv_motion_bias_unit(&s, matches, MATCHES, FOCAL_PX))
                continue;
            for (int k = 0; k < 9; k++)
                assert_true(fabs(s.fit.R[k] - map.R[k]) < 1e-12);
        }
        printf("evidence %.1f, way %.3f, turn %.1e rad\n", s.evidence, fv_norm3(s.way) / s.pairs,
               fv_norm3(s.turn) / s.pairs);
        assert_true(fv_motion_bias_found(&s) == !turned);
        assert_true(fv_norm3(s.turn) < 1e-9);
    }
}

/* A turn that pairs before asked for, which nobody had measured, is not tried on one that is. */
static void a_measured_turn_is_not_tried_otherwise(void **state)
{
    (void)state;
    const double off[3] = {0, 0.008, 0};
    double turn[9];
    for (uint32_t held = 0; held < 2; held++) {
        struct fv_motion_bias_state s;
        struct fv_se3 T, map;
        fv_random_seed(&random_numbers, 9);
        fv_motion_bias_forget(&s);
        s.pairs = 1;
        s.turn[1] = -0.016;
        true_motion(&T);
        make_pair(&T, EXACT);
        map = T;
        fv_so3_exp(off, turn);
        fv_multiply33(turn, T.R, map.R);
        assert_true(fv_motion_bias_begin(&s, &map, held != 0));
        (void)fv_motion_bias_unit(&s, matches, MATCHES, FOCAL_PX);
        assert_true((s.evidence > 1) == (held == 0));
        assert_true(held == 0 || s.evidence < 1e-6);
    }
}

/* One pair of exact matches, from a map's motion on. */
static void exact_pair(const struct fv_se3 *map, struct fv_motion_bias_state *s)
{
    struct fv_se3 T;
    true_motion(&T);
    make_pair(&T, EXACT);
    assert_true(fv_motion_bias_begin(s, map, false));
    while (!fv_motion_bias_unit(s, matches, MATCHES, FOCAL_PX))
        continue;
}

/* From a motion that is off in all that it has, about the way that it goes too. */
static void a_fit_comes_to_the_truth(void **state)
{
    (void)state;
    const double step[6] = {0.05, -0.04, 0, 0.004, -0.005, 0.02};
    struct fv_motion_bias_state s;
    struct fv_se3 T, map, inverse, off;
    double left[3], way[3];
    fv_random_seed(&random_numbers, 6);
    fv_motion_bias_forget(&s);
    true_motion(&T);
    map = T;
    fv_se3_move(&map, step);
    exact_pair(&map, &s);
    (void)fv_normalise3(T.t);
    fv_se3_invert(&T, &inverse);
    fv_se3_compose(&s.fit, &inverse, &off);
    fv_so3_log(off.R, left);
    fv_subtract3(s.fit.t, T.t, way);
    printf("off by %.1e rad and %.1e rad of the way\n", fv_norm3(left), fv_norm3(way));
    assert_true(fv_norm3(left) < 1e-5 && fv_norm3(way) < 1e-5);
}

/* Half of an error that lasts takes three quarters of a cost that is quadratic; what it took fades
 * by .7 a pair. The correction is the mean of those before. */
static void evidence_is_what_half_takes_of_the_cost(void **state)
{
    (void)state;
    struct fv_motion_bias_state s;
    struct fv_se3 T, map;
    double expected = 0;
    fv_random_seed(&random_numbers, 7);
    fv_motion_bias_forget(&s);
    true_motion(&T);
    map_motion(&T, 0.001, &map);
    for (int n = 0; n < 4; n++) {
        exact_pair(&map, &s);
        expected = 0.7 * expected + (n > 0 ? 0.75 * s.cost : 0);
        assert_true(s.cost > 1);
        assert_true(fabs(s.evidence - expected) <= 0.06 * expected);
    }
}

/* The way back has the same epipolar lines, and all points behind the camera. */
static void the_way_back_fits_nothing(void **state)
{
    (void)state;
    struct fv_motion_bias_state s;
    struct fv_se3 T;
    fv_random_seed(&random_numbers, 8);
    fv_motion_bias_forget(&s);
    true_motion(&T);
    exact_pair(&T, &s);
    assert_true(s.cost < 1e-3);
    for (int k = 0; k < 3; k++)
        T.t[k] = -T.t[k];
    exact_pair(&T, &s);
    assert_true(s.cost > MATCHES);
}

static void nothing_is_fitted_without_a_way(void **state)
{
    (void)state;
    struct fv_se3 T;
    struct fv_motion_bias_state s;
    fv_motion_bias_forget(&s);
    true_motion(&T);
    memset(T.t, 0, sizeof T.t);
    assert_false(fv_motion_bias_begin(&s, &T, false));
    assert_false(fv_motion_bias_found(&s));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lasting_error_is_found),
        cmocka_unit_test(a_right_motion_is_not),
        cmocka_unit_test(errors_of_single_pairs_are_not),
        cmocka_unit_test(a_small_error_matters_not),
        cmocka_unit_test(measured_turns_are_left_alone),
        cmocka_unit_test(a_measured_turn_is_not_tried_otherwise),
        cmocka_unit_test(a_fit_comes_to_the_truth),
        cmocka_unit_test(evidence_is_what_half_takes_of_the_cost),
        cmocka_unit_test(the_way_back_fits_nothing),
        cmocka_unit_test(nothing_is_fitted_without_a_way),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
