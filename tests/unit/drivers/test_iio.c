/* Linux IIO: types and scans as the kernel writes them, a device in a faked tree from its set-up to
 * its samples, what is refused, and a sensor that hangs, is unplugged and comes back. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "../../../drivers/clock.h"
#include "../../../drivers/iio/iio.h"
#include "../../../drivers/iio/scan.h"
#include "common/fake_iio.h"
#include "common/patience.h"

static struct fv_iio *iio;
static struct fovea_error error;

/* ---- scans ----------------------------------------------------------------------------------- */

static void types_are_read_or_refused(void **state)
{
    (void)state;
    static const char *const wrong[] = {"",
                                        "le",
                                        "le:s16",
                                        "me:s16/16>>0",
                                        "le:x16/16>>0",
                                        "le:s16/16",
                                        "le:s16/16>>",
                                        "le:s17/16>>0",
                                        "le:s12/16>>5",
                                        "le:s12/24>>0",
                                        "le:s0/16>>0",
                                        "le:s16/16>>0x",
                                        "le:s16/16X2>>0",
                                        "le:s9999/16>>0"};
    struct fv_iio_type type;
    assert_true(fv_iio_type_parse("be:u12/16>>4", &type));
    assert_true(type.big_endian && !type.is_signed && type.bits == 12 && type.stored_bits == 16 &&
                type.shift == 4);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        if (fv_iio_type_parse(wrong[i], &type)) fail_msg("'%s' was taken", wrong[i]);
}

static void matrices_are_rotations(void **state)
{
    (void)state;
    static const char *const wrong[] = {"",
                                        "1, 0, 0; 0, 1, 0; 0, 0",
                                        "1, 0, 0; 0, 1, 0; 0, 0, 2",
                                        "1, 0, 0; 1, 0, 0; 0, 0, 1",
                                        "1, 0, 0; 0, 1, 0; 0, 0, 1; 0",
                                        "nan, 0, 0; 0, 1, 0; 0, 0, 1"};
    double m[9];
    assert_true(fv_iio_matrix_parse("0, 1, 0; -1, 0, 0; 0, 0, 1", m));
    assert_true(m[1] == 1 && m[3] == -1 && m[8] == 1);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        if (fv_iio_matrix_parse(wrong[i], m)) fail_msg("'%s' was taken", wrong[i]);
}

/* Elements of several sizes lie as the kernel lays them: by index, each at a multiple of its size.
 */
static void scans_are_laid_as_the_kernel_lays_them(void **state)
{
    (void)state;
    static const char *const types[FV_IIO_ELEMENTS] = {
        "le:s16/16>>0", "be:s24/32>>8", "le:u8/8>>0",  "be:s12/16>>4",
        "le:s32/32>>0", "le:s16/16>>0", "le:s64/64>>0"};
    static const uint32_t indices[FV_IIO_ELEMENTS] = {2, 9, 0, 4, 5, 7, 20};
    static const uint32_t offsets[FV_IIO_ELEMENTS] = {2, 16, 0, 4, 8, 12, 24};
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    struct fv_iio_scan scan;
    struct fovea_imu_sample sample;
    memset(&scan, 0, sizeof scan);
    memcpy(scan.gyro_mount, identity, sizeof identity);
    memcpy(scan.acceleration_mount, identity, sizeof identity);
    for (int i = 0; i < FV_IIO_ELEMENTS; i++) {
        assert_true(fv_iio_type_parse(types[i], &scan.elements[i].type));
        scan.elements[i].index = indices[i];
        scan.elements[i].scale = 1;
    }
    scan.elements[3].shift = 5;
    scan.elements[3].scale = 0.5;
    assert_true(fv_iio_scan_lay(&scan));
    for (int i = 0; i < FV_IIO_ELEMENTS; i++)
        assert_int_equal(scan.elements[i].offset, offsets[i]);
    assert_int_equal(scan.bytes, 32);
    uint8_t data[32] = {[0] = 0xfe, [2] = 0x01, [3] = 0x80, [4] = 0xff, [5] = 0xef};
    data[8] = 0xff, data[9] = 0xff, data[10] = 0xff, data[11] = 0x7f; /* 2^31 - 1 */
    data[12] = 7;
    data[16] = 0xff, data[17] = 0xff, data[18] = 0xfd, data[19] = 0x77; /* -3 */
    data[24] = 1, data[31] = 0x10;
    fv_iio_scan_read(&scan, data, &sample);
    assert_true(sample.gyro[0] == -32767 && sample.gyro[1] == -3 && sample.gyro[2] == 254);
    assert_true(sample.acceleration[0] == (-2 + 5) * 0.5);
    assert_true(sample.acceleration[1] == 2147483647.0 && sample.acceleration[2] == 7);
    assert_true(sample.stamp_ns == INT64_C(0x1000000000000001));
    scan.elements[0].index = 9;
    assert_false(fv_iio_scan_lay(&scan));
}

