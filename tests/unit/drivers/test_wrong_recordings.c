/* Wrong folders and files: data sets and calibrations spoilt by hand and by mutation. Each is
 * refused at open in one line that names the file and what was found, or, where single frames are
 * concerned, played with the damage counted. Never anything else, under sanitizers too. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drivers/table.h"
#include "common/datasets.h"
#include "support/calibration.h"
#include "base/elementary.h"

static char *const folder = fv_test_place;
static const struct fovea_source_selection everything = {.step = 1};
static int cases;

/* Open and, if that works, play to the end. `line` takes the error; frames that came are returned.
 */
static enum fovea_status try_source(const char *scheme, const char *address,
                                    struct fovea_error *error, size_t *frames)
{
    char uri[FV_TEST_PATH_BYTES + 16];
    const struct fovea_source_ops *ops;
    const char *found;
    struct fovea_source *source = NULL;
    struct fovea_frame frame;
    ++cases;
    *frames = 0;
    *error = (struct fovea_error){.text = ""};
    snprintf(uri, sizeof uri, "%s:%s", scheme, address);
    enum fovea_status status = fv_source_find(uri, &ops, &found, error);
    if (status == FOVEA_OK) status = ops->open(found, &everything, &source, error);
    if (status != FOVEA_OK) return status;
    assert_int_equal(ops->start(source, error), FOVEA_OK);
    while ((status = ops->dequeue(source, INT64_MAX, &frame)) == FOVEA_OK) {
        assert_int_equal(fovea_image_check(&frame.images[0]), FOVEA_OK);
        ops->requeue(source, &frame);
        ++*frames;
    }
    assert_int_equal(status, FOVEA_END);
    struct fovea_source_counts counts;
    ops->counts(source, &counts);
    assert_int_equal(counts.delivered, *frames);
    if (ops->info(source)->frame_count > 0)
        assert_int_equal(counts.delivered + counts.missing + counts.damaged,
                         ops->info(source)->frame_count);
    while (ops->complaint(source, error) == FOVEA_OK)
        assert_null(strchr(error->text, '\n'));
    ops->stop(source);
    ops->close(source);
    return FOVEA_OK;
}

/* ---- by hand --------------------------------------------------------------------------------- */

struct wrong {
    const char *scheme, *file; /* below the recording; NULL text: removed */
    const char *text;
    const char *line; /* what the error says after the folder's path */
};

