/* Calibration files that are wrong: each is named in one line. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "common/calibration_case.h"

#define MATRIX "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
#define SIZE "image_width: 640\nimage_height: 480\n"
#define COEFFICIENTS "distortion_coefficients: {rows: 1, cols: 4, data: [0, 0, 0, 0]}\n"
#define CHAIN(model, intrinsics, rest)                                                             \
    "cam0:\n  camera_model: " model "\n  intrinsics: " intrinsics                                  \
    "\n  resolution: [640, 480]\n" rest

static void test_refused(void **state)
{
    (void)state;
    const enum fovea_status input = FOVEA_ERROR_INPUT, unsupported = FOVEA_ERROR_UNSUPPORTED;
    refused(
        input, "",
        "c.yaml:1: found no keys, expected a camera calibration (camera_matrix, K, intrinsics or cam0)");
    refused(
        input, "hello\n",
        "c.yaml:1: found no keys, expected a camera calibration (camera_matrix, K, intrinsics or cam0)");
    refused(
        input, "a: 1\n",
        "c.yaml:1: found the key 'a' first, expected one of camera_matrix, K, intrinsics, cam0 in the file");
    refused(input, "x: 1\ncamera_matrx: 1\n",
            "c.yaml:2: the file: found the key 'camera_matrx', expected 'camera_matrix'");
    refused(input, SIZE MATRIX,
            "c.yaml:1: the file: found no key 'distortion_coefficients', expected it");
    refused(
        input, SIZE MATRIX "distortion_coeficients: []\n",
        "c.yaml:4: the file: found the key 'distortion_coeficients', expected 'distortion_coefficients'");
    refused(input, "image_width: 640\n" MATRIX COEFFICIENTS,
            "c.yaml:1: the file: found no key 'image_height', expected it");
    refused(input, "image_width: -1\nimage_height: 480\n" MATRIX COEFFICIENTS,
            "c.yaml:1: image_width: found '-1', expected a whole number in [1, 65535]");
    refused(input, SIZE "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320]}\n" COEFFICIENTS,
            "c.yaml:3: camera_matrix.data: found a list of 3, expected a list of 9 numbers");
    refused(
        input,
        SIZE
        "camera_matrix: {rows: 3, cols: 4, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n" COEFFICIENTS,
        "c.yaml:3: camera_matrix.data: found a list of 9, expected a list of rows x cols = 12 numbers");
    refused(
        input, SIZE "camera_matrix: {data: [500, 0, 320, 0, -500, 240, 0, 0, 1]}\n" COEFFICIENTS,
        "c.yaml:3: camera_matrix.data[4]: found '-500', expected a focal length in [0.001, 1e6] pixels");
    refused(input,
            SIZE "camera_matrix: {data: [500, 0, 320, 0, .nan, 240, 0, 0, 1]}\n" COEFFICIENTS,
            "c.yaml:3: camera_matrix.data[4]: found '.nan', expected a finite number");
    refused(
        unsupported,
        SIZE "camera_matrix: {data: [500, 2, 320, 0, 500, 240, 0, 0, 1]}\n" COEFFICIENTS,
        "c.yaml:3: camera_matrix.data[1]: found '2', expected 0 (a camera with skew is not supported)");
    refused(
        input, SIZE MATRIX "distortion_coefficients: {data: [0, 0, 0]}\n",
        "c.yaml:4: distortion_coefficients.data: found a list of 3, expected a list of 4, 5, 8, 12 or 14 numbers");
    refused(
        unsupported,
        SIZE MATRIX "distortion_coefficients: {data: [0, 0, 0, 0, 0, 0, 0, 0, 0.5, 0, 0, 0]}\n",
        "c.yaml:4: distortion_coefficients.data[8]: found '0.5', expected 0 (this term is not in the lens model)");
    refused(
        unsupported, SIZE MATRIX COEFFICIENTS "distortion_model: fov\n",
        "c.yaml:5: distortion_model: found 'fov', expected one of plumb_bob, rational_polynomial, radtan, radial-tangential, equidistant, equi, fisheye, none");
    refused(unsupported, SIZE MATRIX COEFFICIENTS "binning_x: 2\n",
            "c.yaml:5: binning_x: found '2', expected 0 or 1 (calibrate the images as they come)");
    refused(unsupported, CHAIN("omni", "[1, 2, 3, 4]", ""),
            "c.yaml:2: cam0.camera_model: found 'omni', expected pinhole");
    refused(input, CHAIN("pinhole", "[1, 2, 3]", ""),
            "c.yaml:3: cam0.intrinsics: found a list of 3, expected a list of 4 numbers");
    refused(input, CHAIN("pinhole", "[1, 2, 3, 4]", ""),
            "c.yaml:1: cam0: found no key 'distortion_model', expected it");
    refused(input, CHAIN("pinhole", "[1, 2, 3, 4]", "  distortion_model: radtan\n"),
            "c.yaml:1: cam0: found no key 'distortion_coeffs', expected it");
    refused(
        input,
        CHAIN("pinhole", "[100, 100, 320, 240]",
              "  distortion_model: none\n  T_cam_imu: [[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]\n"),
        "c.yaml:6: cam0.T_cam_imu: found a list of 4, expected a rigid transform: rows of a rotation and a translation, then 0 0 0 1");
    refused(input, "Camera1.fx: 5\n",
            "c.yaml:1: the file: found no key 'Camera.type', expected it");
    refused(input, "Camera.type: Fisheye\nCamera1.fx: 5\n",
            "c.yaml:1: Camera.type: found 'Fisheye', expected one of PinHole, KannalaBrandt8, "
            "Rectified");
    refused(input, "Camera.type: Rectified\nCamera1.fx: -5\n",
            "c.yaml:2: Camera1.fx: found '-5', expected a number in [0.001, 1000000]");
    refused(
        unsupported,
        "Camera.type: PinHole\nCamera1.fx: 5\nCamera1.fy: 5\nCamera1.cx: 5\nCamera1.cy: 5\n"
        "Camera1.k4: 0.1\n",
        "c.yaml:6: Camera1.k4: found '0.1', expected no such key: ORB-SLAM3 has k1 k2 p1 p2 k3");
    refused(input, "{\"value0\": {}}", "c.yaml:1: value0: found no key 'intrinsics', expected it");
    refused(
        input,
        "{\"value0\": {\"intrinsics\": [{\"camera_type\": \"kb4\", \"intrinsics\": {\"fx\": 1}}]}}",
        "c.yaml:1: value0.intrinsics[0].intrinsics: found no key 'fy', expected it");
    refused(input, "{" PHOTON_MATRIX "}",
            "c.yaml:1: the file: found no key 'resolution', expected it");
    refused(input, "{" PHOTON_SIZE ", " PHOTON_MATRIX "}",
            "c.yaml:1: the file: found no key 'distCoeffs', expected it");
    refused(unsupported,
            "{" PHOTON_SIZE ", " PHOTON_MATRIX ", \"lensmodel\": \"LENSMODEL_STARCAM\"}",
            "c.yaml:1: lensmodel: found the text 'LENSMODEL_STARCAM', expected LENSMODEL_OPENCV");
    refused(input, "cam0: [1\n", "c.yaml:2: column 1: not YAML: did not find expected ',' or ']'");
}

static void test_centre_far_outside(void **state)
{
    (void)state;
    struct fv_calibration calibration;
    struct fovea_error error = {.text = ""};
    static const char text[] =
        SIZE "camera_matrix: {data: [500, 0, 9999, 0, 500, 240, 0, 0, 1]}\n" COEFFICIENTS;
    assert_int_equal(
        fv_calibration_parse("c.yaml", text, sizeof text - 1, NULL, &calibration, &error),
        FOVEA_ERROR_INPUT);
    assert_memory_equal(error.text, "c.yaml: ", 8);
    assert_non_null(strstr(error.text, "9999"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_centre_far_outside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
