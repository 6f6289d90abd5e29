/* Bearings from the table against the camera model's own iteration, and many at a time against one
 * by one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "base/elementary.h"
#include "geometry/bearing.h"

enum { CAMERAS = 5, POINTS = 4001 };

/* What the table may be off from the model. In the last part of its field, where distortion is
 * about to fold back, a lens has next to no derivative, and one Newton step is not enough. */
static const double inner_part = 0.85, error_max_px = 1e-4, edge_error_max_px = 0.1;

/* EuRoC, KITTI, a rational lens, TUM VI's fisheye, and one calibrated wider than its polynomial
 * holds. */
static const struct fovea_camera cameras[CAMERAS] = {
    {752,
     480,
     FOVEA_LENS_RADTAN,
     458.654,
     457.296,
     367.215,
     248.375,
     {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
     0},
    {1241, 376, FOVEA_LENS_RADTAN, 718.856, 718.856, 607.1928, 185.2157, {0}, 0},
    {1280,
     720,
     FOVEA_LENS_RADTAN,
     1020,
     1015,
     640,
     360,
     {0.3, -0.02, 0.001, -0.0007, 0.001, 0.6, 0.05, 0.002},
     0},
    {512,
     512,
     FOVEA_LENS_EQUIDISTANT,
     190.978,
     190.973,
     254.932,
     256.897,
     {0.0034824, 0.000715, -0.0020532, 0.00020294},
     0},
    {960,
     600,
     FOVEA_LENS_EQUIDISTANT,
     227.37,
     226.55,
     471.42,
     305.64,
     {0.02474, -0.02245, 0.0188, -0.00682},
     0},
};

struct table {
    struct fovea_camera camera;
    struct fv_bearing_table bearings;
    void *memory;
};

static void carve(void *context, struct fv_arena *arena)
{
    struct table *table = context;
    fv_bearing_carve(&table->bearings, table->camera.width, table->camera.height, arena);
}

static void make_table(struct table *table, const struct fovea_camera *camera)
{
    struct fovea_error error;
    table->camera = *camera;
    if (fovea_camera_prepare(&table->camera, &error) != FOVEA_OK) fail_msg("%s", error.text);
    table->memory = carved(carve, table);
    fv_bearing_init(&table->bearings, &table->camera);
}

static double distance_px(const struct fovea_camera *camera, const double bearing[3],
                          const double pixel[2])
{
    double at[2];
    if (fovea_camera_project(camera, bearing, at, NULL) != FOVEA_OK) return INFINITY;
    return sqrt((at[0] - pixel[0]) * (at[0] - pixel[0]) + (at[1] - pixel[1]) * (at[1] - pixel[1]));
}

/* A undoes what the model's own derivative of the bearing by the pixel does, and gives nothing
 * along the bearing. */
static void check_derivative(const struct fovea_camera *camera, const double pixel[2],
                             const double bearing[3], const double A[6])
{
    double exact[3], D[6];
    assert_int_equal(fovea_camera_unproject(camera, pixel, exact, D), FOVEA_OK);
    for (int row = 0; row < 2; row++) {
        double along = 0;
        for (int k = 0; k < 3; k++)
            along += A[3 * row + k] * bearing[k];
        assert_true(fabs(along) < 1e-9 * camera->fx);
        for (int column = 0; column < 2; column++) {
            double product = 0;
            for (int k = 0; k < 3; k++)
                product += A[3 * row + k] * D[2 * k + column];
            assert_true(fabs(product - (row == column)) < 2e-3);
        }
    }
}

static void bearings_are_the_models(void **state)
{
    (void)state;
    for (int c = 0; c < CAMERAS; c++) {
        struct table table;
        make_table(&table, &cameras[c]);
        struct fv_random random;
        fv_random_seed(&random, (uint64_t)c);
        double worst = 0, edge = 0;
        int seen = 0;
        for (int i = 0; i < POINTS; i++) {
            const double pixel[2] = {(cameras[c].width - 1) * fv_random_unit(&random),
                                     (cameras[c].height - 1) * fv_random_unit(&random)};
            double bearing[3], A[6], exact[3], J[6];
            if (!fv_bearing_of(&table.bearings, &table.camera, pixel[0], pixel[1], bearing, A))
                continue;
            seen++;
            assert_int_equal(fovea_camera_unproject(&table.camera, pixel, exact, J), FOVEA_OK);
            const double off = distance_px(&table.camera, bearing, pixel);
            edge = fmax(edge, off);
            if (exact[2] < cos(inner_part * table.camera.field_max_rad)) continue;
            worst = fmax(worst, off);
            check_derivative(&table.camera, pixel, bearing, A);
        }
        printf("lens %d: %d of %d seen, off by at most %.1e px, at the edge of the field %.1e px\n",
               c, seen, POINTS, worst, edge);
        assert_true(worst < error_max_px && edge < edge_error_max_px);
        assert_true(seen > POINTS / 3);
        free(table.memory);
    }
}

/* Pixels within and outside the image, and some that are no numbers. */
static void fill_pixels(float (*pixels)[2], const struct fovea_camera *camera)
{
    struct fv_random random;
    fv_random_seed(&random, 5);
    for (int i = 0; i < POINTS; i++) {
        pixels[i][0] = (float)(camera->width * (1.2 * fv_random_unit(&random) - 0.1));
        pixels[i][1] = (float)(camera->height * (1.2 * fv_random_unit(&random) - 0.1));
    }
    pixels[17][0] = NAN;
    pixels[40][1] = INFINITY;
    pixels[41][0] = -1e30f;
}

static void many_equal_one_by_one(void **state)
{
    (void)state;
    static float pixels[POINTS][2];
    static struct fv_ray rays[POINTS];
    for (int c = 0; c < CAMERAS; c++) {
        struct table table;
        make_table(&table, &cameras[c]);
        fill_pixels(pixels, &table.camera);
        fv_bearings_of(&table.bearings, &table.camera, (const float(*)[2])pixels, POINTS, rays);
        int seen = 0;
        for (int i = 0; i < POINTS; i++) {
            struct fv_ray one;
            one.seen = fv_bearing_of(&table.bearings, &table.camera, (double)pixels[i][0],
                                     (double)pixels[i][1], one.bearing, one.A);
            assert_int_equal(one.seen, rays[i].seen);
            if (!one.seen) continue;
            seen++;
            for (int k = 0; k < 3; k++)
                assert_true(one.bearing[k] == rays[i].bearing[k]);
            for (int k = 0; k < 6; k++)
                assert_true(one.A[k] == rays[i].A[k]);
        }
        assert_true(seen > POINTS / 4 && seen < POINTS);
        free(table.memory);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bearings_are_the_models),
        cmocka_unit_test(many_equal_one_by_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
