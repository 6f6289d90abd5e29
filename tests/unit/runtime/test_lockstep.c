/* Hashes of each iteration (lockstep_t): the same on every kernel set with every job at work, other
 * ones where any input or state differs, and none of what clocks and processes measure. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/hash.h"
#include "common/job_switch.h"
#include "common/sim_rig.h"
#include "nn/model.h"
#include "runtime/ready_map.h"
#include "runtime/state.h"

#include "fovea_lockstep_t.h"

enum { FRAMES = 12 };

static struct sim_rig rig;

/* ---- what is sent ---------------------------------------------------------------------------- */

static void decode(fovea_lockstep_t *message)
{
    const struct fovea_message *found = NULL;
    for (uint32_t i = 0; i < rig.work.message_count; i++)
        if (strstr(rig.work.messages[i].channel, "LOCKSTEP") != NULL) found = &rig.work.messages[i];
    if (found == NULL) {
        memset(message, 0, sizeof *message);
        fail_msg("no LOCKSTEP was sent");
        return;
    }
    assert_int_equal(fovea_lockstep_t_decode(found->data, 0, (int)found->bytes, message),
                     found->bytes);
}

static void open_with_all_jobs(void)
{
    sim_rig_open_kept(&rig, "sim:orbit?width=320&height=240", 0, FRAMES);
    rig.config.lockstep_every = 1;
    rig.config.edge_job.segments = true;
    rig.config.image.preprocess.operations.count = FOVEA_OPERATION_WHITE_BALANCE;
    for (int i = 0; i < FOVEA_OPERATION_WHITE_BALANCE; i++)
        rig.config.image.preprocess.operations.items[i] = (enum fovea_operation)i;
    assert_true(job_switch_all(&rig.config, 3));
}

static void expect_equal(const fovea_lockstep_t *first, const fovea_lockstep_t *found,
                         const char *set, int frame)
{
    assert_int_equal(found->stage_count, first->stage_count);
    assert_int_equal(found->message_count, first->message_count);
    for (int32_t i = 0; i < first->stage_count; i++)
        if (first->stages[i].hash != found->stages[i].hash)
            fail_msg("frame %d: %s: other state of %s", frame, set, first->stages[i].name);
    for (int32_t i = 0; i < first->message_count; i++)
        if (first->messages[i].hash != found->messages[i].hash)
            fail_msg("frame %d: %s: another %s", frame, set, first->messages[i].name);
    assert_true(found->inputs_hash == first->inputs_hash && found->state_hash == first->state_hash);
}

static void every_kernel_set_gives_the_same_hashes(void **state)
{
    static const char *const sets[] = {"c", "sse4", "avx2", "avx512", "neon", "dotprod", "i8mm"};
    static fovea_lockstep_t first[FRAMES];
    int compared = 0;
    (void)state;
    for (size_t i = 0; i < sizeof sets / sizeof sets[0]; i++) {
        struct fovea_error error;
        size_t bytes;
        setenv("FOVEA_CPU", sets[i], 1);
        open_with_all_jobs();
        if (fovea_size(&rig.config, &bytes, &error)) fail_msg("%s", error.text);
        void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
        const bool there = fovea_init(memory, bytes, &rig.config, &rig.rt, &error) == FOVEA_OK;
        for (int n = 0; there && sim_rig_next(&rig); n++) {
            fovea_lockstep_t found;
            sim_rig_process(&rig);
            decode(compared == 0 ? &first[n] : &found);
            if (compared == 0) continue;
            expect_equal(&first[n], &found, sets[i], n);
            fovea_lockstep_t_decode_cleanup(&found);
        }
        compared += there;
        rig.rt = memory;
        sim_rig_close(&rig);
    }
    unsetenv("FOVEA_CPU");
    for (int n = 0; n < FRAMES; n++)
        fovea_lockstep_t_decode_cleanup(&first[n]);
    assert_true(compared > 1);
}

