/* Inertial samples beside the source: what LCM and IIO bring comes with the frame that it belongs
 * to, on the frames' clock, in the order of stamps, and what does not say its clock is counted. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "app/run/imu_input.h"
#include "drivers/clock.h"
#include "common/fake_iio.h"
#include "common/patience.h"

#include "fovea_imu_t.h"

static struct fv_settings settings;
static struct fv_imu_input input;
static struct fovea_inputs inputs;
static struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
static struct fovea_frame frame;

static const int64_t utc_ns = 1700000000000000000;

static int open_lcm(void **state)
{
    (void)state;
    memset(&input, 0, sizeof input);
    memset(&settings, 0, sizeof settings);
    snprintf(settings.imu, sizeof settings.imu, "lcm:ROBOT_IMU");
    settings.runtime.rig.imu.time_offset_ns = 0;
    fv_imu_input_open(&input, &settings, NULL);
    frame = (struct fovea_frame){.clock = FOVEA_CLOCK_MONOTONIC};
    return 0;
}

static void hear(int64_t time_ns, int8_t clock, int64_t utc_offset_ns, bool from_host)
{
    const fovea_imu_t message = {
        .stamp = {.time_ns = time_ns, .clock = clock, .utc_offset_ns = utc_offset_ns},
        .gyro = {1, 2, 3},
        .acceleration = {4, 5, (double)time_ns}};
    const struct fv_receiver_channel row = fv_imu_input_row(&input);
    uint8_t data[256];
    const int bytes = fovea_imu_t_encode(data, 0, sizeof data, &message);
    assert_string_equal(row.name, "ROBOT_IMU");
    assert_string_equal(row.type, "fovea.imu_t");
    assert_true(bytes > 0 && (uint32_t)bytes <= row.bytes_max);
    const struct fv_received received = {row.name, data, (uint32_t)bytes, from_host};
    row.take(row.context, &received);
}

/* The samples that come with a frame; 0: without one, at the time. */
static uint32_t take(int64_t stamp_ns, bool framed)
{
    inputs = (struct fovea_inputs){.now_ns = stamp_ns, .utc_offset_ns = utc_ns};
    frame.stamp_ns = stamp_ns;
    fv_imu_input_take(&input, framed ? &frame : NULL, samples, &inputs);
    return inputs.sample_count;
}

static void samples_come_with_their_frame(void **state)
{
    (void)state;
    for (int64_t t = 1; t <= 30; t++)
        hear(t * 5000000, 0, 0, true);
    assert_int_equal(take(20000000, false), 0); /* no frame yet: their clock is not known */
    assert_int_equal(take(50000000, true), 10);
    for (int i = 0; i < 10; i++) {
        assert_int_equal(samples[i].kind, FOVEA_SAMPLE_IMU);
        assert_true(samples[i].imu.stamp_ns == (i + 1) * 5000000);
        assert_true(samples[i].imu.gyro[1] == 2 && samples[i].imu.acceleration[0] == 4);
    }
    assert_int_equal(take(83000000, false), 6); /* a step without a frame */
    assert_int_equal(take(83000000, true), 0);
    assert_int_equal(take(1000000000, true), 14);
}

/* What came long before the first frame is left. */
static void the_first_frame_has_no_old_samples(void **state)
{
    (void)state;
    for (int64_t t = 0; t < 1000; t++)
        hear(t * 5000000, 0, 0, true);
    assert_int_equal(take(4000000000, true), 41); /* 0.2 s and one */
    assert_true(samples[0].imu.stamp_ns == 3800000000);
}

/* What fv_imu_input_tell says. */
static const char *told(void)
{
    static char text[512];
    memset(text, 0, sizeof text);
    FILE *out = fmemopen(text, sizeof text - 1, "w");
    assert_non_null(out);
    fv_imu_input_tell(out, &input);
    fclose(out);
    return text;
}

/* A camera that begins late: the newest samples are kept for it, and none is lost. */
static void samples_just_before_the_first_frame_are_kept(void **state)
{
    (void)state;
    for (int64_t t = 0; t < 20000; t++) {
        hear(t * 1000000, 0, 0, true);
        if (t % 33 == 0) assert_int_equal(take(t * 1000000, false), 0);
    }
    assert_int_equal(take(19999000000, true), 201);
    assert_true(samples[0].imu.stamp_ns == 19799000000);
    assert_true(samples[200].imu.stamp_ns == 19999000000);
    assert_null(strstr(told(), "lost"));
}

