/* Camera models: against OpenCV's projections, against themselves there and back, and against
 * numeric derivatives. */
#include <opencv2/calib3d.hpp>

#include "common/cmocka_cpp.h"

#include <math.h>
#include <string.h>

#include "fovea/camera.h"
#include "base/elementary.h"

static fovea_camera camera_of(fovea_lens lens, int width, int height, double fx, double fy,
                              double cx, double cy, const double *k, int count)
{
    fovea_camera camera;
    memset(&camera, 0, sizeof camera);
    camera.width = width;
    camera.height = height;
    camera.lens = lens;
    camera.fx = fx;
    camera.fy = fy;
    camera.cx = cx;
    camera.cy = cy;
    memcpy(camera.k, k, (size_t)count * sizeof *k);
    fovea_error error;
    if (fovea_camera_prepare(&camera, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return camera;
}

static const double none[8] = {0};
static const double drone[] = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05};
static const double rational[] = {0.3, -0.02, 0.001, -0.0007, 0.001, 0.6, 0.05, 0.002};
static const double barrel[] = {-0.0167, 0.0129, 0.0004, 0.0002, -0.004};
static const double fisheye[] = {0.02474, -0.02245, 0.0188, -0.00682};

static int cameras(fovea_camera out[6])
{
    int n = 0;
    out[n++] =
        camera_of(FOVEA_LENS_RADTAN, 1241, 376, 718.856, 718.856, 607.1928, 185.2157, none, 8);
    out[n++] = camera_of(FOVEA_LENS_RADTAN, 752, 480, 458.654, 457.296, 367.215, 248.375, drone, 4);
    out[n++] = camera_of(FOVEA_LENS_RADTAN, 1280, 720, 1020, 1015, 640, 360, rational, 8);
    out[n++] = camera_of(FOVEA_LENS_RADTAN, 640, 480, 500, 502, 330, 236, barrel, 5);
    out[n++] =
        camera_of(FOVEA_LENS_EQUIDISTANT, 960, 600, 227.37, 226.55, 471.42, 305.64, fisheye, 4);
    out[n++] = camera_of(FOVEA_LENS_EQUIDISTANT, 1024, 1024, 300, 300, 511.5, 511.5, none, 4);
    return n;
}

static void projection_equals_opencv(void **)
{
    fovea_camera all[6];
    int count = cameras(all);
    fv_random random;
    fv_random_seed(&random, 11);
    for (int c = 0; c < count; c++) {
        const fovea_camera &camera = all[c];
        cv::Mat K =
            (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
        for (int i = 0; i < 500; i++) {
            double z = 0.5 + 5 * fv_random_unit(&random),
                   half = camera.lens == FOVEA_LENS_RADTAN ? 0.6 : 2.5;
            double point[3] = {z * half * (2 * fv_random_unit(&random) - 1),
                               z * half * (2 * fv_random_unit(&random) - 1), z};
            double pixel[2];
            if (fovea_camera_project(&camera, point, pixel, NULL) != FOVEA_OK) continue;
            std::vector<cv::Point3d> in{{point[0], point[1], point[2]}};
            std::vector<cv::Point2d> out;
            cv::Mat zero = cv::Mat::zeros(3, 1, CV_64F);
            if (camera.lens == FOVEA_LENS_RADTAN)
                cv::projectPoints(in, zero, zero, K, cv::Mat(1, 8, CV_64F, (void *)camera.k), out);
            else
                cv::fisheye::projectPoints(in, out, zero, zero, K,
                                           cv::Mat(1, 4, CV_64F, (void *)camera.k));
            assert_true(fabs(pixel[0] - out[0].x) < 1e-9 && fabs(pixel[1] - out[0].y) < 1e-9);
        }
    }
}

/* Every pixel that unprojects projects back onto itself; every point within the field comes back as
 * its bearing. */
static void there_and_back(void **)
{
    fovea_camera all[6];
    int count = cameras(all);
    for (int c = 0; c < count; c++) {
        const fovea_camera &camera = all[c];
        int seen = 0, refused = 0;
        for (int y = 0; y < camera.height; y += 7)
            for (int x = 0; x < camera.width; x += 7) {
                double pixel[2] = {(double)x, (double)y}, bearing[3], back[2];
                if (fovea_camera_unproject(&camera, pixel, bearing, NULL) != FOVEA_OK) {
                    refused++;
                    continue;
                }
                seen++;
                double norm =
                    bearing[0] * bearing[0] + bearing[1] * bearing[1] + bearing[2] * bearing[2];
                assert_true(fabs(norm - 1) < 1e-14);
                assert_int_equal(fovea_camera_project(&camera, bearing, back, NULL), FOVEA_OK);
                if (!(fabs(back[0] - x) < 1e-9 && fabs(back[1] - y) < 1e-9))
                    fail_msg("camera %d pixel %d %d comes back as %.9f %.9f", c, x, y, back[0],
                             back[1]);
            }
        /* The lenses whose polynomial holds over their whole image refuse nothing. */
        if (camera.lens == FOVEA_LENS_RADTAN) assert_int_equal(refused, 0);
        assert_true(seen > 1000);
        for (int i = 0; i < 400; i++) {
            double angle = camera.field_max_rad * 0.98 * i / 400, azimuth = 0.7 * i, bearing[3],
                   pixel[2];
            double want[3] = {sin(angle) * cos(azimuth), sin(angle) * sin(azimuth), cos(angle)};
            assert_int_equal(fovea_camera_project(&camera, want, pixel, NULL), FOVEA_OK);
            assert_int_equal(fovea_camera_unproject(&camera, pixel, bearing, NULL), FOVEA_OK);
            for (int k = 0; k < 3; k++)
                if (!(fabs(bearing[k] - want[k]) < 1e-9))
                    fail_msg("camera %d angle %g: bearing %g off", c, angle, bearing[k] - want[k]);
        }
    }
}

static void derivatives_match_differences(void **)
{
    fovea_camera all[6];
    int count = cameras(all);
    for (int c = 0; c < count; c++) {
        const fovea_camera &camera = all[c];
        for (int i = 0; i < 200; i++) {
            double pixel[2] = {camera.width * (0.02 + 0.96 * (i % 20) / 20),
                               camera.height * (0.02 + 0.096 * (i / 20))};
            double bearing[3], J[6], step = 1e-3;
            if (i == 0) /* the axis itself */
                pixel[0] = camera.cx, pixel[1] = camera.cy;
            if (fovea_camera_unproject(&camera, pixel, bearing, J) != FOVEA_OK) continue;
            for (int k = 0; k < 2; k++) {
                double above[2] = {pixel[0], pixel[1]}, below[2] = {pixel[0], pixel[1]}, a[3], b[3];
                above[k] += step;
                below[k] -= step;
                if (fovea_camera_unproject(&camera, above, a, NULL) ||
                    fovea_camera_unproject(&camera, below, b, NULL))
                    continue;
                for (int row = 0; row < 3; row++)
                    assert_true(fabs((a[row] - b[row]) / (2 * step) - J[2 * row + k]) < 2e-8);
            }
            double point[3] = {3.7 * bearing[0], 3.7 * bearing[1], 3.7 * bearing[2]}, P[6], out[2];
            assert_int_equal(fovea_camera_project(&camera, point, out, P), FOVEA_OK);
            for (int k = 0; k < 3; k++) {
                double above[3] = {point[0], point[1], point[2]},
                       below[3] = {point[0], point[1], point[2]}, a[2], b[2];
                above[k] += 1e-5;
                below[k] -= 1e-5;
                if (fovea_camera_project(&camera, above, a, NULL) ||
                    fovea_camera_project(&camera, below, b, NULL))
                    continue;
                for (int row = 0; row < 2; row++)
                    assert_true(fabs((a[row] - b[row]) / 2e-5 - P[3 * row + k]) < 1e-3);
            }
        }
    }
}

static void folded_distortion_is_refused(void **)
{
    /* r (1 - 0.3 r^2) turns back at r = sqrt(1 / 0.9). */
    const double k[] = {-0.3, 0, 0, 0};
    fovea_camera camera = camera_of(FOVEA_LENS_RADTAN, 320, 240, 200, 200, 160, 120, k, 4);
    double turn = sqrt(1 / 0.9);
    assert_true(fabs(camera.field_max_rad - atan(turn)) < 1e-9);
    double pixel[2] = {-1, -1}, beyond[3] = {turn * 1.001, 0, 1}, inside[3] = {turn * 0.999, 0, 1},
           behind[3] = {0, 0, -1};
    assert_int_equal(fovea_camera_project(&camera, beyond, pixel, NULL), FOVEA_ERROR_ARGUMENT);
    assert_true(pixel[0] == -1);
    assert_int_equal(fovea_camera_project(&camera, behind, pixel, NULL), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_camera_project(&camera, inside, pixel, NULL), FOVEA_OK);
    double bearing[3], reach = 200 * turn * (1 - 0.3 * turn * turn);
    double outside[2] = {160 + reach * 1.0001, 120}, within[2] = {160 + reach * 0.9999, 120};
    assert_int_equal(fovea_camera_unproject(&camera, outside, bearing, NULL), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_camera_unproject(&camera, within, bearing, NULL), FOVEA_OK);
    assert_true(bearing[0] / bearing[2] < turn);
}

static void wrong_parameters_are_named(void **)
{
    fovea_camera good = camera_of(FOVEA_LENS_RADTAN, 640, 480, 500, 500, 320, 240, drone, 4), bad;
    fovea_error error;
    bad = good;
    bad.fx = -1;
    assert_int_equal(fovea_camera_prepare(&bad, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "fx"));
    bad = good;
    bad.cx = 1e6;
    assert_int_equal(fovea_camera_prepare(&bad, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "cx"));
    bad = good;
    bad.k[1] = NAN;
    assert_int_equal(fovea_camera_prepare(&bad, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "coefficient 2"));
    bad = good;
    bad.k[0] = -1e6;
    assert_int_equal(fovea_camera_prepare(&bad, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "folds"));
    bad = good;
    bad.k[0] = -5; /* folds in the middle of the image */
    bad.k[1] = bad.k[2] = bad.k[3] = 0;
    assert_int_equal(fovea_camera_prepare(&bad, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "% of the image"));
    bad.width = bad.height = 150; /* what a lens shows of its middle is no matter */
    bad.cx = bad.cy = 75;
    assert_int_equal(fovea_camera_prepare(&bad, &error), FOVEA_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(projection_equals_opencv),
        cmocka_unit_test(there_and_back),
        cmocka_unit_test(derivatives_match_differences),
        cmocka_unit_test(folded_distortion_is_refused),
        cmocka_unit_test(wrong_parameters_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
