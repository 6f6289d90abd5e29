/* Homography: planes and pure rotations, with outliers; decomposition against the true motion. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>

#include "geometry/homography.h"
#include "geometry/vec.h"

enum { COUNT = 300 };

static double uniform(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

/* Points of the plane n p = d (camera 1), n facing the camera, seen from both; `translate` 0: a
 * pure rotation. */
static void make_plane(struct fv_random *random, double outliers, double noise, double translate,
                       struct fv_se3 *T, struct fv_pair *pairs)
{
    double turn[3], n[3] = {uniform(random, -.5, .5), uniform(random, -.5, .5), 1},
                    d = uniform(random, 3, 6);
    for (int i = 0; i < 3; i++)
        turn[i] = uniform(random, -.15, .15);
    fv_so3_exp(turn, T->R);
    for (int i = 0; i < 3; i++)
        T->t[i] = fv_random_normal(random);
    (void)fv_normalise3(T->t);
    (void)fv_normalise3(n);
    for (int i = 0; i < COUNT; i++) {
        double x1[3] = {uniform(random, -.7, .7), uniform(random, -.5, .5), 1}, q[3], rotated[3];
        double depth = d / fv_dot3(n, x1);
        fv_rotate3(T->R, x1, rotated);
        for (int k = 0; k < 3; k++)
            q[k] = depth * rotated[k] + translate * T->t[k];
        (void)fv_normalise3(x1);
        (void)fv_normalise3(q);
        for (int k = 0; k < 3; k++)
            q[k] += noise * fv_random_normal(random);
        if (uniform(random, 0, 1) < outliers) {
            q[0] = uniform(random, -.7, .7);
            q[1] = uniform(random, -.5, .5);
            q[2] = 1;
        }
        (void)fv_normalise3(q);
        fv_copy3(x1, pairs[i].x1);
        fv_copy3(q, pairs[i].x2);
    }
}

static double motion_error(const struct fv_se3 *A, const struct fv_se3 *B)
{
    double w[3], D[9], Rt[9];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            Rt[3 * r + c] = B->R[3 * c + r];
    fv_multiply33(A->R, Rt, D);
    fv_so3_log(D, w);
    return fv_norm3(w) + acos(fmin(1, fv_dot3(A->t, B->t)));
}

static void planes_give_the_motion(void **state)
{
    (void)state;
    const double fractions[] = {0, 0.3, 0.5};
    for (int s = 0; s < 3; s++) {
        struct fv_random random;
        fv_random_seed(&random, 41);
        double worst = 0;
        for (int trial = 0; trial < 100; trial++) {
            struct fv_se3 T, found[4];
            struct fv_pair pairs[COUNT];
            uint8_t inlier[COUNT];
            double H[9], ratio, best = 1e9;
            make_plane(&random, fractions[s], 0.5 / 460, 1, &T, pairs);
            struct fv_sampling sampling = {3.0 / 460, 0.999, 300};
            uint32_t inliers = fv_homography_estimate(pairs, COUNT, &sampling, &random, H, inlier);
            assert_true(inliers > 0.85 * (1 - fractions[s]) * COUNT);
            assert_int_equal(fv_homography_motions(H, found, &ratio), 4);
            assert_true(ratio > 0.1 && ratio < 0.6);
            for (int k = 0; k < 4; k++)
                best = fmin(best, motion_error(&found[k], &T));
            worst = fmax(worst, best);
        }
        printf("outliers %.0f %%: worst motion error %.4f rad\n", 100 * fractions[s], worst);
        assert_true(worst < 0.2);
    }
}

static void a_rotation_is_distinguished_from_a_motion(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 42);
    for (int trial = 0; trial < 100; trial++) {
        struct fv_se3 T, found[4];
        struct fv_pair pairs[COUNT];
        uint8_t inlier[COUNT];
        double H[9], ratio = 1;
        make_plane(&random, 0.3, 0.5 / 460, 0, &T, pairs);
        struct fv_sampling sampling = {3.0 / 460, 0.999, 300};
        assert_true(fv_homography_estimate(pairs, COUNT, &sampling, &random, H, inlier) >
                    0.6 * COUNT);
        (void)fv_homography_motions(H, found, &ratio);
        assert_true(ratio < 0.02);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_give_the_motion),
        cmocka_unit_test(a_rotation_is_distinguished_from_a_motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