static void what_is_lost_before_the_first_frame_is_told_apart(void **state)
{
    (void)state;
    for (int64_t t = 0; t < 3000; t++)
        hear(t * 1000000, 0, 0, true);
    const unsigned early = (unsigned)atomic_load(&input.no_room);
    assert_true(early > 0);
    char expected[128];
    snprintf(expected, sizeof expected, "heard on ROBOT_IMU, %u lost before the first frame\n",
             early);
    assert_non_null(strstr(told(), expected));
    take(3000000000, true);
    assert_non_null(strstr(told(), expected));
    for (int64_t t = 3000; t < 6000; t++)
        hear(t * 1000000, 0, 0, true);
    const unsigned busy = (unsigned)atomic_load(&input.no_room) - early;
    assert_true(busy > 0);
    snprintf(expected, sizeof expected,
             ", %u lost before the first frame, %u lost: the loop was busy\n", early, busy);
    assert_non_null(strstr(told(), expected));
}

static void stamps_are_put_on_the_frames_clock(void **state)
{
    (void)state;
    hear(100, 0, utc_ns, true);           /* the frames' own clock, of this host */
    hear(7200, 1, utc_ns - 7000, false);  /* another clock that states its UTC */
    hear(5300, 0, utc_ns - 5000, false);  /* the same clock, of another host */
    hear(utc_ns + 400, 2, 0, false);      /* UTC itself */
    hear(500, 1, 0, true);                /* another clock alone: says nothing */
    hear(600, 0, 0, false);               /* likewise */
    hear(INT64_MAX, 2, INT64_MAX, false); /* no time */
    assert_int_equal(take(1000, true), 4);
    for (int i = 0; i < 4; i++)
        assert_true(samples[i].imu.stamp_ns == 100 * (i + 1));
    assert_int_equal(atomic_load(&input.no_clock), 3);
    assert_int_equal(atomic_load(&input.heard), 7);
}

/* Late ones find their place, those far ahead are not waited for, and none overflows the step. */
static void nothing_overflows(void **state)
{
    (void)state;
    static const int64_t stamps[] = {10, 30, 20, 5000000000, 40};
    for (int i = 0; i < 5; i++)
        hear(stamps[i], 0, 0, true);
    assert_int_equal(take(100, true), 5);
    for (int i = 0; i < 4; i++)
        assert_true(samples[i].imu.stamp_ns == 10 * (i + 1));
    assert_true(samples[4].imu.stamp_ns == 5000000000); /* off the clock: the step's to judge */
    for (int i = 0; i < 5000; i++)
        hear(1000 + i, 0, 0, true);
    const uint64_t lost = atomic_load(&input.no_room);
    assert_true(lost > 0);
    uint32_t came = 0, steps = 0, count;
    while ((count = take(1000000, true)) > 0) {
        assert_in_range(count, 1, FOVEA_INPUT_SAMPLES_MAX);
        came += count;
        steps++;
    }
    assert_int_equal(came + lost, 5000);
    assert_int_equal(steps, (came + FOVEA_INPUT_SAMPLES_MAX - 1) / FOVEA_INPUT_SAMPLES_MAX);
}

/* The offset of the rig says when a sample is due. */
static void the_time_offset_counts(void **state)
{
    (void)state;
    input.time_offset_ns = 5000;
    hear(1000, 0, 0, true);
    assert_int_equal(take(5999, true), 0);
    assert_int_equal(take(6000, true), 1);
    assert_true(samples[0].imu.stamp_ns == 1000); /* as it came: the gate adds it */
}