/* No byte that lives from step to step is left out. */
static void all_of_the_state_is_hashed(void **state)
{
    size_t bytes[FOVEA_MEMORY_PART_COUNT] = {0};
    (void)state;
    open_with_all_jobs();
    sim_rig_build(&rig);
    const struct fv_lockstep *lockstep = &rig.rt->lockstep;
    for (uint32_t i = 0; i < lockstep->part_count; i++) {
        const struct fv_lockstep_part *part = &lockstep->parts[i];
        assert_int_equal(part->from, bytes[part->part]); /* one behind the other */
        bytes[part->part] += part->bytes;
    }
    assert_int_equal(bytes[FOVEA_MEMORY_PERSISTENT], rig.rt->part_bytes[FOVEA_MEMORY_PERSISTENT]);
    assert_int_equal(bytes[FOVEA_MEMORY_JOB], rig.rt->part_bytes[FOVEA_MEMORY_JOB]);
    assert_int_equal(bytes[FOVEA_MEMORY_FRAME], 0);
    sim_rig_close(&rig);
}

/* ---- what clocks and processes measure ------------------------------------------------------- */

/* Other readings with every frame. */
static void measure(struct fovea_inputs *inputs, int64_t n)
{
    inputs->latency_ns = 100 + 7 * n;
    inputs->utc_offset_ns = INT64_C(1790000000000000000) + 13 * n;
    inputs->frames_late = (uint64_t)n;
    inputs->resident_bytes = 1000000 + (uint64_t)n;
    inputs->temperature_c = 40 + (float)n;
}

/* With two networks, free space and every job. */
static void run_measured(bool measured, fovea_lockstep_t *messages)
{
    static const double T_body_cam[12] = {0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0.8};
    open_with_all_jobs();
    rig.config.scale.allow_unscaled = true;
    rig.config.detect2 = rig.config.detect;
    rig.config.detect.model = detector_as_segmenter(&rig.config.detect.model_bytes);
    assert_non_null(rig.config.detect.model);
    memcpy(rig.config.rig.cameras[0].T_body_cam, T_body_cam, sizeof T_body_cam);
    rig.config.grid_job.enabled = true;
    memset(rig.config.grid_job.labels, FOVEA_GRID_FLOOR, sizeof rig.config.grid_job.labels);
    sim_rig_build(&rig);
    for (int n = 0; sim_rig_next(&rig); n++) {
        if (measured) measure(&rig.inputs, n);
        /* So few frames have no pose in metres, with which the grid is updated. */
        rig.rt->free_space.state->frame.utc_offset_ns = rig.inputs.utc_offset_ns;
        sim_rig_process(&rig);
        decode(&messages[n]);
    }
    assert_int_equal(rig.frames, FRAMES);
    sim_rig_close(&rig);
}

static bool was_sent(const fovea_lockstep_t *messages, const char *channel)
{
    for (int n = 0; n < FRAMES; n++)
        for (int32_t i = 0; i < messages[n].message_count; i++)
            if (strcmp(messages[n].messages[i].name, channel) == 0) return true;
    return false;
}

static void readings_of_clocks_are_in_no_hash(void **state)
{
    static const char *const channels[] = {
        "POSE",        "CAMERA_POSE",  "BOT_CORE_POSE", "FEATURES", "PREVIEW",
        "DETECTIONS2", "SEGMENTATION", "CAMERA_STATUS", "MAP",      "EDGES"};
    static fovea_lockstep_t quiet[FRAMES], measured[FRAMES];
    (void)state;
    run_measured(false, quiet);
    run_measured(true, measured);
    for (size_t i = 0; i < sizeof channels / sizeof channels[0]; i++)
        if (!was_sent(quiet, channels[i])) fail_msg("no %s was sent", channels[i]);
    for (int n = 0; n < FRAMES; n++) {
        expect_equal(&quiet[n], &measured[n], "other readings of clocks", n);
        fovea_lockstep_t_decode_cleanup(&quiet[n]);
        fovea_lockstep_t_decode_cleanup(&measured[n]);
    }
}

/* ---- inputs ---------------------------------------------------------------------------------- */

