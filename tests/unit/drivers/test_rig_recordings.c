/* Data sets with more than one camera and an inertial sensor: what plays, what is absent, what is
 * refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../../../drivers/recorded/player.h"
#include "../../../drivers/sequence.h"
#include "../../../drivers/sim/sim.h"
#include "common/datasets.h"

enum { W = FV_TEST_WIDTH, H = FV_TEST_HEIGHT, IMU_PER_FRAME = 10 };

static char *const folder = fv_test_place;
static const long long first_ns = 1403638538577829376LL;
/* Of the generated type. */
int64_t __fovea_imu_t_get_hash(void);

static const struct fovea_source_selection everything = {.step = 1};

/* Of the second camera frame 1 is not listed, and the file of frame 2 is not there. */
static void write_second_camera(const char *top)
{
    char list[4096];
    size_t used = 0;
    fv_test_make_folder(fv_test_path(top, "mav0/cam1"));
    assert_int_equal(symlink("../cam0/data", fv_test_path(top, "mav0/cam1/data")), 0);
    for (int i = 0; i < FV_TEST_FRAMES; i++) {
        const long long stamp_ns = first_ns + i * 50000000LL;
        if (i == 1) continue;
        used += (size_t)snprintf(list + used, sizeof list - used, "%lld,%lld%s.png\n", stamp_ns,
                                 stamp_ns, i == 2 ? "-gone" : "");
    }
    fv_test_write_text(fv_test_path(top, "mav0/cam1/data.csv"), list);
    fv_test_write_text(
        fv_test_path(top, "mav0/cam1/sensor.yaml"),
        "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
        "  data: [0, 0, 1, 0.5,  -1, 0, 0, -0.11,  0, -1, 0, 0,  0, 0, 0, 1]\n"
        "rate_hz: 20\nresolution: [96, 64]\ncamera_model: pinhole\nintrinsics: [82, 83, 47.5, 31.5]\n"
        "distortion_model: radial-tangential\ndistortion_coefficients: [-0.2, 0.05, 0.001, -0.001]\n");
}

static void write_imu_sensor(const char *top, const char *T_body_imu)
{
    char text[512];
    snprintf(text, sizeof text,
             "T_BS:\n  data: [%s]\n"
             "rate_hz: 200\ngyroscope_noise_density: 1e-4\ngyroscope_random_walk: 2e-5\n"
             "accelerometer_noise_density: 2e-3\naccelerometer_random_walk: 3e-3\n",
             T_body_imu);
    fv_test_write_text(fv_test_path(top, "mav0/imu0/sensor.yaml"), text);
}

/* Sample k is 5 ms after sample k - 1 and has the rate k / 7; `odd` replaces a line, from 1. */
static void write_imu(const char *top, int line, const char *odd)
{
    char *text = malloc(1 << 16);
    size_t used = 0;
    assert_non_null(text);
    fv_test_make_folder(fv_test_path(top, "mav0/imu0"));
    for (int k = 0; k < FV_TEST_FRAMES * IMU_PER_FRAME; k++) {
        if (k + 1 == line)
            used += (size_t)snprintf(text + used, (1 << 16) - used, "%s\n", odd);
        else
            used += (size_t)snprintf(text + used, (1 << 16) - used, "%lld,%.17g,0,-1,9.5,0,%d\n",
                                     first_ns + k * 5000000LL, k / 7.0, k);
    }
    fv_test_write_text(fv_test_path(top, "mav0/imu0/data.csv"), text);
    free(text);
    write_imu_sensor(top, "1, 0, 0, 0.25,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1");
}

static const char *make_euroc(char uri[FV_TEST_PATH_BYTES])
{
    static char top[FV_TEST_PATH_BYTES];
    snprintf(top, sizeof top, "%s", fv_test_euroc(folder));
    write_second_camera(top);
    write_imu(top, 0, "");
    snprintf(uri, FV_TEST_PATH_BYTES, "%.200s?cameras=2&imu=1", top);
    return top;
}

