/* fovea-calibrate rig --imu as a whole: the simulated rig is found by rendered pictures. */
#include "calibrate/command.h"
#include "calibrate/inertial_command.h"
#include "calibrate/rigid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <unistd.h>

#include "support/calibration.h"
extern "C" {
#include "drivers/recorded/euroc_imu.h"
}

#include "common/calibrate_command.h"
#include "common/cmocka_cpp.h"

using namespace calibrate;

namespace
{

constexpr double DEGREE = 57.29577951308232;

int run(const std::vector<std::string> &words)
{
    return run_command(command_rig, words);
}

std::string read_text(const std::string &path)
{
    std::string text;
    FILE *file = fopen(path.c_str(), "r");
    assert_non_null(file);
    for (int c; (c = fgetc(file)) != EOF;)
        text += (char)c;
    fclose(file);
    return text;
}

void expect_in(const std::string &text, const char *words)
{
    if (text.find(words) == std::string::npos)
        fail_msg("expected '%s' in:\n%s", words, text.c_str());
}

/* Pictures that are rendered, corners that are found in them, samples as they come with them. */
void the_simulated_rig_is_found(void **)
{
    char folder[] = "/tmp/fovea-inertial-XXXXXX";
    assert_non_null(mkdtemp(folder));
    const std::string at = folder, lens = at + "/camera.yaml", out = at + "/rig.yaml",
                      sensor = at + "/imu.yaml", json = at + "/verdict.json",
                      html = at + "/report.html";
    const std::string source = "sim:board?width=320&height=240&rate=8&frames=160&lens=pinhole&imu="
                               "200&imu_pose=0.05,-0.03,0.02,10,-20,85&imu_offset=7";
    /* The lens of the simulator, which the source states (drivers/sim/rig.c). */
    FILE *file = fopen(lens.c_str(), "w");
    assert_non_null(file);
    const double focal = 160 / std::tan(40 / DEGREE);
    fprintf(file,
            "image_width: 320\nimage_height: 240\ndistortion_model: plumb_bob\n"
            "camera_matrix: {rows: 3, cols: 3, data: [%.12g, 0, 162.7, 0, %.12g, 117.8, 0, 0, 1]}\n"
            "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n",
            focal, 1.001 * focal);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(run({"rig", "--source", source, "--target", "chessboard:9x6:0.03", "--camera",
                          lens, "--imu", "source", "--views", "12", "--out", out, "--imu-out",
                          sensor, "--json", json, "--report", html}),
                     0);
    fv_calibration found;
    fovea_error error;
    assert_int_equal(fv_calibration_read(out.c_str(), nullptr, &found, &error), FOVEA_OK);
    assert_true(found.has_T_body_cam && found.has_time_shift);
    /* T_body_imu of the simulator, whose body is the camera */
    const double turn[3] = {10 / DEGREE, -20 / DEGREE, 85 / DEGREE};
    Rigid T_cam_imu;
    T_cam_imu.R = (Eigen::AngleAxisd(turn[2], Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(turn[1], Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(turn[0], Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
    T_cam_imu.t = {.05, -.03, .02};
    Rigid T_imu_cam;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            T_imu_cam.R(i, j) = found.T_body_cam[4 * i + j];
        T_imu_cam.t[i] = found.T_body_cam[4 * i + 3];
    }
    const double turned = angle_axis(T_imu_cam.R * T_cam_imu.R).norm();
    const double moved = (T_imu_cam.t - T_cam_imu.inverse().t).norm();
    /* A sample is the mean of the interval before its stamp. */
    const double late_s = found.time_shift_s - (-7e-3 + 2.5e-3);
    printf("off by %.4f degrees, %.2f mm (%.2g %.2g %.2g stated), %.4f ms (%.2g stated)\n",
           DEGREE * turned, 1e3 * moved, 1e3 * found.record.place_stdev[3],
           1e3 * found.record.place_stdev[4], 1e3 * found.record.place_stdev[5], 1e3 * late_s,
           1e3 * found.record.time_shift_stdev_s);
    assert_true(turned < .1 / DEGREE && moved < .005 && std::fabs(late_s) < 2e-4);
    for (const double stdev : found.record.place_stdev)
        assert_true(stdev > 0);
    assert_true(std::fabs(late_s) < 4 * found.record.time_shift_stdev_s);
    expect_in(read_text(sensor), "time_offset_ns: 4");
    expect_in(read_text(json), "\"T_cam0_imu\": [");
    expect_in(read_text(json), "\"time_offset_s\": {\"value\": 0.004");
    expect_in(read_text(html), "Inertial sensor");
    for (const std::string &path : {lens, out, sensor, json, html})
        unlink(path.c_str());
    assert_int_equal(rmdir(folder), 0);
}

/* What the sensor's file states is applied, and stays in the file that is written. */
void stated_corrections_are_applied_and_kept(void **)
{
    char path[] = "/tmp/fovea-inertial-XXXXXX";
    Inertial inertial;
    fovea_rig_imu read;
    fovea_error error;
    const double gyro[12] = {1 / 1.01, 0, 0, 0, 0.0125, 1 / 1.01, 0, 0, 0, 0, 1 / 1.01, 0.125};
    inertial.imu.gyro_range = 5;
    std::copy(gyro, gyro + 12, inertial.imu.gyro_correction);
    const std::vector<fovea_imu_sample> shown = {{7, {1.01, -2.02, 3.03}, {1, 2, 9.5}},
                                                 {9, {1.01, -5, 3.03}, {1, 2, 9.5}}};
    const std::vector<fovea_imu_sample> found = corrected_samples(shown, inertial.imu);
    const double expected[3] = {1, -2 + 0.0125 * 1.01, 3 + 0.125};
    for (int i = 0; i < 3; i++) {
        assert_float_equal(found[0].gyro[i], expected[i], 1e-12);
        assert_true(found[0].acceleration[i] == shown[0].acceleration[i]); /* none is stated */
        assert_true(found[1].gyro[i] == shown[1].gyro[i]); /* it is at the end of its range */
    }
    const std::string text = inertial_file(inertial, Grade::pass, "today");
    const int file = mkstemp(path);
    assert_true(file >= 0 && write(file, text.data(), text.size()) == (ssize_t)text.size());
    close(file);
    if (fv_euroc_imu_sensor(path, &read, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_memory_equal(read.gyro_correction, gyro, sizeof gyro);
    for (const double value : read.acceleration_correction)
        assert_true(value == 0);
    unlink(path);
}

void wrong_input_is_refused(void **)
{
    const std::vector<std::string> words = {"rig", "--target", "chessboard:9x6:0.03", "--source",
                                            "sim:board?frames=2"};
    const std::vector<std::vector<std::string>> wrong = {
        {"--imu", "source"}, /* this source has none */
        {"--imu", "none"},
        {"--imu", "lcm:IMU"}, /* without its densities */
        {"--imu", "iio:adis16448", "--imu-file", "/none"},
        {"--imu", "source", "--seconds", "0"},
        {"--imu", "source", "--source", "sim:board?frames=3"},
        {"--imu-file", "imu.yaml"},
    };
    for (const std::vector<std::string> &more : wrong) {
        std::vector<std::string> all = words;
        all.insert(all.end(), more.begin(), more.end());
        assert_int_equal(run(all), 2);
    }
}

} // namespace

int main()
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_simulated_rig_is_found),
        cmocka_unit_test(stated_corrections_are_applied_and_kept),
        cmocka_unit_test(wrong_input_is_refused),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