#define GT "mav0/state_groundtruth_estimate0/data.csv"
#define CAM "mav0/cam0/"
static const struct wrong wrong[] = {
    {"euroc", CAM "data.csv", NULL,
     "/" CAM "data.csv: cannot be opened: No such file or directory"},
    {"euroc", CAM "data.csv", "", "/" CAM "data.csv: found no frames, expected at least one"},
    {"euroc", CAM "data.csv", "#timestamp,filename\n",
     "/" CAM "data.csv: found no frames, expected at least one"},
    {"euroc", CAM "data.csv", "1,a.png\nx,b.png\n",
     "/" CAM "data.csv:2: timestamp: found 'x', expected whole nanoseconds"},
    {"euroc", CAM "data.csv", "nan,a.png\n",
     "/" CAM "data.csv:1: timestamp: found 'nan', expected whole nanoseconds"},
    {"euroc", CAM "data.csv", "1.5,a.png\n",
     "/" CAM "data.csv:1: timestamp: found '1.5', expected whole nanoseconds"},
    {"euroc", CAM "data.csv", "99999999999999999999,a.png\n",
     "/" CAM "data.csv:1: timestamp: found '99999999999999999999', expected whole nanoseconds"},
    {"euroc", CAM "data.csv", "1403638538577829376\n",
     "/" CAM "data.csv:1: filename: found nothing, expected the file of the frame"},
    {"euroc", CAM "data.csv", "1,a.png\n",
     "/" CAM "data.csv: found no frame that can be read among 1; the first is "},
    {"euroc", CAM "sensor.yaml", "",
     "/" CAM "sensor.yaml:1: found no keys, expected a camera calibration"},
    {"euroc", CAM "sensor.yaml", "intrinsics: [1,2,3,4]\n",
     "/" CAM "sensor.yaml:1: the file: found no key 'camera_model', expected it"},
    {"euroc", CAM "sensor.yaml", "T_BS: [\n", "/" CAM "sensor.yaml:2: column 1: not YAML: "},
    {"euroc", GT, "1,2,3\n", "/" GT ":1: pose: found 2 numbers, expected 7"},
    {"euroc", GT, "1,0,0,0,1,0,0,inf\n", "/" GT ":1: pose: found 'inf', expected a finite number"},
    {"euroc", GT, "1,0,0,0,0,0,0,0\n",
     "/" GT ":1: rotation: found '0', expected a unit quaternion"},
    {"euroc", GT, "2,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0\n",
     "/" GT ":2: timestamp: found '1', expected one later than on the line before"},
    {"tum", "rgb.txt", NULL, "/rgb.txt: cannot be opened: No such file or directory"},
    {"tum", "rgb.txt", "# nothing\n\n", "/rgb.txt: found no frames, expected at least one"},
    {"tum", "rgb.txt", "0.0 rgb/0000.jpg\nrgb/0001.jpg 0.1\n",
     "/rgb.txt:2: timestamp: found 'rgb/0001.jpg', expected seconds"},
    {"tum", "rgb.txt", "1e40 rgb/0000.jpg\n",
     "/rgb.txt:1: timestamp: found '1e40', expected seconds"},
    {"tum", "rgb.txt", "0.0\n",
     "/rgb.txt:1: filename: found nothing, expected the file of the frame"},
    {"tum", "camera.yaml", "image_width: 96\n",
     "/camera.yaml:1: found the key 'image_width' first, expected one of camera_matrix, K, intrinsics, cam0 in the file"},
    {"tum", "groundtruth.txt", "0 0 0 0 0 0 0 x\n",
     "/groundtruth.txt:1: pose: found 'x', expected a finite number"},
    {"kitti", "times.txt", NULL, "/times.txt: cannot be opened: No such file or directory"},
    {"kitti", "times.txt", "", "/times.txt: found no frames, expected at least one"},
    {"kitti", "times.txt", "0.0\nsoon\n", "/times.txt:2: time: found 'soon', expected seconds"},
    {"kitti", "calib.txt", "", "/calib.txt: found no line 'P0:', expected it"},
    {"kitti", "calib.txt", "P0: 1 2 3\n", "/calib.txt:1: P0:: found 3 numbers, expected 12"},
    {"kitti", "calib.txt", "P0: 0 0 47.5 0 0 80 31.5 0 0 0 1 0\n",
     "/calib.txt:1: P0:: found '0', expected a projection fx 0 cx tx 0 fy cy ty 0 0 1 tz"},
    {"kitti", "poses.txt", "1 0 0 0 0 1 0 0 0 0 1\n",
     "/poses.txt:1: pose: found 11 numbers, expected 12"},
    {"kitti", "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 1e999\n",
     "/poses.txt:1: pose: found '1e999', expected a finite number"},
    {"images", "camera.yaml", "K: 3\n", "/camera.yaml:1: the file: found no key 'D', expected it"},
};

static void make_recording(const char *scheme, char path[FV_TEST_PATH_BYTES])
{
    snprintf(path, FV_TEST_PATH_BYTES, "%s",
             strcmp(scheme, "euroc") == 0   ? fv_test_euroc(folder)
             : strcmp(scheme, "tum") == 0   ? fv_test_tum(folder)
             : strcmp(scheme, "kitti") == 0 ? fv_test_kitti(folder)
                                            : fv_test_images(folder));
}

static void test_by_hand(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char top[FV_TEST_PATH_BYTES];
        struct fovea_error error;
        size_t frames;
        make_recording(wrong[i].scheme, top);
        const char *file = fv_test_path(top, wrong[i].file);
        if (wrong[i].text != NULL)
            fv_test_write_text(file, wrong[i].text);
        else
            remove(file);
        const enum fovea_status status = try_source(wrong[i].scheme, top, &error, &frames);
        if (status != FOVEA_ERROR_INPUT)
            fail_msg("%s with a wrong %s: status %d", wrong[i].scheme, wrong[i].file, status);
        assert_memory_equal(error.text, top, strlen(top));
        if (strncmp(error.text + strlen(top), wrong[i].line, strlen(wrong[i].line)) != 0)
            fail_msg("expected [%s], got [%s]", wrong[i].line, error.text + strlen(top));
        fv_test_folder_remove(top);
    }
}

