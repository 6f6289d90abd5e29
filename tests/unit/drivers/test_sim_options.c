/* Options of the simulated camera: what is taken, and that every wrong one is refused in one
 * telling line. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/sim/sim.h"

static void test_defaults(void **state)
{
    (void)state;
    struct fv_sim_options o;
    struct fovea_error error;
    assert_int_equal(fv_sim_options_parse("", &o, &error), FOVEA_OK);
    assert_int_equal(o.trajectory, FV_SIM_TOUR);
    assert_int_equal(o.width, 640);
    assert_int_equal(o.height, 480);
    assert_int_equal(o.frames, 68 * 30);
    assert_int_equal(fv_sim_options_parse("wander", &o, &error), FOVEA_OK);
    assert_int_equal(o.frames, 0);
    assert_int_equal(fv_sim_options_parse("orbit?", &o, &error), FOVEA_OK);
}

static void test_values(void **state)
{
    (void)state;
    struct fv_sim_options o;
    struct fovea_error error;
    const char *uri =
        "orbit?seed=7&width=752&height=480&rate=20&frames=11&lens=equidistant&fov=100.5&noise=0.5&blur=1&rolling=1&exposure=12.5&readout=30&objects=3&textures=repeated&light=1.5&time=4.25";
    assert_int_equal(fv_sim_options_parse(uri, &o, &error), FOVEA_OK);
    assert_int_equal(o.seed, 7);
    assert_int_equal(o.width, 752);
    assert_int_equal(o.frames, 11);
    assert_int_equal(o.lens, FV_SIM_LENS_EQUIDISTANT);
    assert_true(o.rate_hz == 20.0 && o.fov_deg == 100.5 && o.noise == 0.5 && o.exposure_ms == 12.5);
    assert_true(o.readout_ms == 30.0 && o.light == 1.5 && o.time_s == 4.25);
    assert_true(o.blur && o.rolling && o.textures == FV_SIM_TEXTURES_REPEATED);
    assert_int_equal(o.objects, 3);
}

static const struct {
    const char *address, *says[3];
} wrong[] = {
    {"orbitt", {"trajectory", "'orbitt'", "'orbit'"}},
    {"zzzzzzzz", {"trajectory", "'zzzzzzzz'", "corridor"}},
    {"orbit?sede=3", {"option", "'sede'", "'seed'"}},
    {"orbit?seed", {"seed", "no value", "integer"}},
    {"orbit?seed=", {"seed", "''", "whole number"}},
    {"orbit?seed=-1", {"seed", "'-1'", "whole number"}},
    {"orbit?seed=9007199254740993", {"seed", "'9007199254740993'", "[0, 9007199254740992]"}},
    {"orbit?width=64.5", {"width", "'64.5'", "[64, 2048]"}},
    {"orbit?width=63", {"width", "'63'", "[64, 2048]"}},
    {"orbit?height=99999999999999999999", {"height", "'99999999999999999999'", "pixels"}},
    {"orbit?rate=nan", {"rate", "'nan'", "a number"}},
    {"orbit?rate=0", {"rate", "'0'", "[1, 1000]"}},
    {"orbit?lens=fisheye", {"lens", "'fisheye'", "equidistant"}},
    {"orbit?textures=none", {"textures", "'none'", "repeated"}},
    {"orbit?blur=2", {"blur", "'2'", "[0, 1]"}},
    {"orbit?noise=1e9", {"noise", "'1e9'", "[0, 20]"}},
    {"orbit?objects=49", {"objects", "'49'", "[0, 48]"}},
    {"orbit?exposure=50", {"exposure", "50", "frame period"}},
    {"orbit?fov=120", {"fov", "120", "110"}},
    {"orbit?imu=1e-12", {"sim: imu:", "1e-12 Hz", "0 or a number in [0.01, 1000]"}},
    {"orbit?wheel_odometry=0.009",
     {"sim: wheel_odometry:", "0.009 Hz", "0 or a number in [0.01, 1000]"}},
    {"orbit?imu=1001", {"imu", "'1001'", "[0, 1000]"}},
    {"orbit?turn_rate=300", {"sim: turn_rate:", "300 with the trajectory orbit", "expected fast"}},
    {"fast?turn_rate=139", {"turn_rate", "'139'", "[140, 1000]"}},
    {"orbit?imu_offset=101", {"imu_offset", "'101'", "[-100, 100]"}},
    {"orbit?gyro_bias=-1", {"gyro_bias", "'-1'", "[0, 1]"}},
    {"orbit?odometry=50", {"sim: odometry:", "Fovea 0.1", "'wheel_odometry'"}},
    {"orbit?odometry_noise=1", {"sim: odometry_noise:", "0.1", "'wheel_odometry_noise'"}},
    {"orbit?seed=1&=3", {"option", "''", "seed"}},
    {"orbit?camera2=1,2", {"camera2", "'1,2'", "X,Y,Z or X,Y,Z,RX,RY,RZ in [-10, 10] metres"}},
    {"orbit?camera2=1,2,3,4", {"camera2", "'1,2,3,4'", "[-180, 180] degrees"}},
    {"orbit?camera2=1,2,3,4,5,6,", {"camera2", "'1,2,3,4,5,6,'", "second camera"}},
    {"orbit?camera2=11,0,0", {"camera2", "'11,0,0'", "[-10, 10]"}},
    {"orbit?camera2=0,0,0,0,181,0", {"camera2", "181", "[-180, 180]"}},
    {"orbit?imu_pose=0,a,0", {"imu_pose", "'0,a,0'", "of the sensor"}},
    {"orbit?camera3=0,0,0", {"sim: camera3:", "without camera2", "both"}},
    {"orbit?camera2=0,0,0&camera4=0,0,0", {"sim: camera4:", "without camera3", "both"}},
    {"orbit?camera2=0.1,0,0&baseline=0.1", {"sim: baseline:", "0.1 beside camera2", "one of"}},
};

static void test_wrong_ones_are_refused(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct fv_sim_options o;
        memset(&o, 0x5A, sizeof o);
        const struct fv_sim_options before = o;
        struct fovea_error error = {FOVEA_OK, ""};
        const enum fovea_status status = fv_sim_options_parse(wrong[i].address, &o, &error);
        if (status != FOVEA_ERROR_INPUT) print_error("%s: status %d\n", wrong[i].address, status);
        assert_int_equal(status, FOVEA_ERROR_INPUT);
        assert_memory_equal(&o, &before, sizeof o);
        assert_null(strchr(error.text, '\n'));
        for (size_t k = 0; k < 3; k++) {
            if (strstr(error.text, wrong[i].says[k]) == NULL)
                print_error("%s: no %s in: %s\n", wrong[i].address, wrong[i].says[k], error.text);
            assert_non_null(strstr(error.text, wrong[i].says[k]));
        }
    }
}

static void test_open_refuses_what_cannot_be(void **state)
{
    (void)state;
    struct fovea_source *source = NULL;
    struct fovea_error error;
    const struct fovea_source_selection late = {.start = 900, .step = 1}, still = {.step = 0},
                                        back = {.step = 1, .reverse = true};
    assert_int_equal(fv_source_sim.open("orbit", &late, &source, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fv_source_sim.open("orbit", &still, &source, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fv_source_sim.open("wander", &back, &source, &error), FOVEA_ERROR_ARGUMENT);
    /* A tall fisheye image whose corners would look backward. */
    assert_int_equal(fv_source_sim.open("orbit?lens=equidistant&fov=130&width=640&height=1280",
                                        NULL, &source, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "fov"));
    /* Frames whose time no stamp can hold. */
    const struct fovea_source_selection far_off[] = {
        {.start = INT64_MAX, .step = 1},
        {.start = 300000000000, .step = 1},
        {.start = 1, .step = INT64_MAX, .frames = 3},
        {.start = 1, .step = INT64_MAX},
        {.step = 1, .frames = 300000000000, .reverse = true}};
    for (size_t i = 0; i < sizeof far_off / sizeof far_off[0]; i++) {
        assert_int_equal(fv_source_sim.open("wander?rate=30", &far_off[i], &source, &error),
                         FOVEA_ERROR_ARGUMENT);
        assert_non_null(strstr(error.text, "expected at most 9e+09 s"));
    }
    assert_int_equal(
        fv_source_sim.open("orbit?frames=9007199254740992&rate=1", &far_off[1], &source, &error),
        FOVEA_ERROR_ARGUMENT);
    const struct fovea_source_selection backwards = {.step = 1, .reverse = true},
                                        first = {.step = INT64_MAX};
    assert_int_equal(
        fv_source_sim.open("orbit?frames=9007199254740992&rate=1", &backwards, &source, &error),
        FOVEA_ERROR_ARGUMENT);
    assert_null(source);
    assert_int_equal(fv_source_sim.open("orbit?width=64&height=64", &first, &source, &error),
                     FOVEA_OK);
    fv_source_sim.close(source); /* its one frame is at 0 */
    const struct fovea_source_selection long_after = {.start = 200000000000, .step = 1};
    assert_int_equal(fv_source_sim.open("wander?rate=30", &long_after, &source, &error), FOVEA_OK);
    fv_source_sim.close(source);
    assert_int_equal(
        fv_source_sim.open("orbit?frames=9007199254740992&rate=1", NULL, &source, &error),
        FOVEA_OK);
    fv_source_sim.close(source);
}

