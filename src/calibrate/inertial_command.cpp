#include "calibrate/inertial_command.h"

#include <algorithm>

#include "calibrate/command.h"
#include "calibrate/inertial_problem.h"
#include "drivers/table.h"
#include "support/text.h"
extern "C" {
#include "app/network/url_check.h"
#include "drivers/recorded/euroc_imu.h"
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr double SECONDS_DEFAULT = 60, SECONDS_MIN = 5, SECONDS_MAX = 600;
constexpr const char *OWN = "source"; /* the samples that come with the pictures */

double seconds_of(const InertialGiven &given)
{
    double seconds = SECONDS_DEFAULT;
    if (!given.seconds.empty() && !fv_text_number(given.seconds.c_str(), &seconds)) return -1;
    return seconds;
}

LiveImuSetup setup_of(const InertialGiven &given, const fovea_rig_imu &imu)
{
    if (given.sensor == OWN) return {};
    return {given.sensor, given.lcm_url, given.listen, imu.rate_hz};
}

int no_densities(const std::string &source)
{
    return fv_say_wrong("%s: found an inertial sensor without noise densities, expected "
                        "--imu-file ('fovea-calibrate imu' writes one)",
                        source.c_str());
}

/* Rows of a matrix and a constant; all 0: none is stated. */
void correct(const double rows[12], double range, double values[3])
{
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> M(rows);
    Eigen::Map<Eigen::Vector3d> measured(values);
    if (M.isZero(0) || is_saturated(values, range)) return;
    measured = (M.leftCols<3>() * measured + M.col(3)).eval();
}

} // namespace

std::vector<fovea_imu_sample> corrected_samples(const std::vector<fovea_imu_sample> &samples,
                                                const fovea_rig_imu &imu)
{
    std::vector<fovea_imu_sample> corrected = samples;
    for (fovea_imu_sample &sample : corrected) {
        correct(imu.gyro_correction, imu.gyro_range, sample.gyro);
        correct(imu.acceleration_correction, imu.acceleration_range, sample.acceleration);
    }
    return corrected;
}

int check_inertial(const InertialGiven &given, const std::vector<std::string> &sources)
{
    fovea_error error;
    if (!given.wanted()) {
        for (const auto &[name, value] :
             {std::pair("--imu-file", &given.file), std::pair("--imu-out", &given.out),
              std::pair("--seconds", &given.seconds), std::pair("--lcm-url", &given.lcm_url),
              std::pair("--listen", &given.listen)})
            if (!value->empty())
                return fv_say_wrong("fovea-calibrate rig: found %s without --imu, expected both",
                                    name);
        return FV_EXIT_OK;
    }
    if (given.sensor != OWN && !live_imu_valid(given.sensor))
        return fv_say_wrong("--imu: found '%s', expected source, iio:NAME or lcm:CHANNEL",
                            given.sensor.c_str());
    if (sources.size() != 1)
        return fv_say_wrong("fovea-calibrate rig: found --source %zu times with --imu, expected "
                            "one source with all cameras",
                            sources.size());
    const double seconds = seconds_of(given);
    if (!(seconds >= SECONDS_MIN && seconds <= SECONDS_MAX))
        return fv_say_wrong("--seconds: found '%s', expected a number from %.0f to %.0f",
                            given.seconds.c_str(), SECONDS_MIN, SECONDS_MAX);
    if (given.sensor != OWN && given.file.empty())
        return fv_say_wrong("--imu: found '%s' without --imu-file, expected the file of its noise "
                            "densities ('fovea-calibrate imu' writes one)",
                            given.sensor.c_str());
    if (!given.lcm_url.empty() && fv_transport_url_check(given.lcm_url.c_str(), &error) != FOVEA_OK)
        return fv_say_wrong("%s", error.text);
    return FV_EXIT_OK;
}

int collect_inertial(const InertialGiven &given, const std::string &source, const Board &board,
                     int views_max, Moving &moving, std::vector<Collection> &collections,
                     Inertial &inertial)
{
    fovea_error why;
    fovea_rig_imu &imu = inertial.imu;
    if (!given.file.empty() && fv_euroc_imu_sensor(given.file.c_str(), &imu, &why) != FOVEA_OK)
        return fv_say_wrong("%s", why.text);
    const LiveImuSetup setup = setup_of(given, imu);
    if (collect_moving(source, setup, board, seconds_of(given), moving, &why) != FOVEA_OK)
        return fv_say_wrong("%s", why.text);
    if (given.file.empty()) imu = moving.rig.imu;
    if (!(imu.gyro_noise > 0 && imu.acceleration_noise > 0)) return no_densities(source);
    if (!setup.sensor.empty()) {
        imu.gyro_range = moving.imu_range[0];
        imu.acceleration_range = moving.imu_range[1];
    } else if (!given.file.empty()) {
        imu.gyro_range = moving.rig.imu.gyro_range;
        imu.acceleration_range = moving.rig.imu.acceleration_range;
    }
    inertial.sensor = setup.sensor.empty() ? source : setup.sensor;
    collections = still_views(moving, views_max);
    return FV_EXIT_OK;
}

void place_inertial(const Moving &moving, RigReport &report)
{
    Inertial &inertial = *report.inertial;
    InertialInput input;
    std::string error;
    input.board = report.board;
    input.samples = corrected_samples(moving.samples, inertial.imu);
    input.imu = inertial.imu;
    for (size_t k = 0; k < report.solution.cameras.size(); k++) {
        const RigCamera &found = report.solution.cameras[k];
        const fovea_rig_camera &stated = moving.rig.cameras[k];
        InertialCamera camera;
        camera.camera = found.camera;
        camera.T_cam_first = rigid_of(found.T_cam_first);
        camera.views = moving.cameras[k].views;
        if (stated.has_readout) camera.readout_s = 1e-9 * (double)stated.readout_ns;
        if (fovea_camera_prepare(&camera.camera, nullptr) != FOVEA_OK) return;
        input.cameras.push_back(camera);
    }
    if (input.cameras.empty()) return; /* the verdict says why */
    inertial.solved = solve_inertial(input, inertial.solution, error);
    if (!inertial.solved) {
        add_reason(report.verdict, Grade::fail, "imu: %s", error.c_str());
        return;
    }
    for (const Reason &reason : judge_inertial(inertial.solution).reasons)
        add_reason(report.verdict, reason.grade, "imu: %s", reason.text.c_str());
}

} // namespace calibrate