static void test_long_lines_and_zero_bytes(void **state)
{
    (void)state;
    static char text[100000];
    char top[FV_TEST_PATH_BYTES];
    struct fovea_error error;
    size_t frames;
    make_recording("tum", top);
    memset(text, 'x', sizeof text);
    fv_test_write(fv_test_path(top, "rgb.txt"), text, sizeof text);
    assert_int_equal(try_source("tum", top, &error, &frames), FOVEA_ERROR_INPUT);
    assert_non_null(
        strstr(error.text, "rgb.txt:1: found a line of 100000 bytes, expected at most 4096"));
    fv_test_write(fv_test_path(top, "rgb.txt"), "0.0 a\0b.jpg\n", 12);
    assert_int_equal(try_source("tum", top, &error, &frames), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "rgb.txt:1: found a zero byte, expected text"));
    memset(text, ' ', 4000);
    for (int i = 0; i < 100; i++)
        text[2 * i] = '1';
    text[4000] = '\0';
    fv_test_write_text(fv_test_path(top, "rgb.txt"), text);
    assert_int_equal(try_source("tum", top, &error, &frames), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "rgb.txt:1: found more than 32 fields, expected fewer"));
    char address[5000];
    memset(address, 'a', sizeof address - 1);
    address[sizeof address - 1] = '\0';
    const struct fovea_source_ops *ops;
    const char *rest;
    struct fovea_source *source = NULL;
    assert_int_equal(fv_source_find("euroc:", &ops, &rest, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &everything, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "found a path of more than"));
    fv_test_folder_remove(top);
}

/* Stamps that repeat or go back are the loop's to refuse: the source hands them on as they are. */
static void test_stamps_out_of_order(void **state)
{
    (void)state;
    char top[FV_TEST_PATH_BYTES];
    struct fovea_error error;
    size_t frames;
    make_recording("tum", top);
    fv_test_write_text(
        fv_test_path(top, "rgb.txt"),
        "5 rgb/0000.jpg\n5 rgb/0001.jpg\n3 rgb/0002.jpg\n-9000000000 rgb/0003.jpg\n9000000000 rgb/0004.jpg\n");
    assert_int_equal(try_source("tum", top, &error, &frames), FOVEA_OK);
    assert_int_equal(frames, 5);
    fv_test_folder_remove(top);
}

/* ---- by mutation ----------------------------------------------------------------------------- */

static void mutate(struct fv_random *random, uint8_t *bytes, size_t *count)
{
    static const char pieces[] = ":#-[]{}\"'&*!|>%@`,\n\t 0.9e\0\xff";
    const uint32_t changes = 1 + fv_random_below(random, 6);
    for (uint32_t i = 0; i<changes && * count> 2; i++) {
        const size_t at = fv_random_below(random, (uint32_t)*count - 1);
        switch (fv_random_below(random, 5)) {
        case 0:
            bytes[at] = (uint8_t)fv_random_below(random, 256);
            break;
        case 1:
            bytes[at] = (uint8_t)pieces[fv_random_below(random, sizeof pieces - 1)];
            break;
        case 2:
            bytes[at] ^= (uint8_t)(1u << fv_random_below(random, 8));
            break;
        case 3:
            memmove(bytes + at, bytes + at + 1, *count - at - 1);
            --*count;
            break;
        default:
            if (fv_random_below(random, 4) == 0) *count = at + 1;
            break;
        }
    }
}

static void test_mutated(void **state)
{
    (void)state;
    static const char *const files[][2] = {
        {"euroc", CAM "data.csv"},
        {"euroc", CAM "sensor.yaml"},
        {"euroc", GT},
        {"tum", "rgb.txt"},
        {"tum", "camera.yaml"},
        {"tum", "groundtruth.txt"},
        {"kitti", "times.txt"},
        {"kitti", "calib.txt"},
        {"kitti", "poses.txt"},
        {"kitti", "image_0/000003.png"},
        {"images", "img1.jpg"},
    };
    enum { ROUNDS = 30 };
    struct fv_random random;
    fv_random_seed(&random, 17);
    int refused = 0;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        char top[FV_TEST_PATH_BYTES], path[FV_TEST_PATH_BYTES];
        size_t bytes;
        make_recording(files[i][0], top);
        snprintf(path, sizeof path, "%s", fv_test_path(top, files[i][1]));
        uint8_t *whole = fv_test_read(path, &bytes), *spoilt = malloc(bytes);
        assert_non_null(spoilt);
        for (int round = 0; round < ROUNDS; round++) {
            struct fovea_error error;
            size_t frames, count = bytes;
            memcpy(spoilt, whole, bytes);
            mutate(&random, spoilt, &count);
            fv_test_write(path, spoilt, count);
            const enum fovea_status status = try_source(files[i][0], top, &error, &frames);
            if (status == FOVEA_OK) continue;
            ++refused;
            if (status > 0 || strncmp(error.text, top, strlen(top)) != 0 ||
                strchr(error.text, '\n') != NULL)
                fail_msg("seed 17, %s, round %d: status %d: [%s]", path, round, status, error.text);
        }
        free(whole);
        free(spoilt);
        fv_test_folder_remove(top);
    }
    assert_true(refused > 50);
}

