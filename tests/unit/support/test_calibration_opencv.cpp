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

int main()
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_opencv_reads_and_writes)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
