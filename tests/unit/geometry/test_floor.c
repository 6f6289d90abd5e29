/* The floor below a camera: synthetic truth at 0, 30 and 50 % outliers, a table in the way, and
 * clouds without a floor. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>

#include "geometry/floor.h"
#include "geometry/vec.h"

enum { COUNT = 300, SAMPLES = 96 };

static const struct fv_floor_prior prior = {{0, 1, 0}, 0.05, 0.2};

static double uniform(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

/* A point on the plane down p = height, ahead of the camera, its distance wrong by about `sigma`,
 * relative. */
static void floor_point(struct fv_random *random, const double down[3], double height, double sigma,
                        struct fv_floor_point *point)
{
    double ray[3];
    do {
        ray[0] = uniform(random, -.7, .7);
        ray[1] = uniform(random, .05, .7);
        ray[2] = 1;
    } while (fv_dot3(down, ray) < 0.07);
    double distance = height / fv_dot3(down, ray) * (1 + sigma * fv_random_normal(random));
    for (int i = 0; i < 3; i++)
        point->p[i] = distance * ray[i];
    point->sigma = sigma + 0.005;
}

/* Above the floor: on walls and furniture, `low` to `high` of the height below the camera. */
static void other_point(struct fv_random *random, double height, double low, double high,
                        struct fv_floor_point *point)
{
    point->p[2] = height * uniform(random, 1.5, 9);
    point->p[0] = point->p[2] * uniform(random, -.7, .7);
    point->p[1] = height * uniform(random, low, high);
    point->sigma = 0.03;
}

static void floors_are_found_among_outliers(void **state)
{
    (void)state;
    static const double fractions[] = {0, .3, .5};
    for (int s = 0; s < 3; s++) {
        double worst_height = 0, worst_angle = 0, squares = 0;
        for (uint64_t seed = 1; seed <= 50; seed++) {
            struct fv_random random;
            struct fv_floor_point points[COUNT];
            struct fv_floor plane;
            fv_random_seed(&random, seed);
            double down[3] = {uniform(&random, -.06, .06), 1, uniform(&random, -.06, .06)};
            double height = uniform(&random, 0.2, 2);
            (void)fv_normalise3(down);
            for (int i = 0; i < COUNT; i++) {
                if (fv_random_unit(&random) < fractions[s])
                    other_point(&random, height, .1, .95, &points[i]);
                else
                    floor_point(&random, down, height, 0.03, &points[i]);
            }
            assert_true(fv_floor_estimate(points, COUNT, &prior, SAMPLES, 20, &random, &plane));
            double off = plane.height / height - 1;
            worst_height = fmax(worst_height, fabs(off));
            worst_angle = fmax(worst_angle, acos(fmin(1, fv_dot3(down, plane.down))));
            squares += off * off / (plane.sigma * plane.sigma);
        }
        printf(
            "outliers %.0f %%: worst height %.2f %%, angle %.2f deg; squared error over variance %.2f\n",
            100 * fractions[s], 100 * worst_height, worst_angle * 180 / FV_PI, squares / 50);
        assert_true(worst_height < 0.05 && worst_angle < 0.03);
    }
}

/* More points lie on the table than on the floor; the floor is what has nothing below it. */
static void a_table_is_no_floor(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 50; seed++) {
        struct fv_random random;
        struct fv_floor_point points[COUNT];
        struct fv_floor plane;
        fv_random_seed(&random, seed);
        for (int i = 0; i < COUNT; i++)
            floor_point(&random, prior.down, i % 5 < 3 ? 0.9 : 1.6, 0.02, &points[i]);
        assert_true(fv_floor_estimate(points, COUNT, &prior, SAMPLES, 20, &random, &plane));
        assert_true(fabs(plane.height / 1.6 - 1) < 0.03);
    }
}

static void no_floor_is_made_up(void **state)
{
    (void)state;
    int found = 0;
    for (uint64_t seed = 1; seed <= 50; seed++) {
        struct fv_random random;
        struct fv_floor_point points[COUNT];
        struct fv_floor plane = {.height = -1};
        fv_random_seed(&random, seed);
        for (int i = 0; i < COUNT; i++)
            other_point(&random, 1.5, .2, 4, &points[i]); /* a cloud below, of no shape */
        found += fv_floor_estimate(points, COUNT, &prior, SAMPLES, 20, &random, &plane);
        assert_true(
            !fv_floor_estimate(points, 19, &prior, SAMPLES, 20, &random, &plane)); /* too few */
    }
    printf("floors found in clouds: %d of 50\n", found);
    assert_true(found <= 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(floors_are_found_among_outliers),
        cmocka_unit_test(a_table_is_no_floor),
        cmocka_unit_test(no_floor_is_made_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