enum change {
    NOTHING,
    LATENCY,
    UTC,
    LATE,
    RESIDENT,
    TEMPERATURE,
    COMMAND,
    MAP,
    GRANTS,
    STAMP,
    PIXEL
};

static int64_t inputs_hash(enum change change)
{
    static uint8_t pixels[320 * 240];
    fovea_lockstep_t message;
    sim_rig_open_kept(&rig, "sim:orbit?width=320&height=240", 0, 1);
    rig.config.lockstep_every = 1;
    sim_rig_build(&rig);
    assert_true(sim_rig_next(&rig));
    struct fovea_inputs *inputs = &rig.inputs;
    struct fovea_frame frame = rig.frame;
    inputs->frame = &frame;
    const struct fovea_sample sample = {.kind = FOVEA_SAMPLE_WHEEL_ODOMETRY};
    inputs->samples = &sample;
    inputs->sample_count = 1;
    if (change == LATENCY) inputs->latency_ns = 1234;
    if (change == UTC) inputs->utc_offset_ns = 1234;
    if (change == LATE) inputs->frames_late = 3;
    if (change == RESIDENT) inputs->resident_bytes = 1234;
    if (change == TEMPERATURE) inputs->temperature_c = 50;
    if (change == COMMAND) inputs->commands = FOVEA_COMMAND_RESET;
    const struct fovea_ready_map map = {.hash = 1}; /* of other limits: hashed, and left */
    if (change == MAP) inputs->map = &map;
    if (change == STAMP) frame.stamp_ns++;
    if (change == PIXEL) {
        for (int y = 0; y < 240; y++)
            memcpy(pixels + 320 * y,
                   (const uint8_t *)frame.images[0].data + y * frame.images[0].stride_bytes, 320);
        pixels[777] ^= 1;
        frame.images[0].data = pixels;
        frame.images[0].stride_bytes = 320;
    }
    (void)fovea_step(rig.rt, inputs, &rig.outputs);
    struct fovea_grants grants = inputs->grants;
    if (change == GRANTS) grants.units[FOVEA_JOB_DETECT]++;
    (void)fovea_work(rig.rt, &grants, &rig.work);
    decode(&message);
    const int64_t hash = message.inputs_hash;
    fovea_lockstep_t_decode_cleanup(&message);
    rig.ops->requeue(rig.source, &rig.frame);
    sim_rig_close(&rig);
    return hash;
}

static void inputs_are_hashed_and_measured_times_are_not(void **state)
{
    (void)state;
    const int64_t hash = inputs_hash(NOTHING);
    for (int change = LATENCY; change <= TEMPERATURE; change++)
        if (inputs_hash((enum change)change) != hash) fail_msg("change %d is seen", change);
    for (int change = COMMAND; change <= PIXEL; change++)
        if (inputs_hash((enum change)change) == hash) fail_msg("change %d is not seen", change);
}

/* ---- the hash -------------------------------------------------------------------------------- */

/* Any two flipped bits, in whatever words: also the signs of two numbers. */
static void two_flipped_bits_do_not_cancel(void **state)
{
    enum { WORDS = 16 };
    double numbers[WORDS];
    uint64_t words[WORDS];
    (void)state;
    for (int i = 0; i < WORDS; i++)
        numbers[i] = 0.37 * i + 1;
    const uint64_t hash = fv_hash_state(FV_HASH_START, numbers, sizeof numbers);
    for (int a = 0; a < WORDS * 64; a++) {
        for (int b = 0; b < a; b++) {
            memcpy(words, numbers, sizeof words);
            words[a / 64] ^= UINT64_C(1) << a % 64;
            words[b / 64] ^= UINT64_C(1) << b % 64;
            if (fv_hash_state(FV_HASH_START, words, sizeof words) == hash)
                fail_msg("bits %d and %d cancel", b, a);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kernel_set_gives_the_same_hashes),
        cmocka_unit_test(all_of_the_state_is_hashed),
        cmocka_unit_test(readings_of_clocks_are_in_no_hash),
        cmocka_unit_test(inputs_are_hashed_and_measured_times_are_not),
        cmocka_unit_test(two_flipped_bits_do_not_cancel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
