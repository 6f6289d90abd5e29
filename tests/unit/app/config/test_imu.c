/* The inertial sensor that the key `imu` names: what of its file and its device the rig gets, and
 * what is refused, in one line that names the key. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/config/imu.h"
#include "app/config/setup.h"
#include "common/datasets.h"
#include "common/fake_iio.h"
#include "inertial/reading.h"

static struct fv_settings settings;
static struct fovea_error error;
static char file[FV_TEST_PATH_BYTES + 16];

/* A sensor turned by a quarter about x, 0.1 m before, 0.2 m to the left of and 0.3 m above. */
#define T_BS "T_BS:\n  data: [1, 0, 0, 0.1, 0, 0, -1, 0.2, 0, 1, 0, 0.3, 0, 0, 0, 1]\n"
#define NOISES                                                                                     \
    "gyroscope_noise_density: 0.001\ngyroscope_random_walk: 0.0001\n"                              \
    "accelerometer_noise_density: 0.02\naccelerometer_random_walk: 0.003\n"

static int set_up(void **state)
{
    if (fv_test_place_set_up(state) != 0) return -1;
    snprintf(file, sizeof file, "%s/imu.yaml", fv_test_place);
    fv_test_write_text(file, T_BS "rate_hz: 250\n" NOISES);
    fake_iio_make();
    return 0;
}

static int tear_down(void **state)
{
    fake_iio_remove();
    return fv_test_place_tear_down(state);
}