static void a_device_of_iio_brings_them_too(void **state)
{
    static const int16_t raw[6] = {1000, 0, 0, 0, 0, 981};
    struct fovea_error error;
    struct fv_iio *iio;
    (void)state;
    fake_iio_make();
    if (fv_iio_open("adis16448", 0, &iio, &error) != FOVEA_OK) fail_msg("%s", error.text);
    memset(&input, 0, sizeof input);
    memset(&settings, 0, sizeof settings);
    snprintf(settings.imu, sizeof settings.imu, "iio:adis16448");
    fv_imu_input_open(&input, &settings, iio);
    assert_false(fv_imu_input_hears(&input));
    assert_int_equal(fv_iio_start(iio, &error), FOVEA_OK);
    assert_true(fake_iio_comes_to_say("buffer/enable", "1"));
    assert_true(fake_iio_scan(raw, 900000) && fake_iio_scan(raw, 1100000));
    struct fv_iio_counts counts = {0};
    int64_t end_ns = 0;
    while (counts.samples < 2 && fv_test_patient(&end_ns, 5))
        fv_iio_counts(iio, &counts);
    assert_int_equal(take(1000000, true), 1);
    assert_true(samples[0].imu.stamp_ns == 900000 && samples[0].imu.gyro[0] > 0.999 &&
                samples[0].imu.acceleration[2] > 9.8);
    assert_int_equal(take(1200000, true), 1);
    fv_iio_close(iio);
    fake_iio_remove();
}

