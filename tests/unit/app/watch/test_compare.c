/* Two runs on the same inputs are equal, over kernel sets too; a bit that is flipped in one of
 * them, in its state, its pixels or its recording, is named with its frame and stage. */
#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/watch/compare.h"
#include "common/sim_rig.h"
#include "runtime/state.h"
#include "support/lcmlog.h"

enum { FRAMES = 24, AT = 17, BYTES_MAX = 8192 };

static struct sim_rig rig;
static struct fv_compared compared;

struct hashes {
    uint32_t bytes[FRAMES];
    uint8_t data[FRAMES][BYTES_MAX];
};
static struct hashes first, second; /* the first: of a run as it should be */

/* Flip a bit in the middle of what `owner` owns. */
static void flip_state(const char *owner)
{
    for (uint32_t i = 0; i < rig.rt->lockstep.part_count; i++) {
        const struct fv_lockstep_part *part = &rig.rt->lockstep.parts[i];
        if (strcmp(part->owner, owner) != 0) continue;
        rig.rt->part_base[part->part][part->from + part->bytes / 2] ^= 4;
        return;
    }
    fail_msg("nothing of %s is in the state", owner);
}

/* A run whose frame AT finds a flipped bit: of `owner`, of the picture ("pixels"), or none. */
static void run(const char *cpu, const char *owner, struct hashes *hashes)
{
    static uint8_t pixels[320 * 240];
    if (cpu != NULL) setenv("FOVEA_CPU", cpu, 1);
    sim_rig_open_kept(&rig, "sim:orbit?width=320&height=240", 0, FRAMES);
    rig.config.lockstep_every = 1;
    rig.config.features.count_max = 500;
    rig.config.odometry.keyframes = 16;
    sim_rig_build(&rig);
    unsetenv("FOVEA_CPU");
    for (int n = 0; sim_rig_next(&rig); n++) {
        struct fovea_frame frame = *rig.inputs.frame;
        if (n == AT && owner != NULL && strcmp(owner, "pixels") == 0) {
            assert_int_equal(frame.images[0].size_bytes, sizeof pixels);
            memcpy(pixels, frame.images[0].data, sizeof pixels);
            pixels[100 * 320 + 7] ^= 1;
            frame.images[0].data = pixels;
            rig.inputs.frame = &frame;
        } else if (n == AT && owner != NULL) {
            flip_state(owner);
        }
        sim_rig_process(&rig);
        const struct fovea_message *sent = &rig.work.messages[rig.work.message_count - 1];
        assert_string_equal(sent->channel, "FOVEA_LOCKSTEP");
        assert_in_range(sent->bytes, 1, BYTES_MAX);
        hashes->bytes[n] = sent->bytes;
        memcpy(hashes->data[n], sent->data, sent->bytes);
    }
    assert_int_equal(rig.frames, FRAMES);
    sim_rig_close(&rig);
}

/* The first iteration that differs, described in `compared`; FRAMES: none. */
static int first_difference(void)
{
    memset(&compared, 0, sizeof compared);
    for (int n = 0; n < FRAMES; n++)
        if (!fv_compare_lockstep(first.data[n], first.bytes[n], second.data[n], second.bytes[n],
                                 &compared))
            return n;
    return FRAMES;
}

static void equal_runs_are_equal_over_kernel_sets(void **state)
{
    (void)state;
    run("c", NULL, &second);
    assert_int_equal(first_difference(), FRAMES);
}

static void a_flipped_bit_is_named_with_frame_and_stage(void **state)
{
    static const char *const owners[] = {"odometry", "scale", "publish"};
    (void)state;
    for (size_t i = 0; i < sizeof owners / sizeof owners[0]; i++) {
        run(NULL, owners[i], &second);
        assert_int_equal(first_difference(), AT);
        assert_string_equal(compared.stage, owners[i]);
        assert_string_equal(compared.inputs, "");
    }
}

static void another_picture_is_a_difference_of_inputs(void **state)
{
    (void)state;
    run(NULL, "pixels", &second);
    assert_int_equal(first_difference(), AT);
    assert_string_equal(compared.inputs, "by their hash");
    assert_string_equal(compared.stage, "");
    assert_string_equal(compared.message, "");
}

/* ---- recordings ------------------------------------------------------------------------------ */

static char folder[] = "/tmp/fovea_compare_XXXXXX";

static const char *path(const char *name)
{
    static char paths[2][64];
    static int turn;
    turn = 1 - turn;
    snprintf(paths[turn], sizeof paths[turn], "%s/%s", folder, name);
    return paths[turn];
}

