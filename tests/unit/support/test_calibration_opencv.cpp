// Calibration files against OpenCV's own FileStorage: what it writes is read, what is written it
// reads, to the last bit.
#include <opencv2/core.hpp>

#include "common/cmocka_cpp.h"
#include "common/datasets.h"
#include "support/calibration.h"

static void test_opencv_reads_and_writes(void **state)
{
    (void)state;
    char folder[FV_TEST_PATH_BYTES];
    fv_test_folder(folder);
    const char *path = fv_test_path(folder, "opencv.yml");
    const cv::Mat K =
        (cv::Mat_<double>(3, 3) << 458.654321, 0, 367.2151, 0, 457.2961, 248.375, 0, 0, 1);
    const cv::Mat D =
        (cv::Mat_<double>(8, 1) << -0.283, 0.0739, 1.9e-4, 1.76e-5, 0.1 / 3, 0.01, 0.02, 0.03);
    {
        cv::FileStorage file(path, cv::FileStorage::WRITE);
        file << "calibration_time"
             << "Thu Jan  1 00:00:00 1970"
             << "nr_of_frames" << 20;
        file << "image_width" << 752 << "image_height" << 480 << "flags" << 0 << "fisheye_model"
             << 0;
        file << "camera_matrix" << K << "distortion_coefficients" << D << "avg_reprojection_error"
             << 0.25;
        file << "image_points" << cv::Mat(13, 54, CV_32FC2, cv::Scalar(1.5, 2.5));
    }
    struct fv_calibration found;
    struct fovea_error error, lost;
    if (fv_calibration_read(path, nullptr, &found, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(found.camera.width, 752);
    assert_true(found.camera.fx == K.at<double>(0, 0) && found.camera.cy == K.at<double>(1, 2));
    for (int i = 0; i < 8; i++)
        assert_true(found.camera.k[i] == D.at<double>(i));

    const char *ours = fv_test_path(folder, "ours.yml");
    assert_int_equal(fv_calibration_write(ours, FV_CALIBRATION_OPENCV, &found, &lost, &error),
                     FOVEA_OK);
    cv::Mat K_again, D_again;
    const cv::FileStorage file(ours, cv::FileStorage::READ);
    file["camera_matrix"] >> K_again;
    file["distortion_coefficients"] >> D_again;
    assert_int_equal(static_cast<int>(file["image_height"]), 480);
    assert_true(cv::norm(K_again, K, cv::NORM_INF) == 0 && cv::norm(D_again, D, cv::NORM_INF) == 0);
    fv_test_folder_remove(folder);
}

/* Files of other programs that are read by FileStorage or as JSON, the record within. */
static void test_files_of_other_programs(void **state)
{
    (void)state;
    char folder[FV_TEST_PATH_BYTES];
    fv_test_folder(folder);
    struct fv_calibration c = {};
    c.camera = {752, 480, FOVEA_LENS_RADTAN, 458.654321, 457.3, 367.2, 248.4, {-.283, .07}, 0};
    c.has_T_body_cam = true;
    for (int i = 0; i < 3; i++)
        c.T_body_cam[5 * i] = 1;
    c.T_body_cam[3] = .25;
    c.rate_hz = 20;
    snprintf(c.record.program, sizeof c.record.program, "fovea-calibrate");
    snprintf(c.record.camera_id, sizeof c.record.camera_id, "v4l2:/dev/\"x\"\\");
    c.record.rms_px = .21;
    c.record.stdev[0] = .5;
    fovea_error error;
    const char *path = fv_test_path(folder, "orb.yaml");
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_ORBSLAM3, &c, nullptr, &error),
                     FOVEA_OK);
    cv::FileStorage file(path, cv::FileStorage::READ);
    cv::Mat T;
    file["IMU.T_b_c1"] >> T;
    assert_true(T.type() == CV_32F && T.at<float>(0, 3) == .25F);
    assert_true(file["Camera1.fx"].isReal() && file["Camera.fps"].isInt());
    assert_true(static_cast<double>(file["Camera1.fx"]) == c.camera.fx);
    assert_true(static_cast<double>(file["calibration"]["stdev"]["fx"]) == .5);
    assert_string_equal(static_cast<std::string>(file["calibration"]["camera_id"]).c_str(),
                        c.record.camera_id);
    path = fv_test_path(folder, "basalt.json");
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_BASALT, &c, nullptr, &error),
                     FOVEA_OK);
    file.open(path, cv::FileStorage::READ);
    const cv::FileNode camera = file["value0"]["intrinsics"][0]["intrinsics"];
    assert_true(static_cast<double>(camera["fx"]) == c.camera.fx);
    assert_true(static_cast<double>(camera["rpmax"]) > .8);
    assert_true(static_cast<double>(file["value0"]["T_imu_cam"][0]["px"]) == .25);
    assert_true(static_cast<double>(file["calibration"]["rms_px"]) == .21);
    path = fv_test_path(folder, "photon.json");
    assert_int_equal(fv_calibration_write(path, FV_CALIBRATION_PHOTONVISION, &c, nullptr, &error),
                     FOVEA_OK);
    file.open(path, cv::FileStorage::READ);
    assert_true(static_cast<double>(file["cameraIntrinsics"]["data"][0]) == c.camera.fx);
    assert_int_equal(static_cast<int>(file["distCoeffs"]["cols"]), 5);
    file.release();
    fv_test_folder_remove(folder);
}

int main()
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_opencv_reads_and_writes),
                                       cmocka_unit_test(test_files_of_other_programs)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