static void set(const char *key, const char *value)
{
    char text[FV_TEST_PATH_BYTES + 64];
    snprintf(text, sizeof text, "%s=%s", key, value);
    if (value[0] != '\0' && fv_settings_set(&settings, text, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

/* A file that is right, and these keys from line 8 on. */
static void write_with(const char *keys)
{
    char text[1024];
    snprintf(text, sizeof text, "%s%s", T_BS "rate_hz: 250\n" NOISES, keys);
    fv_test_write_text(file, text);
}

/* What a source with one camera says. */
static enum fovea_status join(const char *imu, const char *imu_file, bool own, struct fv_iio **iio)
{
    const struct fovea_source_info info = {.rig = {.camera_count = 1, .has_imu = own}};
    fv_settings_default(&settings);
    snprintf(settings.lcm_url, sizeof settings.lcm_url, "memq://");
    set("imu", imu);
    set("imu_file", imu_file);
    *iio = NULL;
    error.text[0] = '\0';
    return fv_imu_join(&settings, &info, iio, &error);
}

static void the_rig_gets_what_the_file_states(void **state)
{
    static const double T[12] = {1, 0, 0, 0.1, 0, 0, -1, 0.2, 0, 1, 0, 0.3};
    struct fv_iio *iio;
    (void)state;
    const struct fovea_rig *rig = &settings.runtime.rig;
    if (join("lcm:ROBOT_IMU", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    assert_null(iio);
    assert_true(rig->has_imu && rig->imu.rate_hz == 250);
    assert_memory_equal(rig->imu.T_body_imu, T, sizeof T);
    assert_true(rig->imu.gyro_noise == 0.001 && rig->imu.gyro_walk == 0.0001 &&
                rig->imu.acceleration_noise == 0.02 && rig->imu.acceleration_walk == 0.003);
    assert_true(rig->imu.gyro_range == 0 && rig->imu.acceleration_range == 0);
    assert_true(rig->imu.time_offset_ns == 0);
    fv_test_write_text(file, T_BS "rate_hz: 250\ntime_offset_ns: -4523788\n" NOISES);
    if (join("lcm:ROBOT_IMU", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(rig->imu.time_offset_ns == -4523788);
    assert_string_equal(fv_imu_lcm_channel(&settings), "ROBOT_IMU");
    assert_null(fv_imu_iio_name(&settings));
    assert_int_equal(join("", "", false, &iio), FOVEA_OK);
    assert_false(rig->has_imu);
    assert_int_equal(join("", "", true, &iio), FOVEA_OK); /* the source's own */
}

/* Samples of a gyro that shows 1 % too much and has an axis askew, and of an accelerometer with a
 * constant beside its scale, are the true ones by what the file states of them. */
static void samples_are_as_the_file_corrects_them(void **state)
{
    static const char keys[] =
        "gyro_correction: [[0.99009900990099009, 0, 0], [0, 0.99009900990099009, 0],\n"
        "  [-0.019801980198019802, 0, 0.99009900990099009]]\n"
        "acceleration_correction: [0.98, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, -0.25]\n";
    static const struct fovea_imu_sample right = {7, {0.5, -0.25, 2}, {9.5, 1, -3}};
    struct fovea_imu_sample shown = right;
    struct fv_imu_reading read, expected;
    struct fv_iio *iio;
    (void)state;
    const struct fovea_rig_imu *imu = &settings.runtime.rig.imu;
    for (int i = 0; i < 3; i++)
        shown.gyro[i] = 1.01 * right.gyro[i];
    shown.gyro[2] += 0.02 * 1.01 * right.gyro[0];
    shown.acceleration[0] = (right.acceleration[0] - 0.5) / 0.98;
    shown.acceleration[2] = right.acceleration[2] + 0.25;
    if (join("lcm:IMU", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(fv_imu_read(imu, &right, &expected));
    assert_memory_equal(expected.gyro, right.gyro, sizeof right.gyro); /* none is stated */
    write_with(keys);
    if (join("lcm:IMU", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(fv_imu_read(imu, &shown, &read));
    for (int i = 0; i < 3; i++) {
        assert_float_equal(read.gyro[i], right.gyro[i], 1e-12);
        assert_float_equal(read.acceleration[i], right.acceleration[i], 1e-12);
    }
}

/* A device states its rate and its ranges, which the file does not know. */
static void a_device_states_its_rate_and_ranges(void **state)
{
    struct fv_iio *iio;
    (void)state;
    const struct fovea_rig_imu *imu = &settings.runtime.rig.imu;
    if (join("iio:adis16448", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    assert_non_null(iio);
    assert_true(fake_iio_says("sampling_frequency", "250")); /* the file's is asked for */
    assert_true(imu->rate_hz == fv_iio_info(iio)->rate_hz && imu->rate_hz == 250);
    assert_true(imu->gyro_range > 32.766 && imu->gyro_range < 32.768);
    assert_true(imu->acceleration_range > 327.66 && imu->acceleration_range < 327.68);
    assert_true(imu->gyro_noise == 0.001 && settings.runtime.rig.has_imu);
    assert_string_equal(fv_imu_iio_name(&settings), "adis16448");
    assert_null(fv_imu_lcm_channel(&settings));
    fv_iio_close(iio);
    fake_iio_file("sampling_frequency", "200.000000");
    fv_test_write_text(file, T_BS "rate_hz: 0\n" NOISES); /* as it is */
    if (join("iio:adis16448", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(imu->rate_hz == 200);
    fv_iio_close(iio);
}

static void expect_refused(const char *imu, const char *imu_file, bool own, const char *text)
{
    struct fv_iio *iio;
    assert_int_equal(join(imu, imu_file, own, &iio), FOVEA_ERROR_INPUT);
    assert_null(iio);
    if (strstr(error.text, text) == NULL || strchr(error.text, '\n') != NULL)
        fail_msg("imu '%s': found [%s], expected %s", imu, error.text, text);
}

static void what_cannot_be_is_refused(void **state)
{
    char name[128];
    (void)state;
    expect_refused("usb:1", file, false, "imu: found 'usb:1', expected lcm:CHANNEL or iio:NAME");
    expect_refused("lcm:", file, false, "imu: found 'lcm:', expected lcm:CHANNEL");
    expect_refused("iio:", file, false, "imu: found 'iio:', expected lcm:CHANNEL");
    snprintf(name, sizeof name, "lcm:%064d", 0);
    expect_refused(name, file, false, "imu: found a channel of 64 bytes, expected at most 63");
    expect_refused("lcm:IMU", file, true,
                   "imu: found 'lcm:IMU' beside the source's own inertial sensor");
    expect_refused("lcm:IMU", "", false, "imu_file (default): found none beside imu, expected");
    expect_refused("lcm:IMU", "/none.yaml", false, "/none.yaml");
    expect_refused("iio:nobody", file, false, "nobody");
}

/* LCM that is not heard cannot bring samples. */
static void lcm_must_be_heard(void **state)
{
    const struct fovea_source_info info = {.rig = {.camera_count = 1}};
    struct fv_iio *iio;
    (void)state;
    assert_int_equal(join("lcm:IMU", file, false, &iio), FOVEA_OK);
    settings.lcm_url[0] = '\0';
    assert_int_equal(fv_imu_join(&settings, &info, &iio, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "imu: found 'lcm:IMU' with an empty lcm_url, expected"));
    assert_int_equal(join("lcm:IMU", file, false, &iio), FOVEA_OK);
    snprintf(settings.listen, sizeof settings.listen, "none");
    assert_int_equal(fv_imu_join(&settings, &info, &iio, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "imu: found 'lcm:IMU' with listen: none, expected"));
    if (join("iio:adis16448", file, false, &iio) != FOVEA_OK) fail_msg("%s", error.text);
    fv_iio_close(iio); /* IIO needs no network */
    settings.lcm_url[0] = '\0';
    assert_int_equal(fv_imu_join(&settings, &info, &iio, &error), FOVEA_OK);
    fv_iio_close(iio);
}

/* Each is one change of a file that is right; the error names the file and what it lacks. */
static void wrong_files_are_refused(void **state)
{
    static const char *const wrong[][2] = {
        {"rate_hz: 250\n" NOISES, "T_BS"},
        {T_BS NOISES, "rate_hz"},
        {T_BS "rate_hz: 250\n", "gyroscope_noise_density"},
        {T_BS "rate_hz: -1\n" NOISES, "rate_hz"},
        {"T_BS:\n  data: [1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 250\n" NOISES,
         "a rigid transform"},
        {"T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2]\nrate_hz: 250\n" NOISES,
         "a rigid transform"},
        {"T_BS:\n  data: [1, 0, 0]\nrate_hz: 250\n" NOISES, "16"},
        {"[", "imu.yaml"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        fv_test_write_text(file, wrong[i][0]);
        expect_refused("lcm:IMU", file, false, wrong[i][1]);
        assert_non_null(strstr(error.text, "imu.yaml"));
    }
}

static void wrong_corrections_are_refused(void **state)
{
#define NEAR "expected 3 rows of 3 numbers that are within .2 of the identity's"
    static const char *const wrong[][2] = {
        {"gyro_correction: 1", "gyro_correction: found '1', expected a list of 9 to 12 numbers"},
        {"gyro_correction: [1, 0, 0, 0, 1, 0, 0, 0]",
         "gyro_correction: found a list of 8, expected a list of 9 to 12 numbers"},
        {"gyro_correction: [1, 0, 0, 0, 1, 0, 0, 0, 1, 0]",
         "gyro_correction: found a list of 10, " NEAR},
        {"gyro_correction: [1, 0, 0, 0, 1, 0, 0, 0, .nan]",
         "gyro_correction[8]: found '.nan', expected a finite number"},
        {"gyro_correction: [1, 0, 0, 0, 1, 0, 0, 0, inf]",
         "gyro_correction[8]: found 'inf', expected a finite number"},
        {"gyro_correction: [0, 0, 0, 0, 0, 0, 0, 0, 0]",
         "gyro_correction: found a list of 9, " NEAR},
        {"gyro_correction: [1, 0, 0, 0.25, 1, 0, 0, 0, 1]",
         "gyro_correction: found a list of 9, " NEAR},
        {"gyro_correction: [1, 0, 0, 0, 0, 1, 0, 1.5, 0, 0, 1, 0]",
         "gyro_correction: found a list of 12, " NEAR ", or of 4, the last at most 1 rad/s"},
        {"acceleration_correction: [1, 0, 0, 0, 57.3, 0, 0, 0, 1]",
         "acceleration_correction: found a list of 9, " NEAR},
        {"acceleration_correction: [1, 0, 0, 9.8, 0, 1, 0, 0, 0, 0, 1, 0]",
         "acceleration_correction: found a list of 12, " NEAR
         ", or of 4, the last at most 5 m/s^2"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        write_with(wrong[i][0]);
        expect_refused("lcm:IMU", file, false, wrong[i][1]);
        assert_non_null(strstr(error.text, "imu.yaml:8: "));
    }
}

/* Where the keys stand in a file, its line is named. */
static void the_line_of_the_key_is_named(void **state)
{
    const struct fovea_source_info info = {.rig = {.camera_count = 1}};
    char path[FV_TEST_PATH_BYTES + 16], text[2 * FV_TEST_PATH_BYTES];
    struct fv_iio *iio = NULL;
    (void)state;
    snprintf(path, sizeof path, "%s/fovea.yaml", fv_test_place);
    snprintf(text, sizeof text, "source: 'sim:'\nimu: lcm:IMU\nimu_file: %s\nlcm_url: memq://\n",
             file);
    fv_test_write_text(path, text);
    const struct fv_setup_options options = {.config = path};
    if (fv_setup_settings(&options, &settings, &error) != FOVEA_OK) fail_msg("%s", error.text);
    fv_test_write_text(file, T_BS "rate_hz: x\n" NOISES);
    assert_int_equal(fv_imu_join(&settings, &info, &iio, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "fovea.yaml:3: imu_file: "));
    snprintf(settings.imu, sizeof settings.imu, "usb:");
    assert_int_equal(fv_imu_join(&settings, &info, &iio, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "fovea.yaml:2: imu: found 'usb:'"));
}

int main(void)
{
#define WITH_FILE(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        WITH_FILE(the_rig_gets_what_the_file_states),
        WITH_FILE(samples_are_as_the_file_corrects_them),
        WITH_FILE(a_device_states_its_rate_and_ranges),
        WITH_FILE(what_cannot_be_is_refused),
        WITH_FILE(lcm_must_be_heard),
        WITH_FILE(wrong_files_are_refused),
        WITH_FILE(wrong_corrections_are_refused),
        WITH_FILE(the_line_of_the_key_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
