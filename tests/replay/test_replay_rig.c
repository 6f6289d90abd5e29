/* A recording of a rig: two cameras, the second absent in every third frame, and every other kind
 * of sensor. It is fed back bit by bit by replay and by the source that plays it; what is missing
 * or changed in it is found. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/record/replay.h"
#include "common/datasets.h"
#include "common/short_run.h"
#include "../../drivers/recorded/player.h"
#include "support/lcmlog.h"
#include "support/text.h"

enum { WIDTH = 160, HEIGHT = 120, ITERATIONS = 40 };

static char folder[] = "/tmp/fovea-test-XXXXXX";
static char good[64], changed[64];
static char *whole; /* the good log's bytes */
static size_t whole_bytes;

/* What a source of the recorded log gives: samples bit by bit as they were recorded. An iteration
 * without a frame has its samples with the next frame. */
static void test_fed_again(void **state)
{
    (void)state;
    static const struct fovea_source_selection everything = {.step = 1};
    const struct fovea_source_ops *ops = &fv_source_lcmlog;
    struct fovea_sample found[FOVEA_INPUT_SAMPLES_MAX], expected[SHORT_RUN_SAMPLES];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    uint32_t iteration = 0;
    assert_int_equal(ops->open(good, &everything, &source, &error), FOVEA_OK);
    const struct fovea_source_info *info = ops->info(source);
    assert_true(info->rig.camera_count == 2 && info->rig.has_imu);
    assert_int_equal(info->sample_kinds, (1u << FOVEA_SAMPLE_KIND_COUNT) - 1);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        const uint32_t count = ops->samples(source, &frame, found, FOVEA_INPUT_SAMPLES_MAX);
        uint32_t at = 0;
        for (; iteration <= frame.sequence; iteration++) {
            short_run_samples(iteration, expected);
            assert_true(count >= at + SHORT_RUN_SAMPLES);
            for (int i = 0; i < SHORT_RUN_SAMPLES; i++, at++) {
                const uint32_t values = fovea_sample_value_count(expected[i].kind);
                assert_int_equal(found[at].kind, expected[i].kind);
                assert_int_equal(found[at].any.stamp_ns, expected[i].any.stamp_ns);
                assert_memory_equal(found[at].any.values, expected[i].any.values,
                                    values * sizeof(double));
            }
        }
        assert_int_equal(count, at);
        assert_int_equal(frame.images[0].width, WIDTH);
        if (frame.images[1].data != NULL)
            assert_true(frame.images[1].width == WIDTH * 3 / 4 &&
                        frame.images[1].height == HEIGHT * 3 / 4);
        ops->requeue(source, &frame);
    }
    assert_true(iteration >= ITERATIONS - 1);
    ops->close(source);
}

/* In reverse the pictures come alone, and one line says so. */
static void test_fed_in_reverse(void **state)
{
    (void)state;
    static const struct fovea_source_selection backwards = {.step = 1, .reverse = true};
    const struct fovea_source_ops *ops = &fv_source_lcmlog;
    struct fovea_sample found[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    uint32_t frames = 0;
    assert_int_equal(ops->open(good, &backwards, &source, &error), FOVEA_OK);
    const struct fovea_source_info *info = ops->info(source);
    assert_true(info->rig.camera_count == 2 && !info->rig.has_imu && info->sample_kinds == 0);
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, ": played in reverse without its "));
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (; ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK; frames++) {
        assert_int_equal(ops->samples(source, &frame, found, FOVEA_INPUT_SAMPLES_MAX), 0);
        ops->requeue(source, &frame);
    }
    assert_int_equal(frames, info->frame_count);
    ops->close(source);
}

static void test_equal(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    if (fv_replay(good, FV_REPLAY_STOPS, NULL, NULL, &result, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    if (result.different) fail_msg("%s", result.difference);
    assert_true(result.end == FV_REPLAY_WHOLE && result.frames == ITERATIONS - 3);
}

/* The first event on a channel of the good log, and where it ends. */
static size_t find_event(const char *channel, size_t *behind)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    assert_int_equal(fv_lcmlog_open(good, &log, &error), FOVEA_OK);
    do
        assert_int_equal(fv_lcmlog_next(log, &event, &error), FOVEA_OK);
    while (strcmp(event.channel, channel) != 0);
    fv_lcmlog_close(log);
    *behind = (size_t)event.offset + FV_LCMLOG_HEADER_BYTES + strlen(channel) + event.bytes;
    return (size_t)event.offset;
}

static void test_missing_sample(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    size_t behind;
    const size_t at = find_event("FOVEA_IMU", &behind), less = whole_bytes - (behind - at);
    char *bytes = malloc(less);
    assert_non_null(bytes);
    memcpy(bytes, whole, at);
    memcpy(bytes + at, whole + behind, whole_bytes - behind);
    fv_test_write(changed, bytes, less);
    free(bytes);
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(
        strstr(error.text, "found another number of samples, parameters and maps before them"));
}

/* Offset in the good log of its third frame, the first without an image of the second camera. */
static size_t third_frame(void)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_frame frame;
    struct fovea_error error;
    assert_int_equal(fv_lcmlog_open(good, &log, &error), FOVEA_OK);
    for (int frames = 0; frames < 3;) {
        assert_int_equal(fv_lcmlog_next(log, &event, &error), FOVEA_OK);
        if (strcmp(event.channel, "FOVEA_FRAME") != 0) continue;
        assert_int_equal(fv_lcmlog_frame(good, &event, &frame, &error), FOVEA_OK);
        assert_int_equal(frame.image_count, 2);
        assert_int_equal(frame.images[1].width, frames == 2 ? 0 : WIDTH * 3 / 4);
        assert_int_equal(frame.images[1].data == NULL, frames++ == 2);
    }
    fv_lcmlog_close(log);
    return (size_t)event.offset;
}

/* A pixel of the second camera, which no message shows, is missed by its hash. */
static void test_changed_pixel(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    const size_t second_image = (size_t)(WIDTH * HEIGHT) * 9 / 16; /* bytes */
    size_t at = third_frame();
    while (memcmp(whole + at, "FOVEA_INPUTS", 12) != 0)
        at--;
    at -= second_image / 2; /* the middle of the second image of the second frame */
    whole[at] ^= 1;
    fv_test_write(changed, whole, whole_bytes);
    whole[at] ^= 1;
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error), FOVEA_OK);
    assert_true(result.different);
    assert_non_null(strstr(result.difference, "frame 1 ("));
    assert_non_null(strstr(result.difference, "hash of the pixels"));
}

int main(void)
{
    const struct short_run run = {
        .width = WIDTH, .height = HEIGHT, .iterations = ITERATIONS, .features = 200, .rig = true};
    struct fovea_error error;
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(good, sizeof good, "%s/good", folder);
    snprintf(changed, sizeof changed, "%s/changed", folder);
    short_run_record(good, &run);
    if (fv_text_read(good, 1 << 28, &whole, &whole_bytes, &error) != FOVEA_OK) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equal),          cmocka_unit_test(test_fed_again),
        cmocka_unit_test(test_fed_in_reverse), cmocka_unit_test(test_missing_sample),
        cmocka_unit_test(test_changed_pixel),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(good);
    unlink(changed);
    rmdir(folder);
    free(whole);
    return failed;
}