/* A log that is cut gives the frames before the cut, or is refused by byte; one with a byte spoilt
 * gives all frames that the damage leaves. */
static void test_mutated_log(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 23);
    char path[FV_TEST_PATH_BYTES];
    snprintf(path, sizeof path, "%s", fv_test_lcmlog(folder));
    size_t bytes;
    uint8_t *whole = fv_test_read(path, &bytes), *spoilt = malloc(bytes);
    assert_non_null(spoilt);
    const size_t frame_bytes = bytes / FV_TEST_FRAMES;
    for (int round = 0; round < 100; round++) {
        struct fovea_error error;
        size_t frames, count = bytes;
        memcpy(spoilt, whole, bytes);
        if (round % 2 == 0) {
            count = 1 + fv_random_below(&random, (uint32_t)bytes - 1);
        } else { /* in a header */
            const size_t at = fv_random_below(&random, FV_TEST_FRAMES) * frame_bytes +
                              fv_random_below(&random, 98);
            spoilt[at] = (uint8_t)~spoilt[at];
        }
        fv_test_write(path, spoilt, count);
        const enum fovea_status status = try_source("lcmlog", path, &error, &frames);
        if (status != FOVEA_OK) {
            assert_int_equal(round % 2, 0);
            assert_memory_equal(error.text, path, strlen(path));
            assert_null(strchr(error.text, '\n'));
        } else if (round % 2 == 0) {
            assert_int_equal(frames, count / frame_bytes);
        } else {
            assert_true(frames + 2 >= FV_TEST_FRAMES); /* a length may swallow a neighbour */
        }
    }
    free(whole);
    free(spoilt);
}

static void test_mutated_calibrations(void **state)
{
    (void)state;
    struct fv_calibration c = {.camera = {.width = 640,
                                          .height = 480,
                                          .fx = 500,
                                          .fy = 501,
                                          .cx = 320,
                                          .cy = 240,
                                          .k = {-0.2, 0.05}},
                               .name = "cam0",
                               .has_T_body_cam = true,
                               .T_body_cam = {0, 0, 1, 0.1, -1, 0, 0, 0.2, 0, -1, 0, 0.3},
                               .rate_hz = 20};
    struct fv_random random;
    fv_random_seed(&random, 29);
    int refused = 0;
    for (int round = 0; round < 500; round++) {
        char text[FV_CALIBRATION_BYTES_MAX];
        struct fv_calibration found;
        struct fovea_error error = {.text = ""};
        const enum fv_calibration_format format =
            (enum fv_calibration_format)(round % FV_CALIBRATION_FORMAT_COUNT);
        assert_int_equal(fv_calibration_format_text(format, &c, text, NULL, &error), FOVEA_OK);
        size_t count = strlen(text);
        mutate(&random, (uint8_t *)text, &count);
        ++cases;
        const enum fovea_status status =
            fv_calibration_parse("cam.yaml", text, count, NULL, &found, &error);
        if (status == FOVEA_OK) {
            assert_true(found.camera.fx > 0 && found.camera.field_max_rad > 0);
            continue;
        }
        ++refused;
        if (status > 0 || strncmp(error.text, "cam.yaml:", 9) != 0 ||
            strchr(error.text, '\n') != NULL)
            fail_msg("seed 29, round %d: status %d: [%s]", round, status, error.text);
    }
    assert_true(refused > 100);
}

static int clean(void **state)
{
    fv_test_place_tear_down(state);
    print_message("%d wrong recordings and calibrations\n", cases);
    return cases < 200;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_by_hand),
        cmocka_unit_test(test_long_lines_and_zero_bytes),
        cmocka_unit_test(test_stamps_out_of_order),
        cmocka_unit_test(test_mutated),
        cmocka_unit_test(test_mutated_log),
        cmocka_unit_test(test_mutated_calibrations),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, clean);
}