/* Frames of a camera that stamps on another clock of the host. */
static void stamps_of_iio_follow_the_frames_clock(void **state)
{
    static const int16_t raw[6] = {0, 0, 0, 0, 0, 981};
    static const enum fovea_clock clocks[] = {FOVEA_CLOCK_MONOTONIC, FOVEA_CLOCK_BOOTTIME,
                                              FOVEA_CLOCK_REALTIME};
    static const clockid_t hosts[] = {CLOCK_MONOTONIC, CLOCK_BOOTTIME, CLOCK_REALTIME};
    struct fovea_error error;
    struct fv_iio *iio;
    (void)state;
    fake_iio_make();
    if (fv_iio_open("adis16448", 0, &iio, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(fv_iio_start(iio, &error), FOVEA_OK);
    assert_true(fake_iio_comes_to_say("buffer/enable", "1"));
    for (uint64_t c = 0; c < 3; c++) {
        struct fv_iio_counts counts = {0};
        const int64_t at_ns = fv_clock_ns(CLOCK_MONOTONIC),
                      apart_ns = c == 0 ? 0 : fv_clock_ns(hosts[c]) - fv_clock_ns(CLOCK_MONOTONIC);
        memset(&input, 0, sizeof input);
        fv_imu_input_open(&input, &settings, iio);
        frame.clock = clocks[c];
        assert_int_equal(take(at_ns + apart_ns, true), 0);
        assert_true(fake_iio_scan(raw, at_ns));
        int64_t end_ns = 0;
        while (counts.samples < c + 1 && fv_test_patient(&end_ns, 5))
            fv_iio_counts(iio, &counts);
        assert_int_equal(take(at_ns + apart_ns + FV_SECOND_NS, true), 1);
        const int64_t off_ns = samples[0].imu.stamp_ns - at_ns - apart_ns;
        /* The clocks are read in turn, a while apart. */
        assert_true(off_ns > -FV_SECOND_NS && off_ns < FV_SECOND_NS);
        assert_true(c > 0 || off_ns == 0);
    }
    fv_iio_close(iio);
    fake_iio_remove();
}

/* ---- what sees each sample as it comes ------------------------------------------------------- */

static struct fovea_imu_sample tapped[8];
static atomic_uint tapped_count;

static void tap(void *context, const struct fovea_imu_sample *sample)
{
    assert_ptr_equal(context, tapped);
    const unsigned at = atomic_load(&tapped_count);
    if (at < 8) tapped[at] = *sample;
    atomic_store(&tapped_count, at + 1);
}

static int open_tapped(void **state)
{
    (void)open_lcm(state);
    atomic_store(&tapped_count, 0);
    fv_imu_input_tap(&input, tap, tapped);
    return 0;
}

/* One that is seen, with a stamp `offset_ns` from now; again where it was held up on the way. */
static void hear_now(int64_t offset_ns, int8_t clock, int64_t *stamp_ns)
{
    const unsigned before = tapped_count;
    int64_t end_ns = 0;
    while (tapped_count == before && fv_test_patient(&end_ns, 0)) {
        *stamp_ns = fv_clock_ns(CLOCK_MONOTONIC);
        hear(*stamp_ns + offset_ns, clock, 0, offset_ns == 0);
    }
    assert_int_equal(tapped_count, before + 1);
}

static void each_sample_is_seen_on_the_frames_clock(void **state)
{
    (void)state;
    int64_t stamp_ns = fv_clock_ns(CLOCK_MONOTONIC);
    hear(stamp_ns, 0, 0, true);
    assert_int_equal(tapped_count, 0); /* no frame yet */
    (void)take(stamp_ns, true);
    hear(fv_clock_ns(CLOCK_MONOTONIC), 0, 0, false); /* whose clock? */
    assert_int_equal(tapped_count, 0);
    hear_now(0, 0, &stamp_ns);
    assert_true(tapped[0].stamp_ns == stamp_ns && tapped[0].gyro[2] == 3);
    hear_now(utc_ns, (int8_t)FOVEA_CLOCK_REALTIME, &stamp_ns); /* another host's */
    assert_true(tapped[1].stamp_ns == stamp_ns && tapped[1].gyro[2] == 3);
    while (input.no_room == 0) /* the loop takes none, so that the ring gets full */
        hear(1, 0, 0, true);
    hear_now(0, 0, &stamp_ns);
    assert_true(tapped[2].stamp_ns == stamp_ns);
}

static void stamps_far_from_now_are_not_seen(void **state)
{
    (void)state;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    (void)take(now_ns, true);
    hear(now_ns + 60 * FV_SECOND_NS, 0, 0, true);
    hear(now_ns - 60 * FV_SECOND_NS, 0, 0, true);
    hear(INT64_MAX, 0, 0, true);
    hear(INT64_MIN, 0, 0, true);
    assert_int_equal(tapped_count, 0);
    input.time_offset_ns = -60 * FV_SECOND_NS; /* which the step adds */
    int64_t end_ns = 0;
    while (tapped_count == 0 && fv_test_patient(&end_ns, 0))
        hear(fv_clock_ns(CLOCK_MONOTONIC) + 60 * FV_SECOND_NS, 0, 0, true);
    assert_int_equal(tapped_count, 1);
}

static void a_device_of_iio_shows_each_sample(void **state)
{
    static const int16_t raw[6] = {1000, 0, 0, 0, 0, 981};
    struct fovea_error error;
    struct fv_iio *iio;
    (void)state;
    fake_iio_make();
    if (fv_iio_open("adis16448", 0, &iio, &error) != FOVEA_OK) fail_msg("%s", error.text);
    fv_imu_input_open(&input, &settings, iio);
    fv_imu_input_tap(&input, tap, tapped);
    frame.clock = FOVEA_CLOCK_REALTIME;
    (void)take(fv_clock_ns(CLOCK_REALTIME), true);
    assert_int_equal(fv_iio_start(iio, &error), FOVEA_OK);
    assert_true(fake_iio_comes_to_say("buffer/enable", "1"));
    unsigned written = 0; /* one that waits for a quarter of a second is not seen */
    int64_t end_ns = 0;
    while (tapped_count == 0 && fv_test_patient(&end_ns, 20)) {
        assert_true(fake_iio_scan(raw, fv_clock_ns(CLOCK_MONOTONIC)));
        written++;
    }
    fv_iio_close(iio);
    fake_iio_remove();
    assert_true(tapped_count > 0 && tapped_count <= written);
    const int64_t age_ns = fv_clock_ns(CLOCK_REALTIME) - tapped[0].stamp_ns;
    assert_true(age_ns > -FV_SECOND_NS && age_ns < 60 * FV_SECOND_NS && tapped[0].gyro[0] > 0.999);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(samples_come_with_their_frame, open_lcm),
        cmocka_unit_test_setup(the_first_frame_has_no_old_samples, open_lcm),
        cmocka_unit_test_setup(samples_just_before_the_first_frame_are_kept, open_lcm),
        cmocka_unit_test_setup(what_is_lost_before_the_first_frame_is_told_apart, open_lcm),
        cmocka_unit_test_setup(stamps_are_put_on_the_frames_clock, open_lcm),
        cmocka_unit_test_setup(nothing_overflows, open_lcm),
        cmocka_unit_test_setup(the_time_offset_counts, open_lcm),
        cmocka_unit_test_setup(a_device_of_iio_brings_them_too, open_lcm),
        cmocka_unit_test_setup(stamps_of_iio_follow_the_frames_clock, open_lcm),
        cmocka_unit_test_setup(each_sample_is_seen_on_the_frames_clock, open_tapped),
        cmocka_unit_test_setup(stamps_far_from_now_are_not_seen, open_tapped),
        cmocka_unit_test_setup(a_device_of_iio_shows_each_sample, open_tapped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
