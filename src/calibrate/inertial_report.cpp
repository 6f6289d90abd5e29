#include "calibrate/inertial_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "calibrate/html.h"
#include "calibrate/json_text.h"
#include "calibrate/report_page.h"

namespace calibrate
{
namespace
{

constexpr double DEGREE = 57.29577951308232;
constexpr const char *PARTS[INERTIAL_PARTS] = {"gyroscope", "accelerometer"};
constexpr const char *UNITS[INERTIAL_PARTS] = {"rad/s", "m/s^2"};

/* What is added to the stamp of a sample for the cameras' clock, as the configuration has it. */
double offset_s(const InertialSolution &solution)
{
    return -solution.time_shift_s;
}

std::string row(const std::string &what, double value, double stdev, const char *shown = "%.3f")
{
    return value_row(what, "imu", value, stdev, shown);
}

/* As it was stated, since place and time hold for samples that are corrected so. */
std::string correction_line(const char *key, const double rows[12])
{
    if (std::all_of(rows, rows + 12, [](double value) { return value == 0; })) return "";
    std::string text = std::string(key) + ": [";
    for (int i = 0; i < 12; i++)
        text += formatted(i == 0 ? "%.17g" : ", %.17g", rows[i]);
    return text + "]\n";
}

} // namespace

std::string inertial_json(const Inertial &inertial)
{
    const InertialSolution &s = inertial.solution;
    std::string text =
        "{\"sensor\": " + json_string(inertial.sensor) +
        formatted(",\n    \"samples_used\": %d, \"missing\": %d, \"saturated\": [%d, "
                  "%d],\n    \"views_used\": %d, \"views_with_board\": %d, "
                  "\"corners_used\": %d,\n    \"fits\": ",
                  s.samples_used, s.missing, s.saturated[0], s.saturated[1], s.views_used,
                  s.views_with_board, s.corners_used) +
        json_number(s.fits) + ", \"rate_ratio\": " + json_number(s.rate_ratio);
    if (!inertial.solved) return text + "}";
    text += ",\n    \"T_cam0_imu\": " + json_numbers(rows_of(s.T_cam_imu).data(), 12) +
            ",\n    \"rotation_stdev_rad\": " + json_numbers(s.stdev.data(), 3) +
            ", \"translation_stdev_m\": " + json_numbers(s.stdev.data() + 3, 3) +
            ",\n    \"time_offset_s\": {\"value\": " + json_number(offset_s(s)) +
            ", \"stdev\": " + json_number(s.time_shift_stdev_s) +
            "},\n    \"timeshift_cam_imu_s\": " + json_number(s.time_shift_s) +
            ",\n    \"clock_drift\": {\"value\": " + json_number(s.clock_drift) +
            ", \"stdev\": " + json_number(s.clock_drift_stdev) + "}" +
            ",\n    \"gravity_board_m_s2\": " + json_numbers(s.gravity_m_s2.data(), 3) +
            ", \"gravity_stdev_rad\": " + json_number(s.gravity_stdev_rad);
    for (int part = 0; part < INERTIAL_PARTS; part++)
        text += formatted(",\n    \"%s\": {\"bias\": ", PARTS[part]) +
                json_numbers(s.bias[part], 3) +
                ", \"bias_stdev\": " + json_numbers(s.bias_stdev[part], 3) +
                ", \"noise_over_stated\": " + json_number(s.excess[part]) + "}";
    const double turns[2] = {s.turn_rad_s[0], s.turn_rad_s[1]};
    return text + ",\n    \"noise_px\": " + json_number(s.noise_px) +
           ", \"alone_noise_px\": " + json_number(s.alone_px) +
           ",\n    \"turn_rad_s\": " + json_numbers(turns, 2) +
           ", \"acceleration_m_s2\": " + json_number(s.acceleration_m_s2) +
           ",\n    \"duration_s\": " + json_number(s.duration_s) +
           ", \"knots_hz\": " + json_number(s.knots_hz) + "}";
}

std::string inertial_section(const Inertial &inertial)
{
    const InertialSolution &s = inertial.solution;
    if (!inertial.solved) return "";
    std::string rows = place_rows(pose_of(s.T_cam_imu.inverse()), s.stdev);
    rows += row("time offset, added to the stamp of a sample, ms", 1e3 * offset_s(s),
                1e3 * s.time_shift_stdev_s, "%.4f");
    rows += row("clock of the sensor, faster by, ppm", 1e6 * s.clock_drift,
                1e6 * s.clock_drift_stdev, "%.1f");
    for (int part = 0; part < INERTIAL_PARTS; part++)
        for (int i = 0; i < 3; i++)
            rows += row(formatted("bias of the %s, %c, %s", PARTS[part], "xyz"[i], UNITS[part]),
                        s.bias[part][i], s.bias_stdev[part][i], "%.5f");
    for (int part = 0; part < INERTIAL_PARTS; part++)
        rows += row(formatted("noise of the %s over what its file states", PARTS[part]),
                    s.excess[part], NAN, "%.2f");
    rows += row("rates about two axes, rad/s", s.turn_rad_s[0], NAN) +
            row("about the second", s.turn_rad_s[1], NAN) +
            row("accelerations, m/s^2", s.acceleration_m_s2, NAN) +
            row("noise of one coordinate of the corners, px", s.noise_px, NAN) +
            row("of pictures posed by themselves, px", s.alone_px, NAN);
    return section("imu", "Inertial sensor",
                   "<p>The first camera in the frame of " + escaped(inertial.sensor) + ", from " +
                       datum("imu_views_used", s.views_used, "%.0f") + " pictures in " +
                       datum("duration_s", s.duration_s, "%.1f") + " s and " +
                       datum("samples_used", s.samples_used, "%.0f") + " samples.</p>\n" +
                       values_table(rows));
}

void inertial_print(const Inertial &inertial)
{
    const InertialSolution &s = inertial.solution;
    if (!inertial.solved) return;
    const Pose place = pose_of(s.T_cam_imu.inverse());
    printf("imu       %s: cam0 at %.2f %.2f %.2f mm in its frame (+- %.2g %.2g %.2g)\n"
           "          turned by %.3f %.3f %.3f degrees (+- %.2g %.2g %.2g)\n"
           "          time offset %.4f ms (+- %.2g), added to the stamps of its samples\n"
           "          bias of the gyroscope %.5f %.5f %.5f rad/s, of the accelerometer %.4f %.4f "
           "%.4f m/s^2\n"
           "          noise %.2f and %.2f times the stated one; corners %.3f px; %d pictures, %d "
           "samples\n",
           inertial.sensor.c_str(), 1e3 * place[3], 1e3 * place[4], 1e3 * place[5],
           1e3 * s.stdev[3], 1e3 * s.stdev[4], 1e3 * s.stdev[5], DEGREE * place[0],
           DEGREE * place[1], DEGREE * place[2], DEGREE * s.stdev[0], DEGREE * s.stdev[1],
           DEGREE * s.stdev[2], 1e3 * offset_s(s), 1e3 * s.time_shift_stdev_s, s.bias[0][0],
           s.bias[0][1], s.bias[0][2], s.bias[1][0], s.bias[1][1], s.bias[1][2], s.excess[0],
           s.excess[1], s.noise_px, s.views_used, s.samples_used);
}

std::string inertial_file(const Inertial &inertial, Grade grade, const std::string &date)
{
    const InertialSolution &s = inertial.solution;
    const std::array<double, 12> T = rows_of(s.T_cam_imu);
    std::string text = formatted(
        "# The inertial sensor before cam0, by fovea-calibrate rig of %s: %s.\n"
        "# Rotation +- %.3f %.3f %.3f degrees, place +- %.2f %.2f %.2f mm, time +- %.4f ms.\n"
        "sensor_type: imu\n"
        "# T_BS takes points of the sensor to the body, which is cam0 (T_body_cam is the identity)\n"
        "T_BS:\n  cols: 4\n  rows: 4\n  data: [",
        date.c_str(), grade_name(grade), DEGREE * s.stdev[0], DEGREE * s.stdev[1],
        DEGREE * s.stdev[2], 1e3 * s.stdev[3], 1e3 * s.stdev[4], 1e3 * s.stdev[5],
        1e3 * s.time_shift_stdev_s);
    for (const double value : T)
        text += formatted("%.17g, ", value);
    const fovea_rig_imu &imu = inertial.imu;
    return text +
           formatted("0.0, 0.0, 0.0, 1.0]\nrate_hz: %.9g\n"
                     "# added to the stamp of a sample it gives the time of the cameras\n"
                     "time_offset_ns: %.0f\n"
                     "gyroscope_noise_density: %.9g\ngyroscope_random_walk: %.9g\n"
                     "accelerometer_noise_density: %.9g\naccelerometer_random_walk: %.9g\n",
                     imu.rate_hz, 1e9 * offset_s(s), imu.gyro_noise, imu.gyro_walk,
                     imu.acceleration_noise, imu.acceleration_walk) +
           correction_line("gyro_correction", imu.gyro_correction) +
           correction_line("acceleration_correction", imu.acceleration_correction);
}

} // namespace calibrate