/* The exit status of `fovea` with the words of `line`. */
static int command(char *line)
{
    const pid_t child = fork();
    if (child == 0) {
        char *words[20];
        int count = 0;
        for (char *word = strtok(line, " "); word != NULL; word = strtok(NULL, " "))
            words[count++] = word;
        words[count] = NULL;
        _exit(fv_dispatch(count, words));
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void record(const char *name, const char *source)
{
    char line[320];
    snprintf(line, sizeof line,
             "fovea run --quiet --picture none --set lcm_url= --set lockstep_every=1 "
             "--set features.count_max=500 --frames 20 --source %s --record %s",
             source, path(name));
    assert_int_equal(command(line), 0);
}

static int status_of_compare(const char *name)
{
    char line[160];
    snprintf(line, sizeof line, "fovea compare %s ", path("a.lcm"));
    snprintf(line + strlen(line), sizeof line - strlen(line), "%s", path(name));
    return command(line);
}

/* Where the data of the n-th event of `channel` begins in a.lcm; its length in `bytes`. */
static long place_of(const char *channel, int n, long *bytes)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    long offset = -1;
    assert_int_equal(fv_lcmlog_open(path("a.lcm"), &log, &error), FOVEA_OK);
    while (offset < 0 && fv_lcmlog_next(log, &event, &error) == FOVEA_OK)
        if (strcmp(event.channel, channel) == 0 && n-- == 0)
            offset = (long)event.offset + FV_LCMLOG_HEADER_BYTES + (long)strlen(channel);
    *bytes = event.bytes;
    fv_lcmlog_close(log);
    assert_true(offset > 0);
    return offset;
}

/* A copy of a.lcm up to byte `end`, with one bit flipped in byte `flipped`. */
static void copy(const char *name, long flipped, long end)
{
    FILE *from = fopen(path("a.lcm"), "rb"), *to = fopen(path(name), "wb");
    assert_non_null(from);
    assert_non_null(to);
    int byte;
    for (long i = 0; i < end && (byte = fgetc(from)) != EOF; i++)
        fputc(i == flipped ? byte ^ 1 : byte, to);
    fclose(from);
    assert_int_equal(fclose(to), 0);
}

/* A copy of a.lcm with one bit flipped in the n-th event of `channel`, in byte `at` of its data; of
 * a negative number, so many bytes from its end. */
static void edit(const char *name, const char *channel, int n, int32_t at)
{
    long bytes;
    const long data = place_of(channel, n, &bytes);
    copy(name, data + (at < 0 ? bytes : 0) + at, LONG_MAX);
}

static void compare(const char *name)
{
    struct fovea_error error = {0};
    char a[64];
    snprintf(a, sizeof a, "%s", path("a.lcm"));
    if (fv_compare_recordings(a, path(name), &compared, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

static void recordings_of_equal_runs_are_equal(void **state)
{
    (void)state;
    compare("b.lcm");
    assert_false(compared.different);
    assert_int_equal(compared.iterations, 20);
    assert_int_equal(compared.hashed, 20);
    assert_string_equal(compared.ended, "");
}

static void an_edited_recording_is_named_by_frame_and_field(void **state)
{
    (void)state;
    edit("pose.lcm", "FOVEA_POSE", 13, -9); /* the last byte of map_orientation */
    compare("pose.lcm");
    assert_true(compared.different);
    assert_int_equal(compared.sequence, 13);
    assert_string_equal(compared.inputs, "");
    assert_non_null(strstr(compared.message, "POSE: map_orientation[3]: found "));
    edit("state.lcm", "FOVEA_LOCKSTEP", 11, -1); /* the hash of the last message */
    compare("state.lcm");
    assert_int_equal(compared.sequence, 11);
    assert_true(compared.different && compared.message[0] != '\0');
    edit("pixels.lcm", "FOVEA_FRAME", 9, -3000);
    compare("pixels.lcm");
    assert_int_equal(compared.sequence, 9);
    assert_non_null(strstr(compared.inputs, "FRAME: images[0].data["));
    assert_string_equal(compared.message, "");
}

/* The readings of one board's clocks are not the other's: no difference. */
static void readings_of_clocks_are_left_out(void **state)
{
    static const struct {
        const char *channel;
        int32_t at;
    } readings[] = {{"FOVEA_POSE", -1},        /* latency_ns */
                    {"FOVEA_CAMERA_POSE", 25}, /* stamp.utc_offset_ns, likewise below */
                    {"FOVEA_FEATURES", 25},    {"FOVEA_FRAME", 25},
                    {"FOVEA_INPUTS", 77},  /* utc_offset_ns */
                    {"FOVEA_INPUTS", 85}}; /* latency_ns */
    (void)state;
    for (size_t i = 0; i < sizeof readings / sizeof readings[0]; i++) {
        edit("clock.lcm", readings[i].channel, 13, readings[i].at);
        compare("clock.lcm");
        if (compared.different) fail_msg("%s: %s", compared.inputs, compared.message);
        assert_int_equal(compared.iterations, 20);
    }
}

static void other_inputs_are_named_as_such(void **state)
{
    (void)state;
    record("other.lcm", "sim:orbit?width=320&height=240&seed=2");
    compare("other.lcm");
    assert_true(compared.different);
    assert_int_equal(compared.iteration, 0);
    assert_non_null(strstr(compared.inputs, "FRAME"));
}

/* Within an event or behind one, by a crash: what was equal before is counted. The iteration in
 * which it ends may lack something. */
static void a_recording_that_is_cut_off_is_compared_up_to_there(void **state)
{
    (void)state;
    long bytes;
    const long data = place_of("FOVEA_FRAME", 9, &bytes),
               event = data - FV_LCMLOG_HEADER_BYTES - (long)strlen("FOVEA_FRAME");
    const long ends[] = {data + 5000, data + bytes - 1, event + 20, event};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        char words[160];
        copy("cut.lcm", -1, ends[i]);
        compare("cut.lcm");
        assert_false(compared.different);
        assert_true(compared.incomplete);
        assert_in_range(compared.iterations, 8, 9);
        snprintf(words, sizeof words, "cut.lcm is cut off at byte %ld, the other goes on", event);
        if (strstr(compared.ended, words) == NULL)
            fail_msg("found \"%s\", expected \"%s\"", compared.ended, words);
        assert_int_equal(status_of_compare("cut.lcm"), 1);
    }
    copy("cut.lcm", place_of("FOVEA_POSE", 5, &bytes) + 30, data + 5000); /* and differs before */
    compare("cut.lcm");
    assert_true(compared.different);
    assert_int_equal(compared.sequence, 5);
}

static void what_is_damaged_is_refused_with_what_was_equal(void **state)
{
    struct fovea_error error = {0};
    char a[64];
    long bytes;
    (void)state;
    snprintf(a, sizeof a, "%s", path("a.lcm"));
    copy("damaged.lcm",
         place_of("FOVEA_FRAME", 9, &bytes) - FV_LCMLOG_HEADER_BYTES - (long)strlen("FOVEA_FRAME"),
         LONG_MAX); /* its sync word */
    assert_int_equal(fv_compare_recordings(a, path("damaged.lcm"), &compared, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "damaged.lcm: byte "));
    assert_in_range(compared.iterations, 8, 9);
    assert_int_equal(status_of_compare("damaged.lcm"), 2);
    assert_int_equal(status_of_compare("b.lcm"), 0);
}

static void what_is_no_recording_is_refused(void **state)
{
    struct fovea_error error = {0};
    (void)state;
    FILE *file = fopen(path("none.lcm"), "wb");
    assert_non_null(file);
    fclose(file);
    assert_int_equal(fv_compare_recordings(path("a.lcm"), path("none.lcm"), &compared, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "none.lcm: byte 0: found nothing"));
    copy("none.lcm", -1, 100); /* within its first event */
    assert_int_equal(fv_compare_recordings(path("a.lcm"), path("none.lcm"), &compared, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "none.lcm: byte 0: the event is cut off"));
    assert_int_equal(fv_compare_recordings(path("a.lcm"), path("absent.lcm"), &compared, &error),
                     FOVEA_ERROR_INPUT);
}

static int run_and_record(void **state)
{
    (void)state;
    run(NULL, NULL, &first);
    if (mkdtemp(folder) == NULL) return -1;
    record("a.lcm", "sim:orbit?width=320&height=240");
    record("b.lcm", "sim:orbit?width=320&height=240");
    return 0;
}

static int clean(void **state)
{
    char command[64];
    (void)state;
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command) == 0 ? 0 : -1;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_runs_are_equal_over_kernel_sets),
        cmocka_unit_test(a_flipped_bit_is_named_with_frame_and_stage),
        cmocka_unit_test(another_picture_is_a_difference_of_inputs),
        cmocka_unit_test(recordings_of_equal_runs_are_equal),
        cmocka_unit_test(an_edited_recording_is_named_by_frame_and_field),
        cmocka_unit_test(readings_of_clocks_are_left_out),
        cmocka_unit_test(other_inputs_are_named_as_such),
        cmocka_unit_test(a_recording_that_is_cut_off_is_compared_up_to_there),
        cmocka_unit_test(what_is_damaged_is_refused_with_what_was_equal),
        cmocka_unit_test(what_is_no_recording_is_refused),
    };
    return cmocka_run_group_tests(tests, run_and_record, clean);
}