/* ---- the device ------------------------------------------------------------------------------ */

static int make_tree(void **state)
{
    (void)state;
    fake_iio_make();
    return 0;
}

static int remove_tree(void **state)
{
    (void)state;
    fv_iio_close(iio);
    iio = NULL;
    fake_iio_remove();
    return 0;
}

static void open_iio(const char *name, double rate_hz)
{
    error.text[0] = '\0';
    if (fv_iio_open(name, rate_hz, &iio, &error) != FOVEA_OK) fail_msg("%s", error.text);
    if (fv_iio_start(iio, &error) != FOVEA_OK) fail_msg("%s", error.text);
}

static void pause_ms(int64_t ms)
{
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * 1000000}, NULL);
}

/* The next sample, for which it waits; it must come. */
static struct fovea_imu_sample await(void)
{
    const struct fovea_imu_sample *next;
    int64_t end_ns = 0;
    while ((next = fv_iio_peek(iio)) == NULL && fv_test_patient(&end_ns, 5)) {
    }
    if (next == NULL) fail_msg("no sample came");
    const struct fovea_imu_sample sample = *next;
    fv_iio_release(iio);
    return sample;
}

/* Wait for a line that holds a text. */
static void await_line(const char *text)
{
    struct fovea_error line;
    int64_t end_ns = 0;
    do
        while (fv_iio_complaint(iio, &line) != FOVEA_AGAIN)
            if (strstr(line.text, text) != NULL) return;
    while (fv_test_patient(&end_ns, 5));
    fail_msg("nobody said '%s'", text);
}

static void await_set_up(void)
{
    assert_true(fake_iio_comes_to_say("buffer/enable", "1"));
}

static void samples_come_in_units_and_frame_of_the_device(void **state)
{
    static const int16_t raw[6] = {100, -200, 300, 981, -2, 32767};
    (void)state;
    fake_iio_file("in_mount_matrix", "0, 1, 0; -1, 0, 0; 0, 0, 1");
    fake_iio_file("in_accel_x_offset", "-1");
    open_iio("adis16448", 400);
    await_set_up();
    assert_true(fake_iio_says("scan_elements/in_anglvel_x_en", "1"));
    assert_true(fake_iio_says("scan_elements/in_temp_en", "0"));
    assert_true(fake_iio_says("scan_elements/in_timestamp_en", "1"));
    assert_true(fake_iio_says("current_timestamp_clock", "monotonic"));
    assert_true(fake_iio_says("sampling_frequency", "400"));
    assert_true(fv_iio_info(iio)->rate_hz == 400);
    assert_true(fabs(fv_iio_info(iio)->gyro_range - 32.767) < 1e-9);
    assert_true(fabs(fv_iio_info(iio)->acceleration_range - 327.67) < 1e-9);
    assert_true(fake_iio_scan(raw, 123456789));
    fake_iio_scan_in_pieces(raw, 123456790);
    struct fovea_imu_sample sample = await();
    assert_true(sample.stamp_ns == 123456789);
    assert_true(fabs(sample.gyro[0] + 0.2) < 1e-12 && fabs(sample.gyro[1] + 0.1) < 1e-12 &&
                fabs(sample.gyro[2] - 0.3) < 1e-12);
    assert_true(fabs(sample.acceleration[0] + 0.02) < 1e-12 &&
                fabs(sample.acceleration[1] + 9.8) < 1e-12 &&
                fabs(sample.acceleration[2] - 327.67) < 1e-12);
    sample = await();
    assert_true(sample.stamp_ns == 123456790 && fabs(sample.gyro[2] - 0.3) < 1e-12);
    assert_null(fv_iio_peek(iio));
}