/* As many samples as a step takes are played, more than that are refused. */
static void test_samples_that_fit_a_frame(void **state)
{
    (void)state;
    struct fovea_source *source = NULL;
    struct fovea_error error;
    struct fovea_frame frame;
    static struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX + 1];
    const struct fovea_source_selection all = {.step = 1}, every_sixth = {.step = 6};
    const char *full = "orbit?width=64&height=64&rate=4&frames=12&wheel_odometry=24&imu=1000",
               *over = "orbit?width=64&height=64&rate=4&frames=12&wheel_odometry=25&imu=1000",
               *slow = "orbit?width=64&height=64&rate=30&frames=30&wheel_odometry=300&imu=1000";
    assert_int_equal(fv_source_sim.open(over, &all, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(
        error.text,
        "wheel_odometry: found 1025 samples per second beside 4 frames, expected at most 256 with each frame"));
    assert_int_equal(fv_source_sim.open(slow, &every_sixth, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "found 1300 samples per second beside 5 frames"));
    assert_int_equal(fv_source_sim.open(full, &all, &source, &error), FOVEA_OK);
    assert_int_equal(fv_source_sim.start(source, &error), FOVEA_OK);
    for (int n = 0; n < 4; n++) {
        assert_int_equal(fv_source_sim.dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(
            fv_source_sim.samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX + 1),
            n == 0 ? 2 : FOVEA_INPUT_SAMPLES_MAX);
        fv_source_sim.requeue(source, &frame);
    }
    fv_source_sim.close(source);
}

/* Wheel odometry comes unasked at 100 Hz: that refuses no run of every hundredth frame. */
static void test_unasked_odometry_refuses_no_run(void **state)
{
    (void)state;
    struct fovea_source *source = NULL;
    struct fovea_error error;
    const struct fovea_source_selection every_hundredth = {.step = 100};
    assert_int_equal(fv_source_sim.open("orbit?width=64&height=64&frames=300", &every_hundredth,
                                        &source, &error),
                     FOVEA_OK);
    fv_source_sim.close(source);
    assert_int_equal(fv_source_sim.open("orbit?width=64&height=64&frames=300&wheel_odometry=100",
                                        &every_hundredth, &source, &error),
                     FOVEA_ERROR_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_wrong_ones_are_refused),
        cmocka_unit_test(test_open_refuses_what_cannot_be),
        cmocka_unit_test(test_samples_that_fit_a_frame),
        cmocka_unit_test(test_unasked_odometry_refuses_no_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
