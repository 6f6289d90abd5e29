/* Noise of inertial sensors: simulated densities are found within the errors that are stated; logs
 * that are too short, or that moved, are called so. */
#include "calibrate/imu_samples.h"
#include "calibrate/allan.h"
#include "calibrate/command.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <unistd.h>

#include "support/text.h"
extern "C" {
#include "drivers/recorded/euroc_imu.h"
}

#include "common/calibrate_command.h"
#include "common/cmocka_cpp.h"
#include "common/data_folder.h"
#include "common/simulated_boards.h"

using namespace calibrate;

namespace
{

constexpr double RATE_HZ = 100;
constexpr double WHITE[2] = {1.7e-4, 2e-3}, WALK[2] = {6e-5, 9e-4};

/* White noise of a density, and a bias that walks, exactly for samples at a rate. */
std::vector<fovea_imu_sample> simulated_log(unsigned seed, double duration_s, bool walks)
{
    simulated::Random random = {std::mt19937_64(seed)};
    std::vector<fovea_imu_sample> samples((size_t)(duration_s * RATE_HZ));
    double bias[6] = {.01, -.02, .003, .1, 0, 9.81};
    for (size_t i = 0; i < samples.size(); i++) {
        samples[i].stamp_ns = (int64_t)((double)i * 1e9 / RATE_HZ);
        for (size_t a = 0; a < 6; a++) {
            const double value = bias[a] + WHITE[a / 3] * std::sqrt(RATE_HZ) * random.gauss();
            (a < 3 ? samples[i].gyro[a] : samples[i].acceleration[a - 3]) = value;
            if (walks) bias[a] += WALK[a / 3] / std::sqrt(RATE_HZ) * random.gauss();
        }
    }
    return samples;
}

ImuNoise measured(const std::vector<fovea_imu_sample> &samples)
{
    ImuNoise noise;
    std::string error;
    if (!measure_imu(samples, noise, error)) fail_msg("%s", error.c_str());
    return noise;
}

void densities_are_found_as_stated(void **)
{
    int count = 0, beyond_three = 0;
    double squares[2] = {0, 0};
    for (unsigned seed = 1; seed <= 8; seed++) {
        const ImuNoise noise = measured(simulated_log(seed, 600, true));
        for (size_t part = 0; part < IMU_PARTS; part++) {
            assert_true(noise.walk[part] > 0);
            const double ratios[2] = {(noise.white[part] - WHITE[part]) / noise.white_stdev[part],
                                      (noise.walk[part] - WALK[part]) / noise.walk_stdev[part]};
            assert_true(std::fabs(noise.white[part] / WHITE[part] - 1) < .02);
            assert_true(std::fabs(noise.walk[part] / WALK[part] - 1) < .35);
            assert_true(WALK[part] < noise.walk_most[part] * 1.1);
            for (size_t i = 0; i < 2; i++) {
                count++;
                beyond_three += std::fabs(ratios[i]) > 3;
                squares[i] += ratios[i] * ratios[i];
            }
        }
    }
    printf("%d densities and walks, %d beyond three standard deviations, rms %.3f and %.3f\n",
           count, beyond_three, std::sqrt(2 * squares[0] / count),
           std::sqrt(2 * squares[1] / count));
    assert_int_equal(beyond_three, 0);
    for (const double square : squares)
        assert_true(std::sqrt(2 * square / count) > .5 && std::sqrt(2 * square / count) < 1.4);
}

bool has_reason(const Verdict &verdict, Grade grade, const char *part)
{
    for (const Reason &reason : verdict.reasons)
        if (reason.grade == grade && std::strstr(reason.text.c_str(), part) != nullptr) return true;
    return false;
}

void a_long_log_passes_and_a_short_one_does_not(void **)
{
    const Verdict whole = judge_imu(measured(simulated_log(1, 3700, true)));
    for (const Reason &reason : whole.reasons)
        printf("%s\n", reason.text.c_str());
    assert_int_equal(whole.grade, Grade::pass);
    assert_true(has_reason(judge_imu(measured(simulated_log(1, 300, true))), Grade::doubtful,
                           "too short for random walks"));
    assert_true(has_reason(judge_imu(measured(simulated_log(1, 20, true))), Grade::fail,
                           "the log is 20.0 s long, too short"));
}

void a_walk_that_does_not_show_is_bounded(void **)
{
    const ImuNoise noise = measured(simulated_log(2, 600, false));
    for (size_t part = 0; part < IMU_PARTS; part++) {
        assert_true(std::fabs(noise.white[part] / WHITE[part] - 1) < .02);
        assert_true(noise.walk[part] < .05 * WALK[part]);
        assert_true(noise.walk_most[part] > 0 && noise.walk_most[part] < .2 * WALK[part]);
    }
}

void what_is_wrong_is_named(void **)
{
    std::vector<fovea_imu_sample> samples = simulated_log(3, 120, true);
    for (size_t i = 6000; i < 6100; i++)
        samples[i].gyro[1] += .1 * std::sin((double)i);
    assert_true(has_reason(judge_imu(measured(samples)), Grade::fail, "moved, most at 60 s"));
    samples = simulated_log(4, 120, true);
    for (fovea_imu_sample &sample : samples)
        for (double &value : sample.acceleration)
            value /= 9.81; /* in g */
    assert_true(has_reason(judge_imu(measured(samples)), Grade::doubtful, "not in m/s^2"));
    samples = simulated_log(5, 120, true);
    for (size_t i = 100; i < samples.size(); i += 100)
        samples.erase(samples.begin() + (ptrdiff_t)i);
    assert_true(has_reason(judge_imu(measured(samples)), Grade::doubtful, "come late"));
    ImuNoise noise;
    std::string error;
    assert_false(measure_imu({}, noise, error));
    assert_string_equal(error.c_str(),
                        "found 0 samples of an inertial sensor, expected 100 or more");
}

int run(const std::vector<std::string> &words)
{
    return run_command(command_imu, words);
}

/* From a file in EuRoC's layout to one that Fovea reads. */
void the_command_writes_what_fovea_reads(void **)
{
    char folder[] = "/tmp/fovea-imu-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string log = std::string(folder) + "/data.csv",
                      out = std::string(folder) + "/sensor.yaml", json = out + ".json",
                      plot = out + ".png", kalibr = out + ".kalibr";
    FILE *file = std::fopen(log.c_str(), "w");
    assert_non_null(file);
    for (const fovea_imu_sample &s : simulated_log(6, 120, true))
        std::fprintf(file, "%lld,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", (long long)s.stamp_ns + 1,
                     s.gyro[0], s.gyro[1], s.gyro[2], s.acceleration[0], s.acceleration[1],
                     s.acceleration[2]);
    assert_int_equal(std::fclose(file), 0);
    const int status = run({"imu", "--source", log, "--out", out, "--json", json, "--plot", plot});
    const int second = run({"imu", "--source", log, "--out", kalibr, "--format", "kalibr"});
    fovea_rig_imu imu;
    fovea_error error;
    const fovea_status read = fv_euroc_imu_sensor(out.c_str(), &imu, &error);
    char *text = nullptr;
    size_t bytes = 0;
    const std::string of_kalibr =
        fv_text_read(kalibr.c_str(), 10000, &text, &bytes, &error) == FOVEA_OK ? text : "";
    std::free(text);
    const bool drawn = access(plot.c_str(), R_OK) == 0;
    for (const std::string &one : {log, out, json, plot, kalibr})
        unlink(one.c_str());
    assert_int_equal(rmdir(folder), 0);
    assert_int_equal(status, 0);
    assert_int_equal(second, 0);
    assert_true(drawn);
    if (read != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(std::fabs(imu.rate_hz - RATE_HZ) < .01);
    assert_true(std::fabs(imu.gyro_noise / WHITE[0] - 1) < .05);
    assert_true(std::fabs(imu.acceleration_noise / WHITE[1] - 1) < .05);
    /* two minutes tell walks roughly, but not one sensor's for the other's, 15 times as large */
    assert_true(imu.gyro_walk > WALK[0] / 4 && imu.gyro_walk < 4 * WALK[0]);
    assert_true(imu.acceleration_walk > WALK[1] / 4 && imu.acceleration_walk < 4 * WALK[1]);
    const char *const walks[] = {"\ngyroscope_random_walk: ", "\naccelerometer_random_walk: "};
    const double read_walks[] = {imu.gyro_walk, imu.acceleration_walk};
    for (int i = 0; i < 2; i++) {
        const char *found = std::strstr(of_kalibr.c_str(), walks[i]);
        assert_non_null(found);
        assert_true(std::fabs(std::strtod(found + std::strlen(walks[i]), nullptr) / read_walks[i] -
                              1) < 1e-3);
    }
    for (const char *key : {"\naccelerometer_noise_density: ", "\naccelerometer_random_walk: ",
                            "\ngyroscope_noise_density: ", "\ngyroscope_random_walk: ",
                            "\nrostopic: /imu0\n", "\nupdate_rate: 100"})
        assert_non_null(std::strstr(of_kalibr.c_str(), key));
}

void a_real_log_of_two_seconds_is_too_short(void **)
{
    const std::string log =
        std::string(fv_data_folder()) + "/euroc_v101_standing/mav0/imu0/data.csv";
    if (access(log.c_str(), R_OK) != 0) {
        printf("SKIPPED the real log: %s is not there\n", log.c_str());
        skip();
    }
    assert_int_equal(run({"imu", "--source", log}), 1);
}

void wrong_input_is_refused(void **)
{
    assert_int_equal(run({"imu"}), 2);
    assert_int_equal(run({"imu", "--source", "sim:orbit?frames=3"}), 2);
    assert_int_equal(run({"imu", "--source", "/nowhere.csv"}), 2);
    assert_int_equal(run({"imu", "--source", "/nowhere.csv", "--format", "ros"}), 2);
    assert_int_equal(run({"imu", "--source", "sim:orbit?frames=30&imu=200"}), 1); /* too short */
}

/* Samples that are not finite are passed over; one that is repeated or late leaves open what is
 * lacking. */
void odd_samples_of_a_log(void **)
{
    char path[] = "/tmp/fovea-imu-XXXXXX";
    const int made = mkstemp(path);
    assert_true(made >= 0);
    close(made);
    for (const char *third : {"15,nan,0,0,0,0,9.8\n", "10,1,0,0,0,0,9.8\n", "5,1,0,0,0,0,9.8\n"}) {
        std::vector<fovea_imu_sample> samples;
        fovea_error error;
        FILE *file = std::fopen(path, "w");
        assert_non_null(file);
        std::fprintf(file, "1,1,0,0,0,0,9.8\n10,1,0,0,0,0,9.8\n%s20,1,0,0,0,0,9.8\n", third);
        assert_int_equal(std::fclose(file), 0);
        const fovea_status status = read_imu(path, samples, &error);
        if (std::strstr(third, "nan") != nullptr) {
            assert_true(status == FOVEA_OK && samples.size() == 3 && samples[2].stamp_ns == 20);
            continue;
        }
        assert_int_equal(status, FOVEA_ERROR_INPUT);
        assert_non_null(std::strstr(error.text, "expected one after the sample before, of 10"));
    }
    unlink(path);
}

/* All the time and smoothly, so that no second stands out by its noise; or an axis is dead. */
void a_sensor_that_moves_or_is_dead_fails(void **)
{
    assert_int_equal(run({"imu", "--source", "sim:orbit?frames=2100&imu=200&width=64&height=64"}),
                     1);
    ImuNoise noise;
    noise.duration_s = 4000;
    noise.specific_force = 9.81;
    for (auto &axis : noise.axes)
        axis.white = 1e-3;
    noise.axes[1].white = 0;
    bool named = false;
    for (const Reason &reason : judge_imu(noise).reasons)
        named |= reason.text.find("an axis whose values never change") != std::string::npos;
    assert_true(named);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(densities_are_found_as_stated),
        cmocka_unit_test(a_long_log_passes_and_a_short_one_does_not),
        cmocka_unit_test(a_walk_that_does_not_show_is_bounded),
        cmocka_unit_test(what_is_wrong_is_named),
        cmocka_unit_test(the_command_writes_what_fovea_reads),
        cmocka_unit_test(a_real_log_of_two_seconds_is_too_short),
        cmocka_unit_test(wrong_input_is_refused),
        cmocka_unit_test(odd_samples_of_a_log),
        cmocka_unit_test(a_sensor_that_moves_or_is_dead_fails),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