/* A kernel that stamps by another clock: converted, to the time between two readings. */
static void other_clocks_are_converted(void **state)
{
    static const int16_t raw[6] = {0};
    (void)state;
    fake_iio_file("current_timestamp_clock", NULL); /* older than 4.5: CLOCK_REALTIME */
    open_iio("iio:device3", 0);
    await_set_up();
    const int64_t before_ns = fv_clock_ns(CLOCK_MONOTONIC);
    assert_true(fake_iio_scan(raw, fv_clock_ns(CLOCK_REALTIME)));
    const int64_t after_ns = fv_clock_ns(CLOCK_MONOTONIC);
    const struct fovea_imu_sample sample = await();
    assert_true(sample.stamp_ns > before_ns - 2000000 && sample.stamp_ns < after_ns + 2000000);
}

static void what_is_lacking_is_named(void **state)
{
    static const char *const files[][3] = {
        {"in_accel_scale", NULL, "imu: iio:adis16448: in_accel_scale: found none"},
        {"scan_elements/in_timestamp_index", NULL, "scan_elements/in_timestamp_index: found none"},
        {"scan_elements/in_accel_y_type", "le:s16/16X3>>0", "found 'le:s16/16X3>>0', expected a"},
        {"scan_elements/in_accel_y_index", "3", "places in the buffer that differ"},
        {"in_mount_matrix", "1, 0, 0; 0, 1, 0; 0, 0, 7", "found '1, 0, 0; 0, 1, 0; 0, 0, 7'"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        fake_iio_file(files[i][0], files[i][1]);
        assert_int_equal(fv_iio_open("adis16448", 0, &iio, &error), FOVEA_ERROR_UNSUPPORTED);
        if (strstr(error.text, files[i][2]) == NULL) fail_msg("%s", error.text);
        fake_iio_remove();
        fake_iio_make();
    }
    assert_int_equal(fv_iio_open("bmi160", 0, &iio, &error), FOVEA_ERROR_INPUT);
    assert_string_equal(error.text,
                        "imu: iio:bmi160: found no such device, expected one of: adis16448");
    assert_int_equal(fv_iio_open("../x", 0, &iio, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_iio_open("", 0, &iio, &error), FOVEA_ERROR_INPUT);
}

/* A scan with this stamp comes to the loop. */
static void expect_scan(int64_t stamp_ns)
{
    static const int16_t raw[6] = {1, 2, 3, 4, 5, 6};
    assert_true(fake_iio_scan(raw, stamp_ns));
    assert_true(await().stamp_ns == stamp_ns);
}

/* Nothing that the sensor does reaches the loop but samples; what happened is said. */
static void a_sensor_that_hangs_or_goes_comes_back(void **state)
{
    struct fv_iio_counts counts;
    (void)state;
    open_iio("adis16448", 0);
    await_set_up();
    expect_scan(1);
    await_line("is there, but gives no samples"); /* half a second on */
    expect_scan(2);
    await_line("gives samples again");
    fake_iio_unplug();
    await_line("is gone; it is searched for");
    assert_null(fv_iio_peek(iio));
    fake_iio_plug();
    await_set_up();
    pause_ms(100); /* the buffer's reader */
    expect_scan(3);
    fv_iio_counts(iio, &counts);
    assert_int_equal(counts.samples, 3);
    assert_int_equal(counts.dropped, 0);
    assert_true(counts.returns >= 1);
}

/* A sensor that stays silent is set up anew. */
static void a_sensor_that_stays_silent_is_started_anew(void **state)
{
    struct fv_iio_counts counts;
    (void)state;
    open_iio("adis16448", 0);
    await_set_up();
    expect_scan(1);
    fv_iio_counts(iio, &counts);
    assert_int_equal(counts.returns, 0);
    fake_iio_file("buffer/enable", "0"); /* as a driver whose buffer stopped */
    await_line("is there, but gives no samples");
    await_set_up();
    pause_ms(100); /* the buffer's reader */
    expect_scan(2);
    await_line("gives samples again");
    fv_iio_counts(iio, &counts);
    assert_int_equal(counts.returns, 1);
}

/* Where no trigger is chosen, the device's own is; another's choice stays. */
static void the_trigger_is_the_device_s_own(void **state)
{
    (void)state;
    fake_iio_file("trigger/current_trigger", "");
    open_iio("adis16448", 0);
    await_set_up();
    assert_true(fake_iio_says("trigger/current_trigger", "adis16448-dev3"));
    fv_iio_close(iio);
    fake_iio_file("trigger/current_trigger", "hrtimer-1");
    open_iio("adis16448", 0);
    await_set_up();
    assert_true(fake_iio_says("trigger/current_trigger", "hrtimer-1"));
}

/* The gyroscope and the accelerometer of one device may be mounted otherwise. */
static void each_half_has_its_own_mount_matrix(void **state)
{
    static const int16_t raw[6] = {100, 200, 300, 1, 2, 3};
    (void)state;
    fake_iio_file("in_mount_matrix", "0, 0, 1; 1, 0, 0; 0, 1, 0");
    fake_iio_file("in_anglvel_mount_matrix", "0, 1, 0; -1, 0, 0; 0, 0, 1");
    fake_iio_file("in_accel_mount_matrix", "1, 0, 0; 0, 0, -1; 0, 1, 0");
    open_iio("adis16448", 0);
    await_set_up();
    assert_true(fake_iio_scan(raw, 7));
    const struct fovea_imu_sample sample = await();
    assert_true(fabs(sample.gyro[0] - 0.2) < 1e-12 && fabs(sample.gyro[1] + 0.1) < 1e-12 &&
                fabs(sample.gyro[2] - 0.3) < 1e-12);
    assert_true(fabs(sample.acceleration[0] - 0.01) < 1e-12 &&
                fabs(sample.acceleration[1] + 0.03) < 1e-12 &&
                fabs(sample.acceleration[2] - 0.02) < 1e-12);
}

/* One that is stated for one half alone leaves the common one to the other. */
static void the_common_mount_matrix_is_the_other_half_s(void **state)
{
    static const int16_t raw[6] = {100, 200, 300, 1, 2, 3};
    (void)state;
    fake_iio_file("in_mount_matrix", "0, 0, 1; 1, 0, 0; 0, 1, 0");
    fake_iio_file("in_accel_mount_matrix", "1, 0, 0; 0, 1, 0; 0, 0, 1");
    open_iio("adis16448", 0);
    await_set_up();
    assert_true(fake_iio_scan(raw, 7));
    const struct fovea_imu_sample sample = await();
    assert_true(fabs(sample.gyro[0] - 0.3) < 1e-12 && fabs(sample.gyro[1] - 0.1) < 1e-12 &&
                fabs(sample.gyro[2] - 0.2) < 1e-12);
    assert_true(fabs(sample.acceleration[0] - 0.01) < 1e-12 &&
                fabs(sample.acceleration[2] - 0.03) < 1e-12);
}

/* Who takes nothing loses the newest, and they are counted. */
static void what_finds_no_room_is_counted(void **state)
{
    static const int16_t raw[6] = {0};
    enum { SENT = 3000 };
    struct fv_iio_counts counts;
    (void)state;
    open_iio("adis16448", 0);
    await_set_up();
    for (int i = 0; i < SENT; i++)
        while (!fake_iio_scan(raw, i + 1))
            pause_ms(1);
    do {
        pause_ms(5);
        fv_iio_counts(iio, &counts);
    } while (counts.samples + counts.dropped < SENT);
    assert_int_equal(counts.samples, 2048);
    for (int i = 0; i < 2048; i++) {
        assert_true(fv_iio_peek(iio)->stamp_ns == i + 1);
        fv_iio_release(iio);
    }
    assert_null(fv_iio_peek(iio));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(types_are_read_or_refused),
        cmocka_unit_test(matrices_are_rotations),
        cmocka_unit_test(scans_are_laid_as_the_kernel_lays_them),
        cmocka_unit_test_setup_teardown(samples_come_in_units_and_frame_of_the_device, make_tree,
                                        remove_tree),
        cmocka_unit_test_setup_teardown(other_clocks_are_converted, make_tree, remove_tree),
        cmocka_unit_test_setup_teardown(what_is_lacking_is_named, make_tree, remove_tree),
        cmocka_unit_test_setup_teardown(a_sensor_that_hangs_or_goes_comes_back, make_tree,
                                        remove_tree),
        cmocka_unit_test_setup_teardown(a_sensor_that_stays_silent_is_started_anew, make_tree,
                                        remove_tree),
        cmocka_unit_test_setup_teardown(the_trigger_is_the_device_s_own, make_tree, remove_tree),
        cmocka_unit_test_setup_teardown(each_half_has_its_own_mount_matrix, make_tree, remove_tree),
        cmocka_unit_test_setup_teardown(the_common_mount_matrix_is_the_other_half_s, make_tree,
                                        remove_tree),
        cmocka_unit_test_setup_teardown(what_finds_no_room_is_counted, make_tree, remove_tree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