static void check_rig(const struct fovea_source_info *info)
{
    const struct fovea_rig *rig = &info->rig;
    assert_int_equal(rig->camera_count, 2);
    assert_true(rig->cameras[0].calibrated && rig->cameras[0].camera.fx == 80);
    assert_true(rig->cameras[1].calibrated && rig->cameras[1].camera.fx == 82);
    assert_true(rig->cameras[0].has_T_body_cam && rig->cameras[0].T_body_cam[7] == 0);
    assert_true(rig->cameras[1].has_T_body_cam && rig->cameras[1].T_body_cam[7] == -0.11);
    assert_true(rig->has_imu && rig->imu.rate_hz == 200 && rig->imu.T_body_imu[3] == 0.25);
    assert_true(rig->imu.gyro_noise == 1e-4 && rig->imu.gyro_walk == 2e-5 &&
                rig->imu.acceleration_noise == 2e-3 && rig->imu.acceleration_walk == 3e-3);
}

/* Every image and every sample comes, at its place; what is absent is empty, and a file that was
 * listed and is missing is named. */
static void test_euroc_rig(void **state)
{
    char uri[FV_TEST_PATH_BYTES];
    const struct fovea_source_ops *ops = &fv_source_euroc;
    struct fovea_source *source;
    struct fovea_sample samples[64];
    struct fovea_frame frame;
    struct fovea_error error;
    int k = 0;
    (void)state;
    const char *top = make_euroc(uri);
    if (ops->open(uri, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    check_rig(ops->info(source));
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (int n = 0; n < FV_TEST_FRAMES; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.image_count, 2);
        assert_int_equal(frame.images[1].data == NULL, n == 1 || n == 2);
        for (int y = 0; y < H && n != 1 && n != 2; y++)
            assert_memory_equal(frame.images[0].data + y * frame.images[0].stride_bytes,
                                frame.images[1].data + y * frame.images[1].stride_bytes, W);
        const uint32_t count = ops->samples(source, &frame, samples, 64);
        assert_int_equal(count, n == 0 ? 1 : IMU_PER_FRAME);
        for (uint32_t i = 0; i < count; i++, k++) {
            assert_int_equal(samples[i].kind, FOVEA_SAMPLE_IMU);
            assert_true(samples[i].imu.stamp_ns == first_ns + k * 5000000LL);
            assert_true(samples[i].imu.gyro[0] == k / 7.0 && samples[i].imu.gyro[2] == -1);
            assert_true(samples[i].imu.acceleration[0] == 9.5 &&
                        samples[i].imu.acceleration[2] == k);
        }
        ops->requeue(source, &frame);
    }
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END);
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "mav0/cam1/data/1403638538677829376-gone.png"));
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    ops->close(source);

    /* Without options it is the data set of one camera. */
    assert_int_equal(ops->open(top, &everything, &source, &error), FOVEA_OK);
    assert_true(ops->info(source)->rig.camera_count == 1 && !ops->info(source)->rig.has_imu);
    ops->close(source);
    fv_test_folder_remove(top);
}

