/* Places of objects in metres: by a known height, by the floor. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "common/object_rig.h"

/* A ball 0.5 m high flies past a camera that moves; its place, velocity and covariance must hold
 * the truth. */
static void places_are_in_metres(void **state)
{
    (void)state;
    config.height_m[0] = 0.5f;
    make();
    struct fovea_objects t = {0};
    double truth[3] = {0};
    for (int f = 0; f < 60; f++) {
        struct fv_objects_inference l = {
            .stamp_ns = (int64_t)(f + 1) * 33333333,
            .posed = true,
            .metric = true,
            .T_world_cam = {1, 0, 0, 0.01 * f, 0, 1, 0, 0, 0, 0, 1, 0}};
        truth[0] = -1 + 0.03 * f;
        truth[1] = 0.3;
        truth[2] = 5 - 0.02 * f;
        const double p[3] = {truth[0] - 0.01 * f, truth[1], truth[2]},
                     top[3] = {p[0], p[1] - 0.25, p[2]}, low[3] = {p[0], p[1] + 0.25, p[2]};
        double a[2], b[2];
        fovea_camera_project(&camera, top, a, NULL);
        fovea_camera_project(&camera, low, b, NULL);
        const struct fovea_detection d =
            box(a[0], 0.5 * (a[1] + b[1]), b[1] - a[1], b[1] - a[1], 0.9);
        l.detections = &d;
        l.count = 1;
        fv_objects_update(&pool, &l);
        fv_objects_get(&pool, &t);
    }
    assert_int_equal(t.list[0].located, FOVEA_OBJECT_LOCATED_WORLD);
    static const int diagonal[3] = {0, 3, 5};
    static const double v_truth[3] = {0.9, 0, -0.6};
    for (int i = 0; i < 3; i++) {
        const double sigma = __builtin_sqrt(t.list[0].covariance_m2[diagonal[i]]),
                     off = t.list[0].position_m[i] - truth[i];
        if (!(off * off < 9 * sigma * sigma && sigma < 0.5))
            fail_msg("axis %d: off by %g m, sigma %g m", i, off, sigma);
        const double v_sigma = __builtin_sqrt(t.list[0].velocity_covariance_m2_s2[diagonal[i]]),
                     v_off = t.list[0].velocity_m_s[i] - v_truth[i];
        if (!(v_off * v_off < 9 * v_sigma * v_sigma && v_sigma < 1))
            fail_msg("axis %d: off by %g m/s, sigma %g m/s", i, v_off, v_sigma);
        assert_true(0.5 * v_sigma >
                    sigma); /* who may change his pace is known by the last half second at most */
    }
    assert_true(__builtin_fabs(t.list[0].velocity_m_s[0] - 0.9) < 0.2 &&
                __builtin_fabs(t.list[0].velocity_m_s[2] + 0.6) < 0.3);
    config.height_m[0] = 0;
    free(block);
}

static void the_floor_gives_a_place(void **state)
{
    (void)state;
    /* Base: x forward, y left, z up; the camera one metre over the floor, level. */
    const double level[12] = {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 1.0};
    memcpy(T_body_cam, level, sizeof level);
    config.ground = true;
    make();
    const double foot[3] = {0.5, 1.0, 4.0}; /* camera frame: on the floor, 4 m ahead */
    double pixel[2];
    fovea_camera_project(&camera, foot, pixel, NULL);
    const struct fovea_detection d = box(pixel[0], pixel[1] - 40, 30, 80, 0.9);
    const struct fovea_objects t = infer(0, &d, 1);
    assert_int_equal(t.list[0].located, FOVEA_OBJECT_LOCATED_CAMERA);
    for (int i = 0; i < 3; i++)
        assert_true(__builtin_fabs(t.list[0].position_m[i] - foot[i]) < 0.01);
    assert_true(t.list[0].covariance_m2[5] >
                t.list[0].covariance_m2[0]); /* depth is less certain */
    config.ground = false;
    const double still[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    memcpy(T_body_cam, still, sizeof still);
    free(block);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_are_in_metres),
        cmocka_unit_test(the_floor_gives_a_place),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
