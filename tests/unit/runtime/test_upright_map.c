/* Maps that know of gravity: a run that is given one is metric and upright from its first pose on,
 * with and without an inertial sensor; a run that comes back to one says so at once, and what it
 * knows of the sensor's biases. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "common/sim_body.h"
#include "fovea/fovea.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "map/archive.h"

static struct sim_rig rig;
static fovea_pose_t body;
static uint8_t *saved[2]; /* by a run with an inertial sensor, and by one without */
static size_t saved_bytes[2];

#define SHAPE "width=400&height=300&rate=20&imu=200&gyro_bias=0.02&acceleration_bias=0.05&"

static void open_rig(const char *uri, int start, int frames, enum fovea_sensors sensors)
{
    sim_rig_open(&rig, uri, start, frames);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = sensors;
}

/* The next frame; false at the end. */
static bool next(void)
{
    if (!sim_rig_next(&rig)) return false;
    sim_rig_take_samples(&rig);
    sim_rig_process(&rig);
    sim_body_take(&rig, &body);
    return true;
}

static int save_maps(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        open_rig("sim:orbit?" SHAPE "seed=2", 0, 200,
                 i == 0 ? FOVEA_SENSORS_MONO_INERTIAL : FOVEA_SENSORS_MONO);
        sim_rig_build(&rig);
        while (next())
            continue;
        saved[i] = malloc(fovea_map_bytes_max(&rig.config));
        saved_bytes[i] = fovea_map_save(rig.rt, saved[i], fovea_map_bytes_max(&rig.config));
        sim_rig_close(&rig);
    }
    return saved_bytes[0] > 0 && saved_bytes[1] > 0 ? 0 : -1;
}

static int drop_maps(void **state)
{
    (void)state;
    free(saved[0]);
    free(saved[1]);
    return 0;
}

/* Odom is upright, and gravity within its sigma. */
static void check_upright(int changes)
{
    assert_int_equal(body.scale_state, FOVEA_POSE_T_SCALE_METRIC);
    assert_int_equal(body.scale_source, FOVEA_POSE_T_SOURCE_INERTIAL);
    assert_int_equal(body.change_count, changes);
    assert_true(body.gravity_sigma > 0.001 && body.gravity_sigma < 0.02);
    const double aside = hypot(body.gravity[0], body.gravity[1]) / 9.80665;
    assert_true(aside < 3 * body.gravity_sigma && body.gravity[2] < -9.8);
    if (sim_body_gravity_error(&rig, &body) > 3.5 * body.gravity_sigma)
        fail_msg("gravity %.2f degrees off at a sigma of %.2f",
                 sim_body_gravity_error(&rig, &body) * 180 / FV_PI,
                 body.gravity_sigma * 180 / FV_PI);
}

static void a_loaded_map_is_metric_and_upright_from_the_first_pose_on(void **state)
{
    (void)state;
    const enum fovea_sensors sensors[] = {FOVEA_SENSORS_MONO_INERTIAL, FOVEA_SENSORS_MONO};
    for (int i = 0; i < 2; i++) {
        int posed = 0, first_known = 0;
        open_rig("sim:orbit?" SHAPE "seed=2", 120, 80, sensors[i]);
        rig.config.map = saved[0];
        rig.config.map_bytes = saved_bytes[0];
        sim_rig_build(&rig);
        while (next()) {
            if (body.map_id < 0) continue;
            if (posed++ == 0) {
                assert_true(fabs(body.gravity[0]) < 1e-6 && fabs(body.gravity[1]) < 1e-6);
                assert_true(isnan(body.gyro_bias[0]));
            }
            check_upright(0);
            if (first_known == 0 && isfinite(body.gyro_bias[0])) first_known = posed;
        }
        assert_true(posed > 75);
        assert_true(i == 0 ? first_known > 20 : first_known == 0);
        sim_rig_close(&rig);
    }
}

/* A map of any unit and tilt, loaded into a run with an inertial sensor, becomes metric and upright
 * in one announced change, and is saved so. */
static void a_loaded_map_that_is_neither_becomes_both(void **state)
{
    (void)state;
    int first = 0;
    open_rig("sim:orbit?" SHAPE "seed=2", 60, 140, FOVEA_SENSORS_MONO_INERTIAL);
    rig.config.map = saved[1];
    rig.config.map_bytes = saved_bytes[1];
    sim_rig_build(&rig);
    while (next()) {
        if (body.map_id < 0) continue;
        assert_int_equal(body.map_id, 0); /* the one that was loaded */
        if (body.scale_state == FOVEA_POSE_T_SCALE_METRIC) {
            if (first == 0) first = rig.frames;
            check_upright(1);
            continue;
        }
        assert_int_equal(body.change_count, 0);
        assert_true(isnan(body.gravity[0]));
    }
    assert_true(first > 40 && first < 130);
    uint8_t *again = malloc(fovea_map_bytes_max(&rig.config));
    const size_t bytes = fovea_map_save(rig.rt, again, fovea_map_bytes_max(&rig.config));
    assert_true(bytes > FV_ARCHIVE_HEADER_BYTES);
    assert_int_equal(saved[1][8], FV_ARCHIVE_VERSION);
    assert_int_equal(again[8], FV_ARCHIVE_VERSION + FV_ARCHIVE_HAS_GRAVITY);
    free(again);
    sim_rig_close(&rig);
}

/* Carried off to another room and back: the older map's gravity holds at once, and of the biases
 * what was known. */
static void a_map_that_is_entered_again_says_what_is_known(void **state)
{
    (void)state;
    uint32_t resets = 0;
    bool known = false, again = false;
    open_rig("sim:kidnap?" SHAPE "seed=3", 0, 380, FOVEA_SENSORS_MONO_INERTIAL);
    rig.config.odometry.lost_frames_reset = 5;
    sim_rig_build(&rig);
    while (next() && !again) {
        if (body.map_id < 0) continue;
        again = known && (uint32_t)body.reset_counter > resets && body.map_id == 0;
        resets = (uint32_t)body.reset_counter;
        known = known || isfinite(body.gyro_bias[0]);
    }
    assert_true(again && resets >= 2 && rig.frames > 340);
    check_upright(0);
    for (int i = 0; i < 3; i++) {
        static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
        const double gyro = sqrt(body.bias_covariance[diagonal[i]]),
                     acceleration = sqrt(body.bias_covariance[diagonal[3 + i]]);
        assert_true(gyro > 1e-4 && gyro < 0.01 && acceleration > 0.01 && acceleration < 0.3);
        assert_true(fabs(body.gyro_bias[i]) < 0.02 * 3 + 3 * gyro);
    }
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_loaded_map_is_metric_and_upright_from_the_first_pose_on),
        cmocka_unit_test(a_loaded_map_that_is_neither_becomes_both),
        cmocka_unit_test(a_map_that_is_entered_again_says_what_is_known),
    };
    return cmocka_run_group_tests(tests, save_maps, drop_maps);
}
