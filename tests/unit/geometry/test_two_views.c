/* What pairs determine, by synthetic scenes whose motion is known: from none to a metre, deep
 * scenes and planes, with and without wrong pairs. Limits were chosen on odd seeds; these are even
 * ones. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/two_views.h"
#include "geometry/vec.h"

enum { COUNT = 400, FOCAL = 500 };

static struct fv_pair pairs[COUNT];
static uint8_t inlier[COUNT], work[COUNT], right[COUNT];

struct scene {
    double baseline, wrong, noise_px;
    bool plane;
};

static void direction(struct fv_random *random, double length, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = fv_random_normal(random);
    (void)fv_normalise3(out);
    for (int i = 0; i < 3; i++)
        out[i] *= length;
}

static void bearing_of(double x_px, double y_px, double out[3])
{
    out[0] = x_px / FOCAL;
    out[1] = y_px / FOCAL;
    out[2] = 1;
    (void)fv_normalise3(out);
}

/* Points of 2 to 10 m, a half of them ten times as far, or of a plane at 4 m; a camera of 640 x 480
 * pixels that turned by 5 degrees. */
static void see(const struct scene *scene, uint64_t seed, struct fv_se3 *T)
{
    struct fv_random random;
    double turn[3];
    fv_random_seed(&random, seed);
    direction(&random, .087, turn);
    fv_so3_exp(turn, T->R);
    direction(&random, scene->baseline, T->t);
    for (int i = 0; i < COUNT;) {
        double u = 640 * fv_random_unit(&random) - 320, v = 480 * fv_random_unit(&random) - 240;
        double z = scene->plane ? 4 / (1 + .3 * u / FOCAL - .2 * v / FOCAL)
                                : 2 + 8 * fv_random_unit(&random);
        if (!scene->plane && fv_random_unit(&random) < .5) z *= 10;
        const double at[3] = {u / FOCAL * z, v / FOCAL * z, z};
        double seen[3];
        fv_rotate3(T->R, at, seen);
        for (int k = 0; k < 3; k++)
            seen[k] += T->t[k];
        double x = FOCAL * seen[0] / seen[2] + scene->noise_px * fv_random_normal(&random),
               y = FOCAL * seen[1] / seen[2] + scene->noise_px * fv_random_normal(&random);
        right[i] = fv_random_unit(&random) >= scene->wrong;
        if (!right[i]) {
            x = 640 * fv_random_unit(&random) - 320;
            y = 480 * fv_random_unit(&random) - 240;
        }
        if (seen[2] < .5 || x < -340 || x > 340 || y < -260 || y > 260) continue;
        u += scene->noise_px * fv_random_normal(&random);
        v += scene->noise_px * fv_random_normal(&random);
        bearing_of(u, v, pairs[i].x1);
        bearing_of(x, y, pairs[i].x2);
        i++;
    }
}

static const struct fv_sampling sampling = {3. / FOCAL, .999, 2000};

/* Share of right pairs that are inliers, and of inliers that are right. */
static void judge(const struct fv_two_views *found, double *recall, double *precision)
{
    uint32_t rights = 0, both = 0, inliers = 0;
    for (int i = 0; i < COUNT; i++) {
        rights += right[i];
        inliers += found->inliers > 0 && inlier[i];
        both += found->inliers > 0 && inlier[i] && right[i];
    }
    assert_int_equal(inliers, found->inliers);
    *recall = (double)both / rights;
    *precision = inliers == 0 ? 0 : (double)both / inliers;
}

typedef void estimate(const struct fv_pair *, uint32_t, const struct fv_sampling *,
                      struct fv_random *, uint8_t *, uint8_t *, struct fv_two_views *);

static struct fv_two_views run(estimate *of, double recall_min, double precision_min)
{
    struct fv_random random;
    struct fv_two_views found;
    double recall, precision;
    fv_random_seed(&random, 20);
    of(pairs, COUNT, &sampling, &random, inlier, work, &found);
    judge(&found, &recall, &precision);
    if (recall < recall_min || precision < precision_min)
        fail_msg("recall %.3f, precision %.3f", recall, precision);
    return found;
}

