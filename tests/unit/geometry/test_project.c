/* Points that are projected side by side: the pixels, and the refusals, of fovea_camera_project. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "geometry/project.h"

static struct fv_random random_state;

/* In all directions, some of them behind the camera, on its axis and in its plane. */
static void draw_points(fv_pair points[3][FV_PROJECT_PAIRS])
{
    for (int i = 0; i < 2 * FV_PROJECT_PAIRS; i++) {
        const bool axis = fv_random_below(&random_state, 20) == 0,
                   plane = fv_random_below(&random_state, 20) == 0;
        for (int k = 0; k < 3; k++) {
            const double value = 0.01 * ((double)fv_random_below(&random_state, 401) - 200);
            points[k][i / 2][i % 2] = (axis && k < 2) || (plane && k == 2) ? 0 : value;
        }
    }
}

static void expect_the_same(const struct fovea_camera *camera, int *seen_of, int *refused_of)
{
    const struct fv_project project = fv_project_of(camera);
    fv_pair points[3][FV_PROJECT_PAIRS], pixels[2][FV_PROJECT_PAIRS];
    fv_flags seen[FV_PROJECT_PAIRS];
    draw_points(points);
    fv_project_points(&project, points, pixels, seen);
    for (int i = 0; i < 2 * FV_PROJECT_PAIRS; i++) {
        const int pair = i / 2, lane = i % 2;
        const double p[3] = {points[0][pair][lane], points[1][pair][lane], points[2][pair][lane]};
        double pixel[2];
        const bool good = fovea_camera_project(camera, p, pixel, NULL) == FOVEA_OK;
        assert_int_equal(seen[pair][lane], good ? -1 : 0);
        *(good ? seen_of : refused_of) += 1;
        for (int k = 0; good && k < 2; k++) {
            const double got = pixels[k][pair][lane];
            assert_memory_equal(&got, &pixel[k], sizeof got);
        }
    }
}

static void pixels_are_those_of_one_at_a_time(void **state)
{
    (void)state;
    enum { ROUNDS = 2000 };
    static const struct fovea_camera cameras[] = {
        {640, 480, FOVEA_LENS_RADTAN, 500, 510, 320, 240, {0}, 0},
        {640, 480, FOVEA_LENS_RADTAN, 500, 510, 320, 240, {-0.28, 0.07, 2e-4, -3e-4, 0.01}, 0},
        {640,
         480,
         FOVEA_LENS_RADTAN,
         500,
         510,
         320,
         240,
         {0.3, -0.1, 1e-3, 2e-3, 0, 0.4, 0.1, 0},
         0},
        {640, 480, FOVEA_LENS_EQUIDISTANT, 250, 250, 320, 240, {0.02, -0.01, 0.003, 0}, 0},
    };
    fv_random_seed(&random_state, 1);
    for (size_t c = 0; c < sizeof cameras / sizeof *cameras; c++) {
        struct fovea_camera camera = cameras[c];
        int seen = 0, refused = 0;
        assert_int_equal(fovea_camera_prepare(&camera, NULL), FOVEA_OK);
        for (int i = 0; i < ROUNDS; i++)
            expect_the_same(&camera, &seen, &refused);
        assert_true(seen > ROUNDS && refused > 10);
    }
}

/* Of whatever lens. */
static void what_is_no_number_is_refused(void **state)
{
    (void)state;
    const double inf = __builtin_inf(), nan = __builtin_nan(""),
                 wrong[][3] = {{nan, 0, 1},   {0, nan, 1},   {0, 0, nan},
                               {inf, 0, inf}, {inf, inf, 1}, {0, 0, -inf}};
    for (int lens = 0; lens < 2; lens++) {
        struct fovea_camera camera = {
            .width = 640, .height = 480, .fx = 300, .fy = 300, .cx = 320, .cy = 240};
        camera.lens = lens == 0 ? FOVEA_LENS_RADTAN : FOVEA_LENS_EQUIDISTANT;
        assert_int_equal(fovea_camera_prepare(&camera, NULL), FOVEA_OK);
        const struct fv_project project = fv_project_of(&camera);
        for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
            fv_pair points[3][FV_PROJECT_PAIRS], pixels[2][FV_PROJECT_PAIRS];
            fv_flags seen[FV_PROJECT_PAIRS];
            double pixel[2];
            for (int k = 0; k < 3; k++)
                for (int pair = 0; pair < FV_PROJECT_PAIRS; pair++)
                    points[k][pair] = (fv_pair){wrong[i][k], wrong[i][k]};
            fv_project_points(&project, points, pixels, seen);
            assert_int_equal(fovea_camera_project(&camera, wrong[i], pixel, NULL),
                             FOVEA_ERROR_ARGUMENT);
            assert_int_equal(seen[0][0], 0);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pixels_are_those_of_one_at_a_time),
        cmocka_unit_test(what_is_no_number_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