/* One stamp that leaps ahead costs its own frame the second image, wherever it stands. */
static void test_leaping_stamps(void **state)
{
    const struct fovea_source_ops *ops = &fv_source_euroc;
    char uri[FV_TEST_PATH_BYTES], list[4096];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    (void)state;
    const char *top = make_euroc(uri);
    for (int of_first = 0; of_first < 2; of_first++) {
        size_t used = 0;
        for (int i = 0; i < FV_TEST_FRAMES; i++) {
            const long long stamp_ns = first_ns + i * 50000000LL;
            used += (size_t)snprintf(list + used, sizeof list - used, "%lld,%lld.png\n",
                                     i == 3 ? stamp_ns * 2 : stamp_ns, stamp_ns);
        }
        fv_test_write_text(
            fv_test_path(top, of_first ? "mav0/cam0/data.csv" : "mav0/cam1/data.csv"), list);
        if (ops->open(uri, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
        assert_int_equal(ops->start(source, &error), FOVEA_OK);
        for (int n = 0; n < FV_TEST_FRAMES; n++) {
            if (of_first && n == 3) continue; /* skipped as damaged */
            assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
            assert_true(frame.stamp_ns == first_ns + n * 50000000LL);
            assert_int_equal(frame.images[1].data == NULL, n == 3);
            ops->requeue(source, &frame);
        }
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END);
        ops->close(source);
    }
    fv_test_folder_remove(top);
}

/* After a jump to frame 5 only the samples of the period before it come, not all since the start.
 */
static void test_samples_after_a_start(void **state)
{
    const struct fovea_source_selection later = {.start = 5, .step = 2};
    char uri[FV_TEST_PATH_BYTES];
    struct fovea_source *source;
    struct fovea_sample samples[64];
    struct fovea_frame frame;
    struct fovea_error error;
    (void)state;
    const char *top = make_euroc(uri);
    assert_int_equal(fv_source_euroc.open(uri, &later, &source, &error), FOVEA_OK);
    assert_int_equal(fv_source_euroc.start(source, &error), FOVEA_OK);
    for (int n = 5; n < 9; n += 2) {
        assert_int_equal(fv_source_euroc.dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(fv_source_euroc.samples(source, &frame, samples, 64),
                         2 * IMU_PER_FRAME); /* a period of this run is two frames */
        assert_true(samples[2 * IMU_PER_FRAME - 1].imu.stamp_ns == frame.stamp_ns);
        fv_source_euroc.requeue(source, &frame);
    }
    fv_source_euroc.close(source);
    fv_test_folder_remove(top);
}

/* 40 samples per frame: six frames hold as many as a step takes, seven do not. */
static void test_samples_that_fit_a_frame(void **state)
{
    enum { SAMPLES = FV_TEST_FRAMES * 40 };
    const struct fovea_source_selection sixth = {.step = 6}, seventh = {.step = 7};
    char uri[FV_TEST_PATH_BYTES], *text = malloc(SAMPLES * 64);
    struct fovea_source *source;
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_frame frame;
    struct fovea_error error;
    size_t used = 0;
    (void)state;
    assert_non_null(text);
    const char *top = make_euroc(uri);
    for (int k = 0; k < SAMPLES; k++)
        used += (size_t)snprintf(text + used, SAMPLES * 64 - used, "%lld,0,0,0,0,0,0\n",
                                 first_ns + k * 1250000LL);
    fv_test_write_text(fv_test_path(top, "mav0/imu0/data.csv"), text);
    free(text);
    assert_int_equal(fv_source_euroc.open(uri, &seventh, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(
        error.text,
        "found 800 samples per second beside 2.85714 frames, expected at most 256 with each frame"));
    assert_int_equal(fv_source_euroc.open(uri, &sixth, &source, &error), FOVEA_OK);
    assert_int_equal(fv_source_euroc.start(source, &error), FOVEA_OK);
    for (int n = 0; n < 2; n++) {
        assert_int_equal(fv_source_euroc.dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(fv_source_euroc.samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX),
                         n == 0 ? 1 : 240);
        fv_source_euroc.requeue(source, &frame);
    }
    fv_source_euroc.close(source);
    fv_test_folder_remove(top);
}

static void expect_refused(const struct fovea_source_ops *ops, const char *uri, const char *line)
{
    struct fovea_source *source;
    struct fovea_error error;
    assert_true(ops->open(uri, &everything, &source, &error) < 0);
    if (strstr(error.text, line) == NULL || strchr(error.text, '\n') != NULL)
        fail_msg("%s", error.text);
}

/* One line with file and line. */
static void test_damaged_imu(void **state)
{
    static const char *const transforms[] = {
        "0, 0, 0, 0,  0, 0, 0, 0,  0, 0, 0, 0,  0, 0, 0, 0",  /* none */
        "2, 0, 0, 0,  0, 2, 0, 0,  0, 0, 2, 0,  0, 0, 0, 1",  /* scaled */
        "1, 0, 0, 0,  0, 1, 0, 0,  0, 0, -1, 0,  0, 0, 0, 1", /* a reflection */
        "1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 2"};
    static const struct {
        int line;
        const char *odd, *said;
    } cases[] = {
        {3, "1403638538587829376,1,2,abc,4,5,6",
         "imu0/data.csv:3: angular rate and acceleration: found 'abc', expected a number"},
        {4, "1403638538592829376,1,2,3,4,5",
         "imu0/data.csv:4: angular rate and acceleration: found 5 numbers, expected 6"},
        {7, "1403638538607829376,1,2,3,4,5,6,7",
         "imu0/data.csv:7: angular rate and acceleration: found 7 numbers, expected 6"},
        {5, "x,1,2,3,4,5,6", "imu0/data.csv:5: timestamp: found 'x', expected whole nanoseconds"},
        {6, "1403638538602829376,1,2,3,4,5,nano",
         "imu0/data.csv:6: angular rate and acceleration: found 'nano', expected a number"},
    };
    char uri[FV_TEST_PATH_BYTES];
    (void)state;
    const char *top = make_euroc(uri);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        write_imu(top, cases[i].line, cases[i].odd);
        expect_refused(&fv_source_euroc, uri, cases[i].said);
    }
    write_imu(top, 0, "");
    fv_test_write_text(fv_test_path(top, "mav0/imu0/sensor.yaml"), "rate_hz: 200\n");
    expect_refused(&fv_source_euroc, uri, "imu0/sensor.yaml:1: ");
    write_imu(top, 0, "");
    fv_test_write_text(fv_test_path(top, "mav0/imu0/data.csv"), "#timestamp [ns],w,a\n");
    expect_refused(&fv_source_euroc, uri, "imu0/data.csv: found no samples, expected at least one");
    for (size_t i = 0; i < sizeof transforms / sizeof transforms[0]; i++) {
        write_imu(top, 0, "");
        write_imu_sensor(top, transforms[i]);
        expect_refused(&fv_source_euroc, uri,
                       "imu0/sensor.yaml:2: T_BS.data: found a list of 16, expected a rigid "
                       "transform: rows of a rotation");
    }
    fv_test_folder_remove(top);
}

/* The baseline comes from the second projection: P1 = K [I | t], t = (-0.5, 0, 0). */
static void test_kitti_rig(void **state)
{
    const struct fovea_source_ops *ops = &fv_source_kitti;
    char top[FV_TEST_PATH_BYTES], uri[FV_TEST_PATH_BYTES];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    (void)state;
    snprintf(top, sizeof top, "%s", fv_test_kitti(folder));
    snprintf(uri, sizeof uri, "%.200s?cameras=2", top);
    expect_refused(ops, uri, "calib.txt: found no line 'P1:', expected it");
    fv_test_write_text(fv_test_path(top, "calib.txt"), "P0: 90 0 48 0 0 90 32 0 0 0 1 0\n"
                                                       "P1: 90 0 48 -45 0 90 32 0 0 0 1 0\n");
    expect_refused(ops, uri, "image_1: found no such folder");
    assert_int_equal(symlink("image_0", fv_test_path(top, "image_1")), 0);
    if (ops->open(uri, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fovea_rig *rig = &ops->info(source)->rig;
    assert_int_equal(rig->camera_count, 2);
    assert_true(rig->cameras[0].T_body_cam[3] == 0 && rig->cameras[1].T_body_cam[3] == 0.5);
    assert_true(rig->cameras[1].calibrated && rig->cameras[1].camera.width == W);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
    assert_true(frame.image_count == 2 && frame.images[1].data != NULL);
    assert_memory_equal(frame.images[0].data, frame.images[1].data, W);
    ops->close(source);
    fv_test_folder_remove(top);
}

/* The second camera's images have a size of their own; of its calibration nothing is changed, and
 * one of no size gets that of the images. */
static void test_size_of_the_second_camera(void **state)
{
    enum { W2 = 64, H2 = 80 };
    static const struct fv_test_png form = {.width = W2, .height = H2, .channels = 1, .depth = 8};
    const struct fovea_source_ops *ops = &fv_source_euroc;
    char uri[FV_TEST_PATH_BYTES], name[64];
    uint8_t pixels[W2 * H2];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    (void)state;
    const char *top = make_euroc(uri);
    assert_int_equal(unlink(fv_test_path(top, "mav0/cam1/data")), 0);
    fv_test_make_folder(fv_test_path(top, "mav0/cam1/data"));
    for (uint32_t i = 0; i < FV_TEST_FRAMES; i++) {
        snprintf(name, sizeof name, "mav0/cam1/data/%lld.png", first_ns + i * 50000000LL);
        fv_test_picture(i, W2, H2, 1, pixels);
        fv_test_write_png(fv_test_path(top, name), &form, pixels);
    }
    fv_test_write_text(fv_test_path(top, "mav0/cam1/sensor.yaml"),
                       "sensor_type: camera\nresolution: [94, 64]\ncamera_model: pinhole\n"
                       "intrinsics: [82, 83, 47.5, 31.5]\ndistortion_model: radial-tangential\n"
                       "distortion_coefficients: [-0.2, 0.05, 0.001, -0.001]\n");
    if (ops->open(uri, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fovea_source_info *info = ops->info(source);
    assert_true(info->cameras[0].width == W && info->cameras[0].height == H);
    assert_true(info->cameras[1].width == W2 && info->cameras[1].height == H2);
    assert_true(info->rig.cameras[1].camera.width == 94 && info->rig.cameras[1].camera.fx == 82);
    assert_non_null(strstr(info->cameras[0].origin, "mav0/cam0/sensor.yaml"));
    assert_non_null(strstr(info->cameras[1].origin, "mav0/cam1/sensor.yaml"));
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (uint32_t n = 0; n < FV_TEST_FRAMES; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.images[0].width, W);
        fv_test_picture(n, W2, H2, 1, pixels);
        for (int y = 0; y < H2 && n != 1 && n != 2; y++)
            assert_memory_equal(frame.images[1].data + y * frame.images[1].stride_bytes,
                                pixels + y * W2, W2);
        ops->requeue(source, &frame);
    }
    ops->close(source);
    fv_test_folder_remove(top);
}

/* Two cameras of which no frames belong together are not one camera. */
static void test_no_common_stamp(void **state)
{
    char uri[FV_TEST_PATH_BYTES];
    (void)state;
    const char *top = make_euroc(uri);
    fv_test_write_text(fv_test_path(top, "mav0/cam1/data.csv"), "5,5.png\n6,6.png\n");
    expect_refused(
        &fv_source_euroc, uri,
        "mav0/cam1/data: found none of the first camera's 12 stamps among 2, expected equal stamps");
    fv_test_write_text(fv_test_path(top, "mav0/cam1/data.csv"), "#none\n");
    expect_refused(&fv_source_euroc, uri, "12 stamps among 0, expected equal stamps");
    fv_test_folder_remove(top);
}

static size_t put_big_endian(uint8_t *bytes, uint64_t number, size_t count)
{
    for (size_t i = count; i-- > 0; number >>= 8)
        bytes[i] = (uint8_t)number;
    return count;
}

/* An event with sample k at 5 ms * k after the first frame; damaged: of another type. */
static size_t put_sample(uint8_t *bytes, int k, bool damaged)
{
    static const char channel[] = "FOVEA_IMU";
    enum { DATA_BYTES = 34 + 6 * 8 };
    const uint64_t hash = (uint64_t)__fovea_imu_t_get_hash();
    size_t at = put_big_endian(bytes, 0xEDA1DA01, 4);
    at += put_big_endian(bytes + at, 0, 8 + 8);
    at += put_big_endian(bytes + at, sizeof channel - 1, 4);
    at += put_big_endian(bytes + at, DATA_BYTES, 4);
    memcpy(bytes + at, channel, sizeof channel - 1);
    at += sizeof channel - 1;
    memset(bytes + at, 0, DATA_BYTES);
    put_big_endian(bytes + at, damaged ? ~hash : hash, 8);
    put_big_endian(bytes + at + 8, 1000 + (uint64_t)k * 5000000, 8);
    return at + DATA_BYTES;
}

/* A sample that cannot be read is skipped, counted and named; all others come, and all frames. */
static void test_log_with_a_damaged_sample(void **state)
{
    const struct fovea_source_ops *ops = &fv_source_lcmlog;
    struct fovea_source *source;
    struct fovea_source_counts counts;
    struct fovea_sample samples[64];
    struct fovea_frame frame;
    struct fovea_error error;
    size_t whole_bytes, used = 0;
    int sample_count = 0;
    (void)state;
    const char *path = fv_test_lcmlog(folder);
    uint8_t *whole = fv_test_read(path, &whole_bytes);
    uint8_t *bytes = malloc(whole_bytes + (size_t)FV_TEST_FRAMES * IMU_PER_FRAME * 128);
    assert_non_null(bytes);
    for (size_t i = 0, event = whole_bytes / FV_TEST_FRAMES; i < FV_TEST_FRAMES; i++) {
        memcpy(bytes + used, whole + i * event, event);
        used += event;
        for (int k = 0; k < IMU_PER_FRAME; k++)
            used += put_sample(bytes + used, (int)i * IMU_PER_FRAME + k, i == 4 && k == 7);
    }
    fv_test_write(path, bytes, used);
    if (ops->open(path, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (uint64_t n = 0; n < FV_TEST_FRAMES; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.sequence, n);
        sample_count += (int)ops->samples(source, &frame, samples, 64);
        ops->requeue(source, &frame);
    }
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END);
    assert_int_equal(sample_count, (FV_TEST_FRAMES - 1) * IMU_PER_FRAME + 1 - 1);
    ops->counts(source, &counts);
    assert_int_equal(counts.damaged, 1);
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(
        strstr(error.text, "found another type or length, expected one of fovea.imu_t"));
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    ops->close(source);
    free(whole);
    free(bytes);
}

/* What cannot be played of a rig is refused, not left out. */
static void test_rig_elsewhere(void **state)
{
    const struct fovea_source_selection reverse = {.step = 1, .reverse = true};
    char uri[FV_TEST_PATH_BYTES], sequence[FV_TEST_PATH_BYTES];
    struct fovea_source *source;
    struct fovea_error error;
    (void)state;
    const char *top = make_euroc(uri);
    assert_int_equal(fv_source_euroc.open(uri, &reverse, &source, &error), FOVEA_ERROR_UNSUPPORTED);
    assert_string_equal(
        error.text,
        "euroc: imu: found 1 in reverse, expected 0: a sensor's samples do not turn round");
    assert_int_equal(fv_source_sim.open("orbit?imu=200", &reverse, &source, &error),
                     FOVEA_ERROR_UNSUPPORTED);
    assert_string_equal(
        error.text,
        "sim: imu: found 200 Hz in reverse, expected 0: a sensor's samples do not turn round");
    assert_int_equal(
        fv_source_sim.open("orbit?width=64&height=64&wheel_odometry=20", &reverse, &source, &error),
        FOVEA_ERROR_UNSUPPORTED);
    assert_string_equal(
        error.text,
        "sim: wheel_odometry: found 20 Hz in reverse, expected 0: a sensor's samples do not turn round");
    snprintf(sequence, sizeof sequence, "euroc:%.150s then euroc:%.150s?imu=1", top, top);
    expect_refused(&fv_source_sequence, sequence,
                   "with other inertial sensors, expected those of the first part");
    snprintf(sequence, sizeof sequence, "euroc:%.150s?cameras=2 then euroc:%.150s", top, top);
    expect_refused(&fv_source_sequence, sequence,
                   "with other numbers of cameras, expected those of the first part");
    snprintf(sequence, sizeof sequence,
             "sim:orbit?width=96&height=64&baseline=0.1 then sim:orbit?width=96&height=64&"
             "baseline=0.2");
    expect_refused(&fv_source_sequence, sequence,
                   "with other places of cameras, expected those of the first part");
    snprintf(sequence, sizeof sequence, "euroc:%.150s then euroc:%.150s[reverse]", top, top);
    assert_int_equal(fv_source_sequence.open(sequence, &everything, &source, &error), FOVEA_OK);
    fv_source_sequence.close(source);
    fv_test_folder_remove(top);
}

/* Two parts of a rig, one after the other: every image of both cameras, the second part's resampled
 * where its cameras have other sizes, and the inertial samples without a gap in their stamps. */
static void test_sequence_of_rigs(void **state)
{
    static const char address[] =
        "sim:orbit?width=96&height=64&rate=20&imu=200&baseline=0.1&frames=6 then "
        "sim:orbit?width=128&height=96&rate=20&imu=200&baseline=0.1&frames=6&seed=2";
    const struct fovea_source_ops *ops = &fv_source_sequence;
    struct fovea_source *source;
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_frame frame;
    struct fovea_error error;
    int64_t last_ns = 0;
    uint32_t all = 0;
    (void)state;
    if (ops->open(address, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fovea_source_info *info = ops->info(source);
    assert_true(info->rig.camera_count == 2 && info->rig.has_imu && info->frame_count == 12);
    assert_int_equal(info->sample_kinds, 1u << FOVEA_SAMPLE_IMU);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (int n = 0; n < 12; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_true(frame.image_count == 2 && frame.stamp_ns == n * 50000000LL);
        for (int i = 0; i < 2; i++) {
            assert_true(frame.images[i].width == W && frame.images[i].height == H);
            assert_int_equal(fovea_image_check(&frame.images[i]), FOVEA_OK);
        }
        assert_true(frame.images[0].data != frame.images[1].data);
        assert_memory_not_equal(frame.images[0].data, frame.images[1].data, W * H);
        const uint32_t count = ops->samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX);
        for (uint32_t i = 0; i < count; i++, all++) {
            assert_int_equal(samples[i].kind, FOVEA_SAMPLE_IMU);
            if (n != 6) assert_true(all == 0 || samples[i].imu.stamp_ns == last_ns + 5000000);
            last_ns = samples[i].imu.stamp_ns;
        }
        assert_true(last_ns == frame.stamp_ns);
        ops->requeue(source, &frame);
    }
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_END);
    assert_int_equal(all, 2 * (1 + 5 * IMU_PER_FRAME));
    ops->close(source);

    /* After a start only the samples of the period before it come. */
    const struct fovea_source_selection later = {.start = 4, .step = 1};
    assert_int_equal(ops->open(address, &later, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
    assert_int_equal(ops->samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX), IMU_PER_FRAME);
    ops->requeue(source, &frame);
    ops->close(source);
}

static void test_wrong_options(void **state)
{
    char uri[FV_TEST_PATH_BYTES];
    (void)state;
    const char *top = make_euroc(uri);
    snprintf(uri, sizeof uri, "%.200s?cameras=3", top);
    expect_refused(&fv_source_euroc, uri,
                   "euroc: cameras: found '3', expected a whole number in [1, 2]");
    snprintf(uri, sizeof uri, "%.200s?gyro=1", top);
    expect_refused(&fv_source_euroc, uri, "gyro");
    snprintf(uri, sizeof uri, "%.200s?imu=1", top);
    expect_refused(&fv_source_kitti, uri, "imu");
    fv_test_folder_remove(top);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_euroc_rig),
        cmocka_unit_test(test_samples_after_a_start),
        cmocka_unit_test(test_damaged_imu),
        cmocka_unit_test(test_kitti_rig),
        cmocka_unit_test(test_wrong_options),
        cmocka_unit_test(test_leaping_stamps),
        cmocka_unit_test(test_no_common_stamp),
        cmocka_unit_test(test_rig_elsewhere),
        cmocka_unit_test(test_sequence_of_rigs),
        cmocka_unit_test(test_samples_that_fit_a_frame),
        cmocka_unit_test(test_size_of_the_second_camera),
        cmocka_unit_test(test_log_with_a_damaged_sample),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
