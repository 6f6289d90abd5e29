// Pictures against OpenCV, to the last grey level: PNG through cvtColor, JPEG through its own grey
// decoding.
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <unistd.h>

#include <string>

#include "common/cmocka_cpp.h"
#include "common/data_folder.h"
#include "common/datasets.h"

extern "C" {
#include "support/decode.h"
}

static void compare(const std::string &path)
{
    const bool jpeg = path.substr(path.size() - 3) == "jpg";
    cv::Mat expected = cv::imread(path, jpeg ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
    if (!jpeg) cv::cvtColor(expected, expected, cv::COLOR_BGR2GRAY);
    assert_false(expected.empty());
    fv_file_buffer file = {};
    fovea_error reason = {};
    int32_t width = 0, height = 0;
    assert_int_equal(fv_file_read(&file, path.c_str(), &reason), FOVEA_OK);
    assert_int_equal(fv_decode_probe(file.data, file.bytes, &width, &height, &reason), FOVEA_OK);
    assert_int_equal(width, expected.cols);
    assert_int_equal(height, expected.rows);
    cv::Mat found(height, width, CV_8UC1);
    const fv_decode_image image = {found.data, width, height, static_cast<int32_t>(found.step),
                                   false};
    if (fv_decode(file.data, file.bytes, &image, &reason) != FOVEA_OK) fail_msg("%s", reason.text);
    fv_file_free(&file);
    if (cv::norm(found, expected, cv::NORM_INF) != 0)
        fail_msg("%s differs from OpenCV", path.c_str());
}

static void test_own_pictures(void **state)
{
    (void)state;
    char folder[FV_TEST_PATH_BYTES];
    static uint8_t samples[200 * 150 * 4];
    fv_test_folder(folder);
    for (int kind = 0; kind < 12; kind++) {
        const char *path = fv_test_path(folder, kind < 8 ? "p.png" : "p.jpg");
        const fv_test_png form = {200, 150, 1 + kind % 4, 8, kind >= 4};
        fv_test_picture(static_cast<uint32_t>(kind), form.width, form.height,
                        kind < 8 ? form.channels : 3, samples);
        if (kind < 8)
            fv_test_write_png(path, &form, samples);
        else
            fv_test_write_jpeg(path, form.width, form.height, kind % 2 == 0 ? 1 : 3, kind >= 10,
                               false, samples);
        compare(path);
    }
    fv_test_folder_remove(folder);
}

static void test_real_pictures(void **state)
{
    (void)state;
    for (const char *name :
         {"affine/graf/img1.png", "affine/boat/img1.png", "calib_stereo_pinhole/left01.png",
          "calib_fisheye/left1.jpg", "handheld_7scenes_a/rgb/000000.jpg",
          "vamr_checkerboard/images/img_0001.jpg", "kitti00_a/image_0/000000.png"}) {
        const std::string path = std::string(fv_data_folder()) + "/" + name;
        if (access(path.c_str(), R_OK) == 0)
            compare(path);
        else
            print_message("SKIPPED %s: not there\n", name);
    }
}

int main()
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_own_pictures),
                                       cmocka_unit_test(test_real_pictures)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
