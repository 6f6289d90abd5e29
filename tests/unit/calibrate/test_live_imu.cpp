/* An inertial sensor beside a live camera: what LCM and Linux IIO bring of it comes onto the
 * pictures' clock. */
#include "calibrate/live_imu.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <unistd.h>

#include <lcm/lcm.h>

#include "drivers/clock.h"
#include "fovea_imu_t.h"

#include "common/cmocka_cpp.h"
extern "C" {
#include "common/fake_iio.h"
#include "common/patience.h"
}

using namespace calibrate;

#define LCM_URL "udpm://239.255.76.67:7690"

namespace
{

constexpr int64_t UTC_NS = 1'700'000'000'000'000'000;

fovea_imu_t message_of(int8_t clock, int64_t time_ns, int64_t utc_offset_ns = 0)
{
    fovea_imu_t message = {};
    message.stamp.clock = clock;
    message.stamp.time_ns = time_ns;
    message.stamp.utc_offset_ns = utc_offset_ns;
    for (int i = 0; i < 3; i++) {
        message.gyro[i] = .1 * (i + 1);
        message.acceleration[i] = i + 1;
    }
    return message;
}

/* What the messages of a sensor become on that clock. A last one marks the end, and is left out.
 * The channel is this process's own. */
std::vector<fovea_imu_sample> heard(LiveImu &imu, std::vector<fovea_imu_t> messages,
                                    fovea_clock clock)
{
    constexpr int64_t end_ns = INT64_MAX;
    const std::string channel = "IMU" + std::to_string(getpid());
    fovea_error error;
    std::vector<fovea_imu_sample> samples;
    lcm_t *lcm = lcm_create(LCM_URL "?ttl=0");
    assert_non_null(lcm);
    if (imu.open({"lcm:" + channel, LCM_URL, "", 0}, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    messages.push_back(message_of((int8_t)clock, end_ns));
    for (const fovea_imu_t &message : messages)
        assert_int_equal(fovea_imu_t_publish(lcm, channel.c_str(), &message), 0);
    int64_t patience_ns = 0;
    while ((samples.empty() || samples.back().stamp_ns != end_ns) &&
           fv_test_patient(&patience_ns, 5))
        imu.take(clock, samples);
    lcm_destroy(lcm);
    assert_false(samples.empty());
    assert_true(samples.back().stamp_ns == end_ns);
    samples.pop_back();
    return samples;
}

void a_stamp_of_the_pictures_clock_counts_as_it_is(void **)
{
    LiveImu imu;
    const std::vector<fovea_imu_sample> samples = heard(
        imu,
        {message_of(FOVEA_CLOCK_MONOTONIC, 1000), message_of(FOVEA_CLOCK_MONOTONIC, 2000, UTC_NS)},
        FOVEA_CLOCK_MONOTONIC);
    assert_int_equal(samples.size(), 2);
    assert_true(samples[0].stamp_ns == 1000 && samples[1].stamp_ns == 2000);
    for (int i = 0; i < 3; i++)
        assert_true(samples[0].gyro[i] == .1 * (i + 1) && samples[0].acceleration[i] == i + 1);
    assert_int_equal(imu.no_clock(), 0);
    assert_true(imu.gyro_range() == 0 && imu.acceleration_range() == 0);
}

/* UTC itself has no offset to UTC. */
void other_stamps_count_by_their_utc(void **)
{
    constexpr int64_t near_ns = 1'000'000'000; /* between two readings of the clocks */
    const int64_t utc_of_monotonic_ns = fv_clock_ns(CLOCK_REALTIME) - fv_clock_ns(CLOCK_MONOTONIC);
    LiveImu imu;
    const std::vector<fovea_imu_sample> samples =
        heard(imu,
              {message_of(FOVEA_CLOCK_REALTIME, UTC_NS),
               message_of(FOVEA_CLOCK_BOOTTIME, 10 * near_ns, UTC_NS)},
              FOVEA_CLOCK_MONOTONIC);
    assert_int_equal(samples.size(), 2);
    assert_true(std::llabs(samples[0].stamp_ns - (UTC_NS - utc_of_monotonic_ns)) < near_ns);
    assert_true(samples[1].stamp_ns - samples[0].stamp_ns == 10 * near_ns);
}

void stamps_that_state_no_clock_are_refused(void **)
{
    LiveImu imu;
    const std::vector<fovea_imu_sample> samples =
        heard(imu,
              {message_of(FOVEA_CLOCK_BOOTTIME, 1000), message_of(FOVEA_CLOCK_SIMULATED, 2000),
               message_of(FOVEA_CLOCK_MONOTONIC, 3000)},
              FOVEA_CLOCK_MONOTONIC);
    assert_int_equal(samples.size(), 1);
    assert_true(samples[0].stamp_ns == 3000);
    assert_int_equal(imu.no_clock(), 2);
}

void samples_that_are_none_or_come_late_are_left_out(void **)
{
    fovea_imu_t broken[2];
    for (fovea_imu_t &one : broken)
        one = message_of(FOVEA_CLOCK_MONOTONIC, 2000);
    broken[0].gyro[1] = NAN;
    broken[1].acceleration[2] = INFINITY;
    LiveImu imu;
    const std::vector<fovea_imu_sample> samples =
        heard(imu,
              {message_of(FOVEA_CLOCK_MONOTONIC, 1000), broken[0], broken[1],
               message_of(FOVEA_CLOCK_MONOTONIC, 1000), message_of(FOVEA_CLOCK_MONOTONIC, 3000),
               message_of(FOVEA_CLOCK_MONOTONIC, 2000)},
              FOVEA_CLOCK_MONOTONIC);
    assert_int_equal(samples.size(), 2);
    assert_true(samples[0].stamp_ns == 1000 && samples[1].stamp_ns == 3000);
}

/* The kernel's stamps are on CLOCK_MONOTONIC. */
void samples_of_iio_come_onto_the_pictures_clock(void **)
{
    constexpr int64_t second_ns = 1'000'000'000;
    const int16_t raw[2][6] = {{100, -200, 300, 981, -2, 5}, {1, 0, 0, 0, 0, 0}};
    const fovea_clock clocks[] = {FOVEA_CLOCK_MONOTONIC, FOVEA_CLOCK_REALTIME};
    for (const fovea_clock clock : clocks) {
        fake_iio_make();
        {
            LiveImu imu;
            fovea_error error;
            std::vector<fovea_imu_sample> samples;
            if (imu.open({"iio:adis16448", "", "", 400}, &error) != FOVEA_OK)
                fail_msg("%s", error.text);
            assert_true(fake_iio_comes_to_say("buffer/enable", "1"));
            assert_true(fake_iio_says("sampling_frequency", "400"));
            assert_true(std::fabs(imu.gyro_range() - 32.767) < 1e-9);
            assert_true(std::fabs(imu.acceleration_range() - 327.67) < 1e-9);
            const int64_t monotonic_ns = fv_clock_ns(CLOCK_MONOTONIC),
                          there_ns = fv_clock_ns(clock == FOVEA_CLOCK_MONOTONIC ? CLOCK_MONOTONIC
                                                                                : CLOCK_REALTIME);
            assert_true(fake_iio_scan(raw[0], monotonic_ns) &&
                        fake_iio_scan(raw[1], monotonic_ns + 5 * second_ns));
            for (int64_t end_ns = 0; samples.size() < 2 && fv_test_patient(&end_ns, 5);)
                imu.take(clock, samples);
            assert_int_equal(samples.size(), 2);
            assert_true(std::llabs(samples[0].stamp_ns - there_ns) < second_ns);
            assert_true(std::llabs(samples[1].stamp_ns - samples[0].stamp_ns - 5 * second_ns) <
                        second_ns);
            for (int i = 0; i < 3; i++) {
                assert_true(std::fabs(samples[0].gyro[i] - .001 * raw[0][i]) < 1e-12);
                assert_true(std::fabs(samples[0].acceleration[i] - .01 * raw[0][3 + i]) < 1e-12);
            }
            assert_int_equal(imu.no_clock(), 0);
        }
        fake_iio_remove();
    }
}

void what_is_no_sensor_is_refused(void **)
{
    assert_true(live_imu_valid("lcm:IMU") && live_imu_valid("iio:adis16448"));
    for (const char *sensor : {"", "source", "lcm:", "iio:", "lcmlog:IMU"})
        assert_false(live_imu_valid(sensor));
    const std::vector<std::pair<LiveImuSetup, const char *>> wrong = {
        {{"iio:none", "", "", 0}, "iio:none"},
        {{"lcm:IMU", "none", "", 0}, "none"},
        {{"lcm:IMU", "memq://", "", 0}, "nothing is heard from"},
        {{"lcm:IMU", LCM_URL, "two words", 0}, "--listen"},
        {{"lcm:" + std::string(100, 'A'), LCM_URL, "", 0}, "a channel of 100 letters"},
    };
    for (const auto &[setup, words] : wrong) {
        fovea_error error;
        LiveImu imu;
        assert_int_equal(imu.open(setup, &error), FOVEA_ERROR_INPUT);
        if (std::strstr(error.text, words) == nullptr) fail_msg("%s", error.text);
    }
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stamp_of_the_pictures_clock_counts_as_it_is),
        cmocka_unit_test(other_stamps_count_by_their_utc),
        cmocka_unit_test(stamps_that_state_no_clock_are_refused),
        cmocka_unit_test(samples_that_are_none_or_come_late_are_left_out),
        cmocka_unit_test(samples_of_iio_come_onto_the_pictures_clock),
        cmocka_unit_test(what_is_no_sensor_is_refused),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
