/* Recording and replaying a short run: equal bit for bit; every kind of change to the log is found
 * and named; damaged logs end in one line. */
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
#include "common/short_run.h"
#include "support/lcmlog.h"
#include "support/text.h"
#include "message/fields.h"

enum { WIDTH = 160, HEIGHT = 120, ITERATIONS = 40 };

static char folder[] = "/tmp/fovea-test-XXXXXX";
static char good[64], changed[64];
static uint8_t *whole; /* the good log's bytes */
static size_t whole_bytes;

static void make_recording(void)
{
    const struct short_run run = {.width = WIDTH,
                                  .height = HEIGHT,
                                  .iterations = ITERATIONS,
                                  .features = 200,
                                  .detect = true};
    short_run_record(good, &run);
    struct fovea_error error;
    char *text;
    if (fv_text_read(good, 1 << 28, &text, &whole_bytes, &error) != FOVEA_OK) abort();
    whole = (uint8_t *)text;
}

/* ---- changing it ----------------------------------------------------------------------------- */

static void write_changed(const uint8_t *bytes, size_t count)
{
    FILE *file = fopen(changed, "wb");
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    fclose(file);
}

/* Offset in the file of the data of the n-th event on a channel. */
static size_t find_data(const char *channel, int n)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    size_t found = 0;
    assert_int_equal(fv_lcmlog_open(good, &log, &error), FOVEA_OK);
    while (found == 0 && fv_lcmlog_skim(log, &event, &error) == FOVEA_OK)
        if (strcmp(event.channel, channel) == 0 && n-- == 0)
            found = (size_t)event.offset + FV_LCMLOG_HEADER_BYTES + strlen(channel);
    fv_lcmlog_close(log);
    assert_true(found > 0);
    return found;
}

/* Where that event begins. */
static size_t find_event(const char *channel, int n)
{
    return find_data(channel, n) - strlen(channel) - FV_LCMLOG_HEADER_BYTES;
}

/* Replay the good log with one byte flipped. */
static enum fovea_status replay_flipped(size_t at, uint8_t bits, struct fv_replay_result *result,
                                        struct fovea_error *error)
{
    whole[at] ^= bits;
    write_changed(whole, whole_bytes);
    whole[at] ^= bits;
    return fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, result, error);
}

/* Offset in the file of a field of the n-th event on a channel, and its bytes; 0: there is no such
 * field. */
static size_t find_field(const char *channel, int n, int number, struct fovea_field *leaf)
{
    size_t at = find_data(channel, n);
    struct fovea_fields walk;
    const size_t event = at - strlen(channel) - FV_LCMLOG_HEADER_BYTES;
    const size_t bytes = (size_t)whole[event + 27] | (size_t)whole[event + 26] << 8 |
                         (size_t)whole[event + 25] << 16;
    assert_int_equal(fovea_fields_begin(&walk, whole + at, bytes), FOVEA_OK);
    while (fovea_fields_next(&walk, leaf) == FOVEA_OK)
        if (number-- == 0) return at + leaf->offset;
    return 0;
}

