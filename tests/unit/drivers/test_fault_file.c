/* Schedules of faults in a file (`fault:URI?file=PATH`): the same as `fault:` written once for each
 * line, and wrong lines are named. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/fault/fault.h"
#include "../../../drivers/fault/file.h"
#include "../../../drivers/table.h"
#include "base/hash.h"
#include "common/datasets.h"

#define SIM "sim:orbit?width=96&height=64&imu=200&wheel_odometry=0&frames=40"

static char path[FV_TEST_PATH_BYTES + 16];

static void write_file(const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

/* Of all frames: place, stamp and picture; `frames`: how many came. */
static uint64_t play(const char *uri, uint32_t *frames)
{
    const struct fovea_source_selection all = {.step = 1};
    const struct fovea_source_ops *ops = NULL;
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    const char *address = "";
    struct fovea_frame frame;
    uint64_t hash = FV_HASH_START;
    *frames = 0;
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK ||
        ops->open(address, &all, &source, &error) != FOVEA_OK)
        fail_msg("%s: %s", uri, error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        static struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
        const uint32_t count = ops->samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX);
        hash = fv_hash(hash, &frame.index, sizeof frame.index);
        hash = fv_hash(hash, &frame.stamp_ns, sizeof frame.stamp_ns);
        hash = fv_hash(hash, &count, sizeof count);
        if (frame.images[0].data != NULL)
            hash = fv_hash(hash, frame.images[0].data, frame.images[0].size_bytes);
        ++*frames;
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    return hash;
}

static void lines_are_faults_within_each_other(void **state)
{
    char uri[sizeof path + 128];
    uint32_t frames, expected, own;
    (void)state;
    write_file("# pictures, then samples, then a frame in ten\n"
               "black,jitter first=10 shortest=4 longest=4 count=1 level=9\n"
               "\n"
               "  imu_unplug\tfirst=20   shortest=5 longest=5 count=1\n"
               "drop shortest=1 longest=1 fraction=0.1 first=0 seed=3");
    snprintf(uri, sizeof uri, "fault:" SIM "?file=%s", path);
    const uint64_t hash = play(uri, &frames);
    assert_true(hash == play("fault:fault:fault:" SIM
                             "?kind=black,jitter&first=10&shortest=4&longest=4&count=1&level=9"
                             "?kind=imu_unplug&first=20&shortest=5&longest=5&count=1"
                             "?kind=drop&shortest=1&longest=1&fraction=0.1&first=0&seed=3",
                             &expected));
    assert_int_equal(frames, expected);
    assert_true(hash != play(SIM, &own));
    assert_true(frames < own);
}

/* What a recording states as its source. */
static void the_schedules_of_files_are_written_out(void **state)
{
    static const char *const plain[] = {SIM, "fault:" SIM "?kind=blur&seed=3",
                                        "fault:fault:tum:/a?b?kind=blur?kind=noise", "fault:x"};
    char uri[sizeof path + 128], whole[FV_FAULT_ADDRESS_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof plain / sizeof plain[0]; i++) {
        assert_true(fv_fault_uri_whole(plain[i], whole));
        if (i < 3) assert_string_equal(whole, plain[i]);
    }
    write_file("black first=10\n# then\ndrop seed=3");
    snprintf(uri, sizeof uri, "fault:fault:" SIM "?file=%s?kind=noise", path);
    assert_true(fv_fault_uri_whole(uri, whole));
    assert_string_equal(whole, "fault:fault:fault:" SIM
                               "?kind=black&first=10?kind=drop&seed=3?kind=noise");
    uint32_t frames, expected;
    assert_true(play(uri, &frames) == play(whole, &expected) && frames == expected);
    remove(path);
    assert_false(fv_fault_uri_whole(uri, whole));
}

static void note(void *context, const char *file)
{
    *(bool *)context = strcmp(file, path) == 0 || *(bool *)context;
}

/* So that no output is written over it. */
static void the_file_is_one_that_is_read(void **state)
{
    const struct fovea_source_selection all = {.step = 1};
    struct fovea_source *source;
    struct fovea_error error;
    char address[sizeof path + 128];
    bool named = false;
    (void)state;
    write_file("blur\n");
    snprintf(address, sizeof address, SIM "?file=%s", path);
    assert_int_equal(fv_source_fault.open(address, &all, &source, &error), FOVEA_OK);
    fv_source_fault.reads(source, note, &named);
    fv_source_fault.close(source);
    assert_true(named);
}

static void wrong_files_are_refused(void **state)
{
    static const char *const wrong[][2] = {
        {"", "found no line, expected kinds"},
        {"# nothing\n\n", "found no line, expected kinds"},
        {"blur\nblurr\n", ":2: fault: kind: found 'blurr'"},
        {"\nblur sigmas=3\n", ":2: fault: unknown option 'sigmas', did you mean 'sigma'"},
        {"kind=blur\n", ":1: fault: kind: found 'kind=blur'"},
        {"blur file=other\n", ":1: fault: unknown option 'file'"},
        {"drop,noise\n", ":1: fault: kind: found noise beside drop, where it does nothing"},
    };
    const struct fovea_source_selection all = {.step = 1};
    struct fovea_source *source;
    char address[sizeof path + 128], many[1 << 14] = "";
    (void)state;
    snprintf(address, sizeof address, SIM "?file=%s", path);
    for (size_t i = 0; i <= sizeof wrong / sizeof wrong[0]; i++) {
        struct fovea_error error = {.text = ""};
        const bool last = i == sizeof wrong / sizeof wrong[0];
        for (int n = 0; last && n < 300; n++)
            strcat(many, "blur first=1000\n");
        write_file(last ? many : wrong[i][0]);
        const char *said = last ? "found an address of more than 4095 bytes" : wrong[i][1];
        assert_int_equal(fv_source_fault.open(address, &all, &source, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, said) == NULL) fail_msg("%s: [%s]", said, error.text);
    }
    struct fovea_error error;
    remove(path);
    assert_int_not_equal(fv_source_fault.open(address, &all, &source, &error), FOVEA_OK);
}

static int set_up(void **state)
{
    if (fv_test_place_set_up(state) != 0) return -1;
    snprintf(path, sizeof path, "%s/faults.txt", fv_test_place);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_faults_within_each_other),
        cmocka_unit_test(the_schedules_of_files_are_written_out),
        cmocka_unit_test(the_file_is_one_that_is_read),
        cmocka_unit_test(wrong_files_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, fv_test_place_tear_down);
}
