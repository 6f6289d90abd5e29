/* fovea-calibrate imu: noise of an inertial sensor from a standing log. */
#include <cstdio>

#include "calibrate/allan_plot.h"
#include "calibrate/command.h"
#include "calibrate/html.h"
#include "calibrate/imu_samples.h"
#include "calibrate/json_text.h"
#include "calibrate/report.h"
#include "calibrate/text_file.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

struct Given {
    std::string source, format = "euroc", out, json, plot;
};

struct Key {
    const char *noise, *walk, *name, *unit;
};
constexpr Key KEYS[IMU_PARTS] = {
    {"gyroscope_noise_density", "gyroscope_random_walk", "gyroscope", "rad/s"},
    {"accelerometer_noise_density", "accelerometer_random_walk", "accelerometer", "m/s^2"}};

/* A walk that does not show is written as the most that it can be: a filter that trusts a bias too
 * long does more harm than one that trusts it too short. */
std::string file_text(const ImuNoise &noise, const Verdict &verdict, bool kalibr,
                      const std::string &date)
{
    std::string text =
        formatted("# Noise of the inertial sensor, by fovea-calibrate imu of %s: %s.\n",
                  date.c_str(), grade_name(verdict.grade));
    if (!kalibr)
        text +=
            "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, "
            "0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";
    for (size_t part = IMU_PARTS; part-- > 0;) {
        const bool shows = noise.walk[part] > 0;
        text += formatted("%s: %.6g # %s/sqrt(Hz), +- %.2g\n%s: %.6g # %s/s/sqrt(Hz), ",
                          KEYS[part].noise, noise.white[part], KEYS[part].unit,
                          noise.white_stdev[part], KEYS[part].walk,
                          shows ? noise.walk[part] : noise.walk_most[part], KEYS[part].unit);
        text += shows ? formatted("+- %.2g\n", noise.walk_stdev[part])
                      : "at most: none shows in the log\n";
    }
    return text + (kalibr ? formatted("rostopic: /imu0\nupdate_rate: %.6g\n", noise.rate_hz)
                          : formatted("rate_hz: %.6g\n", noise.rate_hz));
}

std::string json(const ImuNoise &noise, const Verdict &verdict, const std::string &source,
                 const std::string &date)
{
    std::string text =
        "{\n" + json_verdict(verdict, date) + "  \"source\": " + json_string(source) +
        formatted(",\n  \"samples\": %zu,\n  \"late\": %zu,\n  \"duration_s\": ", noise.samples,
                  noise.gaps) +
        json_number(noise.duration_s) + ",\n  \"rate_hz\": " + json_number(noise.rate_hz);
    for (size_t part = 0; noise.rate_hz > 0 && part < IMU_PARTS; part++)
        text += formatted(",\n  \"%s\": {\"value\": ", KEYS[part].noise) +
                json_number(noise.white[part]) +
                ", \"stdev\": " + json_number(noise.white_stdev[part]) +
                formatted("},\n  \"%s\": {\"value\": ", KEYS[part].walk) +
                json_number(noise.walk[part] > 0 ? noise.walk[part] : NAN) +
                ", \"stdev\": " + json_number(noise.walk_stdev[part]) +
                ", \"most\": " + json_number(noise.walk_most[part]) + "}";
    static const char *const axes[] = {"gyro_x",         "gyro_y",         "gyro_z",
                                       "acceleration_x", "acceleration_y", "acceleration_z"};
    text += ",\n  \"allan_deviation\": {";
    for (size_t a = 0; a < 6; a++) {
        text += formatted("%s\n    \"%s\": [", a > 0 ? "," : "", axes[a]);
        for (size_t i = 0; i < noise.axes[a].points.size(); i++) {
            const AllanPoint &point = noise.axes[a].points[i];
            const double pair[2] = {point.tau_s, std::sqrt(point.variance)};
            text += (i > 0 ? ", " : "") + json_numbers(pair, 2);
        }
        text += "]";
    }
    return text + "\n  }\n}\n";
}

void print(const ImuNoise &noise, const Verdict &verdict)
{
    if (noise.rate_hz > 0) {
        printf("log       %zu samples in %.1f s, %.4g Hz\n", noise.samples, noise.duration_s,
               noise.rate_hz);
        for (size_t part = 0; part < IMU_PARTS; part++) {
            printf("%-13s noise %.3g +- %.1g %s/sqrt(Hz), random walk ", KEYS[part].name,
                   noise.white[part], noise.white_stdev[part], KEYS[part].unit);
            if (noise.walk[part] > 0)
                printf("%.3g +- %.1g %s/s/sqrt(Hz)\n", noise.walk[part], noise.walk_stdev[part],
                       KEYS[part].unit);
            else
                printf("at most %.2g %s/s/sqrt(Hz)\n", noise.walk_most[part], KEYS[part].unit);
        }
    }
    print_verdict(verdict);
}

int check(const Given &given)
{
    if (given.source.empty())
        return fv_say_wrong("fovea-calibrate imu: found no --source, expected a recording with an "
                            "inertial sensor, or a file of its samples");
    if (given.format != "euroc" && given.format != "kalibr")
        return fv_say_wrong("--format: found '%s', expected euroc or kalibr", given.format.c_str());
    return files_check(
        {{"--out", given.out, false}, {"--json", given.json, false}, {"--plot", given.plot, false}},
        {{"--source", given.source, given.source.find(':') != std::string::npos}});
}

} // namespace

int command_imu(int argc, char **argv)
{
    Given given;
    const std::vector<Option> options = {
        {"source", "URI|FILE", &given.source,
         "recording with an inertial sensor, or EuRoC's file of samples (data.csv)"},
        {"out", "FILE", &given.out, "write the noise; not when the verdict is fail"},
        {"format", "FORMAT", &given.format,
         "of --out: euroc (default: sensor.yaml, which Fovea reads) or kalibr (imu.yaml)"},
        {"json", "FILE", &given.json, "write the verdict with all its numbers"},
        {"plot", "FILE", &given.plot, "draw the Allan deviation as PNG"},
    };
    std::vector<std::string> operands;
    int status;
    if (!options_parse(argc, argv, options, "", 0, operands, &status)) return status;
    status = check(given);
    if (status != FV_EXIT_OK) return status;
    std::vector<fovea_imu_sample> samples;
    fovea_error error;
    if (read_imu(given.source, samples, &error) != FOVEA_OK) return fv_say_wrong("%s", error.text);
    ImuNoise noise;
    Verdict verdict;
    std::string why;
    if (measure_imu(samples, noise, why))
        verdict = judge_imu(noise);
    else
        add_reason(verdict, Grade::fail, "%s", why.c_str());
    const std::string date = now_text();
    print(noise, verdict);
    if (!given.json.empty())
        status = write_text(given.json, json(noise, verdict, given.source, date));
    if (status == FV_EXIT_OK && !given.plot.empty() && noise.rate_hz > 0 &&
        plot_allan(noise, given.plot.c_str(), &error) != FOVEA_OK)
        status = fv_say_failed("%s", error.text);
    if (status != FV_EXIT_OK) return status;
    if (verdict.grade == Grade::fail) {
        if (!given.out.empty())
            fv_say("%s: not written, as the calibration fails", given.out.c_str());
        return FV_EXIT_FAILED;
    }
    if (given.out.empty()) return FV_EXIT_OK;
    return write_text(given.out, file_text(noise, verdict, given.format == "kalibr", date));
}

} // namespace calibrate