static void expect_difference(const char *channel, int n, size_t offset, const char *field,
                              const char *values)
{
    struct fv_replay_result result;
    struct fovea_error error;
    if (replay_flipped(find_data(channel, n) + offset, 1, &result, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_true(result.different);
    if (strstr(result.difference, channel) == NULL || strstr(result.difference, field) == NULL ||
        strstr(result.difference, values) == NULL)
        fail_msg("%s: %s", field, result.difference);
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void test_equal(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    if (fv_replay(good, FV_REPLAY_STOPS, NULL, NULL, &result, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    if (result.different) fail_msg("%s", result.difference);
    assert_int_equal(result.end, FV_REPLAY_WHOLE);
    assert_int_equal(result.frames, ITERATIONS - 3);
    assert_int_equal(result.steps, ITERATIONS);
    assert_int_equal(result.works, ITERATIONS);
    assert_int_equal(result.messages_with_readings, ITERATIONS / 4);
    assert_true(result.messages_equal >
                2 * ITERATIONS - 3); /* features, camera status and some previews */
}

/* With each method, which the recording names: another one gives other features. */
static void test_methods(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    for (int m = FOVEA_FEATURES_ORB; m <= FOVEA_FEATURES_SHI_TOMASI; m++) {
        const struct short_run run = {.width = WIDTH,
                                      .height = HEIGHT,
                                      .iterations = ITERATIONS,
                                      .features = 200,
                                      .method = (enum fovea_feature_method)m};
        short_run_record(changed, &run);
        if (fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error) != FOVEA_OK)
            fail_msg("%s", error.text);
        if (result.different) fail_msg("method %d: %s", m, result.difference);
        assert_int_equal(result.end, FV_REPLAY_WHOLE);
        assert_int_equal(result.frames, ITERATIONS - 3);
        assert_true(result.messages_equal > 2 * ITERATIONS - 3);
    }
}

static void test_differences(void **state)
{
    (void)state;
    /* Offsets by the wire format: hash 8, stamp 8+1+1+8+8, then the fields in order. */
    expect_difference("FOVEA_FEATURES", 7, 8 + 7, "stamp.time_ns",
                      "found 350001000, expected 350001001");
    expect_difference("FOVEA_FEATURES", 7, 35 + 4 + 3, "width", "found 160, expected 161");
    expect_difference("FOVEA_FEATURES", 7, 72 + 4 * 5, "p_px[2][1]", "found ");
    expect_difference("FOVEA_CAMERA_STATUS", 3, 35 + 8, "state", "found 0, expected 1");
    expect_difference("FOVEA_DETECTIONS", 1, 8 + 7, "stamp.time_ns", "found ");
    expect_difference("FOVEA_PREVIEW", 0, 55 + 100, "jpeg[100]", "found ");
    expect_difference("FOVEA_FEATURES", 0, 3, "", "expected an unknown type");
}

static void test_changed_inputs(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    /* A pixel within square 15: a corner more in this frame. */
    size_t frame = find_data("FOVEA_FRAME", 2) + 59;
    size_t inside = 44 * WIDTH + 117;
    assert_int_equal(replay_flipped(frame + inside, 0x80, &result, &error), FOVEA_OK);
    assert_true(result.different);
    assert_non_null(
        strstr(result.difference,
               "frame 2 (stamp 100001000 ns): FOVEA_FRAME: hash of the pixels: found "));
    /* One unit more for the preview: it comes earlier. */
    assert_int_equal(replay_flipped(find_data("FOVEA_GRANTS", 0) + 24 + 4 * FOVEA_JOB_PREVIEW + 3,
                                    0x7f, &result, &error),
                     FOVEA_OK);
    assert_true(result.different);
    /* More features than the configuration allows are refused, not tried. */
    assert_int_equal(replay_flipped(find_data("FOVEA_GRANTS", 4) + 16, 0x7f, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "features granted, expected at most 200"));
    /* Units of the network: its results come in another frame. */
    assert_int_equal(replay_flipped(find_data("FOVEA_GRANTS", 1) + 24 + 4 * FOVEA_JOB_DETECT + 3,
                                    0x7f, &result, &error),
                     FOVEA_OK);
    assert_true(result.different);
    assert_non_null(strstr(result.difference, "FOVEA_DETECTIONS"));
    /* A part of the header that does not fit its hash. */
    assert_int_equal(replay_flipped(find_data("FOVEA_RECORDING", 0) + 400, 1, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "configuration: found hash"));
}

/* Every field of the statistics is reproduced: but for those that tell of the moment and the
 * machine. */
static void test_changed_statistics(void **state)
{
    (void)state;
    uint32_t compared = 0, left_out = 0;
    struct fovea_field leaf;
    size_t at;
    for (int field = 0; (at = find_field("FOVEA_STATISTICS", 2, field, &leaf)) != 0; field++) {
        struct fv_replay_result result;
        struct fovea_error error;
        const char *named = "RECORDING_END: hash of all events before"; /* what was not reproduced
                                                                           was edited, though */
        const bool count =
            strstr(leaf.path, "_count") != NULL && strcmp(leaf.path, "reset_counter") != 0;
        const bool reading =
            strncmp(leaf.path, "stages[", 7) == 0 && strstr(leaf.path, "_ns") != NULL;
        const bool machine =
            strcmp(leaf.path, "version") == 0 || strcmp(leaf.path, "kernel_set") == 0;
        const size_t low = leaf.wire == FOVEA_WIRE_STRING ? 0 : leaf.bytes / leaf.count - 1;
        if (replay_flipped(at + low, 1, &result, &error) != FOVEA_OK)
            fail_msg("%s: %s", leaf.path, error.text);
        if (!reading && !machine) named = count ? "FOVEA_STATISTICS" : leaf.path;
        if (!result.different || strstr(result.difference, named) == NULL)
            fail_msg("%s: %s", leaf.path, result.difference);
        *(reading || machine ? &left_out : &compared) += 1;
    }
    assert_int_equal(left_out, 2 + 2 * FOVEA_STAGE_COUNT);
    assert_true(compared > 40);
}

static void test_missing_message(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    size_t data = find_data("FOVEA_FEATURES", 5),
           event = data - strlen("FOVEA_FEATURES") - FV_LCMLOG_HEADER_BYTES;
    size_t bytes = (size_t)whole[event + 27] | (size_t)whole[event + 26] << 8;
    size_t end = data + bytes;
    uint8_t *shorter = malloc(whole_bytes);
    memcpy(shorter, whole, event);
    memcpy(shorter + event, whole + end, whole_bytes - end);
    write_changed(shorter, whole_bytes - (end - event));
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error), FOVEA_OK);
    assert_true(result.different);
    assert_non_null(strstr(result.difference, "frame 5"));
    assert_non_null(strstr(result.difference, "found FOVEA_FEATURES, expected this channel"));
    free(shorter);
}

static void test_not_a_recording(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    write_changed(whole, 0);
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "byte 0: found nothing, expected a recording"));
    write_changed((const uint8_t *)"# a text file, and not a short one at that", 42);
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "byte 0: found 23206120, expected an LCM event (eda1da01)"));
    size_t frame = find_event("FOVEA_FRAME", 0);
    write_changed(whole + frame, whole_bytes - frame);
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(
        strstr(error.text, "begins with channel FOVEA_FRAME, expected a recording of fovea run"));
    assert_int_equal(fv_replay("/nonexistent", FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_int_equal(fv_replay("/tmp", FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
}

/* Cut anywhere: never a difference, and either the byte where the last event begins, or a log that
 * lacks its end. */
static void expect_cut(size_t cut, uint32_t *refused)
{
    struct fv_replay_result result;
    struct fovea_error error;
    write_changed(whole, cut);
    enum fovea_status status = fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error);
    assert_false(result.different);
    assert_int_equal(result.end, FV_REPLAY_CUT_OFF);
    if (status == FOVEA_ERROR_INPUT)
        assert_non_null(strstr(error.text, "the event is cut off"));
    else
        assert_int_equal(status, FOVEA_OK);
    *refused += status == FOVEA_ERROR_INPUT;
}

static void test_cut_off(void **state)
{
    (void)state;
    uint32_t refused = 0, none = 0;
    for (size_t cut = whole_bytes - 1; cut > 2000; cut -= cut / 12 + 1)
        expect_cut(cut, &refused);
    assert_true(refused > 20);
    /* Where one event ends and the next begins, as when the program was killed. */
    for (int iteration = ITERATIONS - 4; iteration < ITERATIONS; iteration++) {
        expect_cut(find_event("FOVEA_GRANTS", iteration), &none);
        expect_cut(find_event("FOVEA_INPUTS", iteration), &none);
    }
    expect_cut(find_event("FOVEA_RECORDING_END", 0), &none);
    assert_int_equal(none, 0);
}

/* Change a field of the n-th event of a channel in its lowest bit: that must be found. */
static void expect_edits_found(const char *channel, int n)
{
    struct fovea_field leaf;
    size_t at;
    for (int field = 0; (at = find_field(channel, n, field, &leaf)) != 0; field++) {
        struct fv_replay_result result;
        struct fovea_error error;
        const size_t low = leaf.wire == FOVEA_WIRE_STRING ? 0 : leaf.bytes / leaf.count - 1;
        if (leaf.bytes == 0 || (leaf.wire == FOVEA_WIRE_STRING && leaf.bytes == 1)) continue;
        const enum fovea_status status = replay_flipped(at + low, 1, &result, &error);
        if (status == FOVEA_OK && !result.different)
            fail_msg("%s: %s: the edit passes", channel, leaf.path);
    }
}

/* Every field of everything, also those that no message shows: then the hash at the end tells. */
static void test_every_edit(void **state)
{
    (void)state;
    expect_edits_found("FOVEA_RECORDING", 0);
    expect_edits_found("FOVEA_FRAME", 9);
    expect_edits_found("FOVEA_INPUTS", 9);
    expect_edits_found("FOVEA_GRANTS", 9);
    expect_edits_found("FOVEA_CAMERA_POSE", 9);
    expect_edits_found("FOVEA_RECORDING_END", 0);
    struct fv_replay_result result;
    struct fovea_error error;
    const size_t event = find_event("FOVEA_GRANTS", 9);
    for (size_t at = event; at < event + FV_LCMLOG_HEADER_BYTES;
         at++) /* sync, number, time, sizes */
        assert_true(replay_flipped(at, 1, &result, &error) != FOVEA_OK || result.different);
    replay_flipped(event + 11, 1, &result, &error);
    assert_non_null(
        strstr(result.difference, "FOVEA_RECORDING_END: hash of all events before: found "));
}

/* A recording of another version is named first, in one line, whatever follows. */
static void test_another_version_is_named(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    struct fovea_field leaf;
    char said[3][1024] = {{0}};
    const size_t version = find_field("FOVEA_RECORDING", 0, 1, &leaf);
    assert_string_equal(leaf.path, "version");
    FILE *kept = tmpfile();
    const int errors = dup(STDERR_FILENO);
    assert_true(kept != NULL && errors >= 0);
    /* The same, another version, and the same one of other sources: 0.2.0+ and twelve digits. */
    for (int other = 0; other < 3; other++) {
        dup2(fileno(kept), STDERR_FILENO);
        const enum fovea_status status =
            replay_flipped(other < 2 ? version : version + 10, other ? 1 : 0, &result, &error);
        dup2(errors, STDERR_FILENO);
        assert_int_equal(status, FOVEA_OK);
        rewind(kept);
        assert_true(fread(said[other], 1, sizeof said[other] - 1, kept) > 0 || !other);
    }
    fclose(kept);
    close(errors);
    assert_string_equal(said[0], "");
    assert_non_null(strstr(said[1], ": recorded by Fovea 1.2.0+"));
    assert_non_null(strstr(said[1], "; this is version 0.2.0+"));
    assert_non_null(strstr(said[1], ", whose results may differ\n"));
    assert_true(strchr(said[1], '\n')[1] == '\0');
    assert_non_null(strstr(strchr(said[2], '\n'), ": recorded by Fovea 0.2.0+"));
}

/* What a log says of itself is printed: its control bytes are not. */
static void test_texts_are_printable(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    struct fovea_field leaf;
    const size_t version = find_field("FOVEA_RECORDING", 0, 1, &leaf),
                 reason = find_field("FOVEA_RECORDING_END", 0, 3, &leaf);
    assert_string_equal(leaf.path, "reason");
    assert_int_equal(replay_flipped(version, whole[version] ^ 0x1b, &result, &error), FOVEA_OK);
    assert_non_null(strstr(result.recorded_by, "Fovea ?"));
    const size_t end = find_event("FOVEA_RECORDING_END", 0);
    uint8_t *longer = malloc(whole_bytes + 4);
    assert_non_null(longer);
    memcpy(longer, whole, whole_bytes);
    longer[end + 27] =
        (uint8_t)(longer[end + 27] + 4); /* the bytes of the message, and of its text */
    longer[reason - 1] = 5;
    memcpy(longer + reason, "\x1b[2J", 5);
    write_changed(longer, whole_bytes + 4);
    free(longer);
    assert_int_equal(fv_replay(changed, 0, NULL, NULL, &result, &error), FOVEA_OK);
    assert_string_equal(result.reason, "?[2J");
}

static void test_more_after_the_end(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    const size_t inputs = find_event("FOVEA_INPUTS", 9),
                 more = find_event("FOVEA_GRANTS", 9) - inputs;
    uint8_t *longer = malloc(whole_bytes + more);
    assert_non_null(longer);
    memcpy(longer, whole, whole_bytes);
    memcpy(longer + whole_bytes, whole + inputs, more);
    write_changed(longer, whole_bytes + more);
    free(longer);
    assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(
        strstr(error.text, "found an event after the end of the recording, expected none"));
}

/* Formats of Fovea 0.1 are refused with the name of what reads them, others without. */
static void test_other_formats(void **state)
{
    (void)state;
    static const struct {
        uint8_t format;
        const char *said;
    } cases[] = {{2, "found recording format 2, which Fovea 0.1 reads, expected 4"},
                 {3, "found recording format 3, which Fovea 0.1 reads, expected 4"},
                 {5, "found recording format 5, expected 4"}};
    struct fv_replay_result result;
    struct fovea_error error;
    const size_t format = find_data("FOVEA_RECORDING", 0) + 8 + 3;
    assert_int_equal(whole[format], 4);
    for (int i = 0; i < 3; i++) {
        whole[format] = cases[i].format;
        write_changed(whole, whole_bytes);
        assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                         FOVEA_ERROR_UNSUPPORTED);
        if (strstr(error.text, cases[i].said) == NULL) fail_msg("%s", error.text);
    }
    whole[format] = 4;
}

static void test_mutated(void **state)
{
    (void)state;
    uint64_t seed = 7;
    uint8_t *copy = malloc(whole_bytes);
    uint32_t outcomes[3] = {0};
    size_t header = find_data("FOVEA_FRAME", 0);
    for (int round = 0; round < 100; round++) {
        memcpy(copy, whole, whole_bytes);
        for (int flips = 0; flips < 1 + round % 5; flips++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            size_t span = round % 2 == 0 ? header : whole_bytes;
            copy[(size_t)(seed >> 20) % span] ^= (uint8_t)(1u << (seed >> 61));
        }
        write_changed(copy, whole_bytes);
        struct fv_replay_result result;
        struct fovea_error error = {0};
        enum fovea_status status = fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error);
        if (status != FOVEA_OK) {
            assert_true(strncmp(error.text, changed, strlen(changed)) == 0);
            assert_null(strchr(error.text, '\n'));
        }
        outcomes[status != FOVEA_OK ? 0 : result.different ? 1 : 2]++;
    }
    print_message("100 mutated logs: %u refused, %u different, %u equal\n", outcomes[0],
                  outcomes[1], outcomes[2]);
    assert_true(outcomes[0] > 30 && outcomes[1] > 5);
    free(copy);
}

