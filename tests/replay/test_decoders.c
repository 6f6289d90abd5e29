/* Networks with decoders of keypoints, classes and masks in the loop: each is heard on its own
 * channels and on no other, and a recording of them replays bit for bit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/record/replay.h"
#include "nn/model.h"
#include "support/lcmlog.h"
#include "support/text.h"

enum { FRAMES = 12, MODEL_MAX = 1 << 16, PATH_BYTES = 64 };

/* The golden network, whose numbers another decoder reads. */
static void make_model(const char *path, const struct fv_model_decode *decode)
{
    static _Alignas(64) uint8_t model[MODEL_MAX];
    FILE *file = fopen("tests/golden/detector.fvm", "rb");
    assert_non_null(file);
    const size_t bytes = fread(model, 1, MODEL_MAX, file);
    fclose(file);
    struct fv_model_header *header = (struct fv_model_header *)(void *)model;
    header->decode = *decode;
    header->checksum = fv_model_checksum(model + 16, bytes - 16);
    file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(model, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
}

/* Elements of its output. */
static int32_t output_count(void)
{
    struct fv_model_header header;
    struct fv_model_tensor t;
    int32_t index = 0, count = 1;
    FILE *file = fopen("tests/golden/detector.fvm", "rb");
    assert_non_null(file);
    assert_int_equal(fread(&header, sizeof header, 1, file), 1);
    fseek(file, (long)header.outputs, SEEK_SET);
    assert_int_equal(fread(&index, sizeof index, 1, file), 1);
    fseek(file, (long)header.tensors + (long)sizeof t * index, SEEK_SET);
    assert_int_equal(fread(&t, sizeof t, 1, file), 1);
    fclose(file);
    for (int32_t i = 0; i < t.rank; i++)
        count *= t.dims[i];
    return count;
}

static void record(const char *first, const char *second, const char *path)
{
    char argument[PATH_BYTES + 16];
    snprintf(argument, sizeof argument, "detect2.model=%s", second);
    const char *const arguments[] = {
        "fovea",     "run",    "--source", "sim:orbit?width=320&height=240",
        "--frames",  "12",     "--model",  first,
        "--set",     argument, "--set",    "lcm_url=",
        "--picture", "none",   "--quiet",  "--record",
        path,        NULL};
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0)
        exit(fv_dispatch((int)(sizeof arguments / sizeof *arguments) - 1,
                         (char **)(uintptr_t)arguments));
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

/* Messages of a channel in the recording; `at` takes where the last one is. */
static int heard(const char *path, const char *channel, size_t *at)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    int count = 0;
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    while (fv_lcmlog_skim(log, &event, &error) == FOVEA_OK) {
        if (strcmp(event.channel, channel) != 0) continue;
        *at = (size_t)event.offset + FV_LCMLOG_HEADER_BYTES + strlen(channel);
        count++;
    }
    fv_lcmlog_close(log);
    return count;
}

static const char *const channels[] = {"DETECTIONS",   "KEYPOINTS", "CLASSES",
                                       "SEGMENTATION", "TENSORS",   "OBJECTS"};

/* Two networks, of which the first is heard on one channel alone, the second on another; their
 * recording replays, and a difference in a message of the first is found. */
static void replays(const struct fv_model_decode *one, const char *first_channel,
                    const struct fv_model_decode *other, const char *second_channel)
{
    char folder[] = "/tmp/fovea-decoders-XXXXXX", first[PATH_BYTES], second[PATH_BYTES],
         path[PATH_BYTES], name[PATH_BYTES];
    struct fv_replay_result result;
    struct fovea_error error;
    assert_non_null(mkdtemp(folder));
    snprintf(first, sizeof first, "%s/first.fvm", folder);
    snprintf(second, sizeof second, "%s/second.fvm", folder);
    snprintf(path, sizeof path, "%s/run.lcm", folder);
    make_model(first, one);
    make_model(second, other);
    record(first, second, path);
    size_t at = 0;
    for (size_t i = 0; i < sizeof channels / sizeof *channels; i++) {
        snprintf(name, sizeof name, "FOVEA_%s", channels[i]);
        const int found = heard(path, name, &at);
        assert_true(strcmp(channels[i], first_channel) == 0 ? found > 3 : found == 0);
        snprintf(name, sizeof name, "FOVEA_%s2", channels[i]);
        const int others = heard(path, name, &at);
        assert_true(strcmp(channels[i], second_channel) == 0 ? others > 3 : others == 0);
    }
    snprintf(name, sizeof name, "FOVEA_%s", first_channel);
    heard(path, name, &at);
    assert_int_equal(fv_replay(path, FV_REPLAY_STOPS, NULL, NULL, &result, &error), FOVEA_OK);
    if (result.different) fail_msg("%s", result.difference);
    assert_int_equal(result.steps, FRAMES);

    FILE *file = fopen(path, "r+b"); /* a keypoint that another run gave */
    assert_non_null(file);
    assert_int_equal(fseek(file, (long)at + 150, SEEK_SET), 0);
    const int byte = fgetc(file);
    assert_int_equal(fseek(file, (long)at + 150, SEEK_SET), 0);
    fputc(byte ^ 1, file);
    fclose(file);
    assert_int_equal(fv_replay(path, FV_REPLAY_STOPS, NULL, NULL, &result, &error), FOVEA_OK);
    assert_true(result.different);
    assert_non_null(strstr(result.difference, name));
    unlink(path);
    unlink(first);
    unlink(second);
    rmdir(folder);
}

static void keypoints_classes_and_masks_replay(void **state)
{
    (void)state;
    const struct fv_model_decode points = {.kind = FV_DECODER_LANDMARKS,
                                           .point_count = output_count() / 2,
                                           .point_values = 2,
                                           .max_detections = 300},
                                 classes = {.kind = FV_DECODER_CLASSIFIER, .max_detections = 5},
                                 mask = {.kind = FV_DECODER_SEGMENT, .probabilities = 1};
    replays(&points, "KEYPOINTS", &classes, "CLASSES");
    replays(&mask, "SEGMENTATION", &points, "KEYPOINTS");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(keypoints_classes_and_masks_replay)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