static void right_pairs_are_kept_at_every_motion(void **state)
{
    static const struct {
        struct scene scene;
        bool turn, flat; /* no more is determined than a rotation, a homography */
    } cases[] = {
        {{0, 0, 0, false}, true, true},      {{0, .3, .5, false}, true, true},
        {{.003, 0, .5, false}, true, true},  {{.01, .3, .5, false}, true, true},
        {{.1, 0, .5, false}, false, false},  {{.1, .3, .5, false}, false, false},
        {{.3, .3, .5, false}, false, false}, {{1, .3, .5, false}, false, false},
        {{0, .3, .5, true}, true, true},     {{.003, .3, .5, true}, true, true},
        {{.3, 0, .5, true}, false, true},    {{1, .3, .5, true}, false, true},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        for (uint64_t seed = 2; seed <= 4; seed += 2) {
            struct fv_se3 T;
            see(&cases[i].scene, seed, &T);
            struct fv_two_views found = run(fv_two_views_essential, .95, .97);
            assert_int_equal(found.simple, cases[i].turn);
            /* A rotation: its own; an essential matrix: that of the motion, of either sign. */
            double E[9], sum = 0;
            for (int k = 0; k < 3; k++)
                T.t[k] /= cases[i].scene.baseline > 0 ? cases[i].scene.baseline : 1;
            fv_essential_from_motion(&T, E);
            for (int k = 0; k < 9; k++)
                sum += found.model[k] * (cases[i].turn ? T.R[k] / 3 : E[k] / 2);
            if (!cases[i].scene.plane && (cases[i].turn || cases[i].scene.baseline >= .3))
                if (__builtin_fabs(sum) < .99) fail_msg("case %zu: %.4f", i, sum);
            found = run(fv_two_views_fundamental, .95, .97);
            assert_int_equal(found.simple, cases[i].flat);
        }
}

/* A distant point is behind the camera by noise half of the time. */
static void distant_points_agree(void **state)
{
    const struct scene scene = {.2, 0, .5, false};
    (void)state;
    struct fv_se3 T;
    see(&scene, 6, &T);
    assert_true(fv_two_views_mark(pairs, COUNT, sampling.threshold_rad, &T, inlier) > .98 * COUNT);
    /* With the motion reversed near points are behind both cameras, and distant ones agree still.
     */
    for (int k = 0; k < 3; k++)
        T.t[k] = -T.t[k];
    const uint32_t kept = fv_two_views_mark(pairs, COUNT, sampling.threshold_rad, &T, inlier);
    assert_in_range(kept, COUNT / 4, COUNT * 3 / 4);
}

static void nothing_is_found_among_wrong_pairs(void **state)
{
    const struct scene scene = {0, 1, 0, false};
    (void)state;
    struct fv_se3 T;
    struct fv_random random;
    struct fv_two_views found;
    see(&scene, 8, &T);
    for (uint32_t count = 0; count < 5; count++) {
        fv_random_seed(&random, 20);
        fv_two_views_essential(pairs, count, &sampling, &random, inlier, work, &found);
        assert_int_equal(found.inliers, 0);
        fv_two_views_fundamental(pairs, count, &sampling, &random, inlier, work, &found);
        assert_int_equal(found.inliers, 0);
        for (int k = 0; k < 9; k++)
            assert_true(found.model[k] == 0);
    }
    fv_random_seed(&random, 20);
    fv_two_views_fundamental(pairs, COUNT, &sampling, &random, inlier, work, &found);
    assert_true(found.inliers < COUNT / 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(right_pairs_are_kept_at_every_motion),
        cmocka_unit_test(distant_points_agree),
        cmocka_unit_test(nothing_is_found_among_wrong_pairs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