/* A recording that began in the middle of its run replays bit for bit, before and after networks,
 * maps and jobs have begun, with the parameters that were in force; but only when it is trusted. */
static void test_middle(void **state)
{
    (void)state;
    struct fv_replay_result result;
    struct fovea_error error;
    for (uint32_t begin = 2; begin < ITERATIONS; begin += 9) {
        const struct short_run run = {.width = WIDTH,
                                      .height = HEIGHT,
                                      .iterations = ITERATIONS,
                                      .features = 200,
                                      .detect = begin % 2 == 0,
                                      .rig = begin % 4 == 3,
                                      .begin = begin};
        short_run_record(changed, &run);
        assert_int_equal(fv_replay(changed, FV_REPLAY_STOPS, NULL, NULL, &result, &error),
                         FOVEA_ERROR_INPUT);
        assert_non_null(strstr(error.text, "--trust-state"));
        if (fv_replay(changed, FV_REPLAY_STOPS | FV_REPLAY_TRUSTS, NULL, NULL, &result, &error) !=
            FOVEA_OK)
            fail_msg("%s", error.text);
        if (result.different) fail_msg("from %u: %s", (unsigned)begin, result.difference);
        assert_int_equal(result.end, FV_REPLAY_WHOLE);
        assert_int_equal(result.steps, ITERATIONS - begin);
        assert_true(result.messages_equal > 2 * (ITERATIONS - begin));
    }
}

int main(void)
{
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(good, sizeof good, "%s/good", folder);
    snprintf(changed, sizeof changed, "%s/changed", folder);
    make_recording();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equal),
        cmocka_unit_test(test_methods),
        cmocka_unit_test(test_differences),
        cmocka_unit_test(test_changed_inputs),
        cmocka_unit_test(test_missing_message),
        cmocka_unit_test(test_changed_statistics),
        cmocka_unit_test(test_every_edit),
        cmocka_unit_test(test_other_formats),
        cmocka_unit_test(test_more_after_the_end),
        cmocka_unit_test(test_another_version_is_named),
        cmocka_unit_test(test_texts_are_printable),
        cmocka_unit_test(test_not_a_recording),
        cmocka_unit_test(test_cut_off),
        cmocka_unit_test(test_mutated),
        cmocka_unit_test(test_middle),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(good);
    unlink(changed);
    rmdir(folder);
    free(whole);
    return failed;
}
