/* Live parameters: a run that is given values before its first frame sends what a run does that was
 * started with them; values that are wrong, or that need other memory, are refused whole; a copy of
 * the runtime goes on with what is in force. */
#include <setjmp.h>
#include <stdarg.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "base/hash.h"
#include "common/detector.h"
#include "common/sim_rig.h"
#include "runtime/config.h"
#include "runtime/state.h"

enum { WIDTH = 320, HEIGHT = 240, FRAMES = 36, SEEDS = 6, CHANGE_AT = 15, COPY_AT = 18 };

static struct sim_rig rig;
static uint8_t pixels[FRAMES][WIDTH * HEIGHT];
static int64_t stamps[FRAMES];
static struct fovea_config started; /* with memory for everything that the tests change */
static struct fovea_error error;

static int setup(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=320&height=240", 0, FRAMES);
    sim_rig_build(&rig);
    for (int i = 0; i < FRAMES && sim_rig_next(&rig); i++) {
        memcpy(pixels[i], rig.frame.images[0].data, sizeof pixels[i]);
        stamps[i] = rig.frame.stamp_ns;
        sim_rig_process(&rig);
    }
    if (rig.frames != FRAMES) return -1;
    started = rig.config;
    started.detect.model = detector_model(&started.detect.model_bytes);
    started.detect.score_threshold = .05;
    started.preview.period_frames = 2;
    started.edge_job.period_frames = 2;
    started.edge_job.segments = true;
    started.image.preprocess.operations.count = 2;
    started.image.preprocess.operations.items[0] = FOVEA_OPERATION_CONTRAST_ENHANCEMENT;
    started.image.preprocess.operations.items[1] = FOVEA_OPERATION_SHARPEN;
    return started.detect.model == NULL ? -1 : 0;
}

static int teardown(void **state)
{
    (void)state;
    sim_rig_close(&rig);
    return 0;
}

/* ---- runs ------------------------------------------------------------------------------------ */

/* Messages of each frame, its step and its work. */
struct sent {
    uint64_t hash[FRAMES];
    uint64_t edges, detections; /* messages of the run */
};

struct run {
    struct fovea *rt;
    void *memory;
    size_t bytes;
};

static struct run run_start(const struct fovea_config *config)
{
    struct run run;
    assert_int_equal(fovea_size(config, &run.bytes, &error), FOVEA_OK);
    run.memory = aligned_alloc(64, (run.bytes + 63) / 64 * 64);
    assert_non_null(run.memory);
    assert_int_equal(fovea_init(run.memory, run.bytes, config, &run.rt, &error), FOVEA_OK);
    return run;
}

static void note(struct sent *sent, int number, const struct fovea_outputs *outputs)
{
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        const struct fovea_message *message = &outputs->messages[i];
        uint64_t *hash = &sent->hash[number];
        *hash = fv_hash(*hash, message->channel, strlen(message->channel) + 1);
        if (strcmp(message->channel, "FOVEA_STATISTICS") != 0) /* it states the size of the block */
            *hash = fv_hash(*hash, message->data, message->bytes);
        sent->edges += strcmp(message->channel, "FOVEA_EDGES") == 0;
        sent->detections += strcmp(message->channel, "FOVEA_DETECTIONS") == 0;
    }
}

static void one_frame(struct run *run, int number, const struct fovea_config *parameters,
                      struct sent *sent)
{
    struct fovea_outputs outputs;
    struct fovea_frame frame = {.stamp_ns = stamps[number],
                                .sequence = (uint64_t)number,
                                .image_count = 1,
                                .images = {{.data = pixels[number],
                                            .width = WIDTH,
                                            .height = HEIGHT,
                                            .stride_bytes = WIDTH,
                                            .format = FOVEA_PIXEL_GREY8,
                                            .size_bytes = WIDTH * HEIGHT}}};
    struct fovea_inputs inputs = {
        .frame = &frame, .now_ns = frame.stamp_ns, .parameters = parameters};
    fovea_grants_fixed(&started, &inputs.grants);
    inputs.grants.units[FOVEA_JOB_EDGES] = 20; /* an image takes frames, also that of a copy */
    sent->hash[number] = FV_HASH_START;
    assert_int_equal(fovea_step(run->rt, &inputs, &outputs), FOVEA_OK);
    note(sent, number, &outputs);
    fovea_work(run->rt, &inputs.grants, &outputs);
    note(sent, number, &outputs);
}

/* A run of all frames that is given `parameters` with frame `at`; from frame `copy_at` on by a copy
 * of its block. */
static void run_all(const struct fovea_config *config, const struct fovea_config *parameters,
                    int at, int copy_at, struct sent *sent)
{
    struct run run = run_start(config);
    memset(sent, 0, sizeof *sent);
    for (int i = 0; i < FRAMES; i++) {
        if (i == copy_at) {
            void *second = aligned_alloc(64, (run.bytes + 63) / 64 * 64);
            assert_non_null(second);
            assert_int_equal(fovea_copy(run.rt, second, run.bytes, &run.rt), FOVEA_OK);
            memset(run.memory, 0xa5, run.bytes);
            free(run.memory);
            run.memory = second;
        }
        one_frame(&run, i, i == at ? parameters : NULL, sent);
    }
    free(run.memory);
}

/* ---- values ---------------------------------------------------------------------------------- */

struct row {
    const char *name;
    enum fv_config_kind kind;
    bool live;
    size_t offset, bytes;
    double min, max, value;
};

#define identity 0
#define ROW(name, kind, live, member, min, max, value)                                             \
    {name,                                                                                         \
     FV_CONFIG_##kind,                                                                             \
     live,                                                                                         \
     offsetof(struct fovea_config, member),                                                        \
     sizeof(((struct fovea_config *)0)->member),                                                   \
     (double)(min),                                                                                \
     (double)(max),                                                                                \
     value},
#define VALUE_REAL(value) value
#define VALUE_U32(value) value
#define VALUE_U64(value) value
#define VALUE_BOOL(value) value
#define VALUE_CHOICE(value) value
#define VALUE_FLAGS(value) value
#define VALUE_LIST(value) value
#define VALUE_TRANSFORM(value) 0
#define VALUE_TEXT(value) 0

static const struct row rows[] = {
#define FV_KEY(name, kind, member, min, max, value, unit, words, cost, help)                       \
    ROW(name, kind, false, member, min, max, VALUE_##kind(value))
#define FV_LIVE_KEY(name, kind, member, min, max, value, unit, words, cost, help)                  \
    ROW(name, kind, true, member, min, max, VALUE_##kind(value))
#include "runtime/config.def"
};
enum { ROWS = sizeof rows / sizeof rows[0] };

/* A value at random, not too far from the default, so that the run still sees something. */
static void vary(struct fovea_config *config, const struct row *row, struct fv_random *random)
{
    char *at = (char *)config + row->offset;
    const double span = row->max - row->min, near = 2 * row->value + 3;
    const double reach = span < near ? span : near;
    const double value = row->min + fv_random_unit(random) * reach;
    const uint32_t whole = (uint32_t)value;
    const bool truth = fv_random_below(random, 2) != 0;
    uint32_t list[1 + FOVEA_OPERATIONS_MAX] = {1 + fv_random_below(random, 4)};
    for (uint32_t i = 1; i <= list[0]; i++)
        list[i] = fv_random_below(random, FOVEA_OPERATION_WHITE_BALANCE);
    if (row->kind == FV_CONFIG_REAL) memcpy(at, &value, sizeof value);
    if (row->kind == FV_CONFIG_BOOL) memcpy(at, &truth, sizeof truth);
    if (row->kind == FV_CONFIG_U32 || row->kind == FV_CONFIG_CHOICE) memcpy(at, &whole, 4);
    if (row->kind == FV_CONFIG_LIST) memcpy(at, list, (1 + list[0]) * sizeof list[0]);
}

/* Values for all live parameters but the most features, on which the grid of features depends. */
static void vary_all(const struct fovea *rt, struct fovea_config *config, struct fv_random *random)
{
    *config = started;
    for (int i = 0; i < ROWS; i++) {
        struct fovea_config tried;
        if (!rows[i].live || strcmp(rows[i].name, "features.count_max") == 0) continue;
        for (int tries = 0; tries < 1000; tries++) {
            tried = *config;
            vary(&tried, &rows[i], random);
            if (fovea_parameters_check(rt, &tried, NULL) == FOVEA_OK) {
                *config = tried;
                break;
            }
        }
    }
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void test_values_taken_before_the_first_frame_are_those_of_a_start(void **state)
{
    (void)state;
    struct fv_random random;
    struct fovea_config varied;
    struct sent by_start, by_change, unchanged;
    struct run run = run_start(&started);
    uint64_t edges = 0, detections = 0;
    int different = 0;
    run_all(&started, NULL, -1, -1, &unchanged);
    fv_random_seed(&random, 11);
    for (int seed = 0; seed < SEEDS; seed++) {
        vary_all(run.rt, &varied, &random);
        varied.detect.enabled = seed % 2 == 0;
        varied.edge_job.period_frames = 1 + (uint32_t)seed % 3;
        run_all(&varied, NULL, -1, -1, &by_start);
        run_all(&started, &varied, 0, COPY_AT + seed % 3, &by_change);
        for (int i = 0; i < FRAMES; i++)
            assert_int_equal(by_change.hash[i], by_start.hash[i]);
        different += memcmp(by_change.hash, unchanged.hash, sizeof unchanged.hash) != 0;
        edges += by_change.edges;
        detections += by_change.detections;
        assert_true((by_change.detections > 0) == varied.detect.enabled);
    }
    assert_int_equal(different, SEEDS);
    assert_true(edges > 0 && detections > 0);
    free(run.memory);
}

static void test_values_hold_from_their_step_on_and_in_copies(void **state)
{
    (void)state;
    struct sent plain, changed, copied, back;
    struct fovea_config other = started;
    other.features.threshold_min = other.features.threshold = 40;
    other.features.count_max = 300;
    other.edge_job.edges.low = 20;
    other.image.preprocess.operations.count = 0;
    other.detect.score_threshold = .9;
    run_all(&started, NULL, -1, -1, &plain);
    run_all(&started, &other, CHANGE_AT, -1, &changed);
    run_all(&started, &other, CHANGE_AT, COPY_AT, &copied);
    run_all(&started, &started, CHANGE_AT, -1, &back);
    for (int i = 0; i < FRAMES; i++) {
        assert_int_equal(back.hash[i], plain.hash[i]);
        assert_int_equal(copied.hash[i], changed.hash[i]);
        if (i < CHANGE_AT)
            assert_int_equal(changed.hash[i], plain.hash[i]);
        else
            assert_int_not_equal(changed.hash[i], plain.hash[i]);
    }
}

/* Each alone, so that no other hides that it has no effect. */
static void test_every_stage_takes_its_values(void **state)
{
    (void)state;
    enum { CHANGED = 7 };
    struct fovea_config alone[CHANGED];
    struct sent plain, changed;
    for (int i = 0; i < CHANGED; i++)
        alone[i] = started;
    alone[0].preview.period_frames = 3;
    alone[1].features.per_cell = 6;
    alone[2].detect.score_threshold = .9;
    alone[3].image.preprocess.sharpen_amount = 4;
    alone[4].image.preprocess.contrast_limit = 8;
    alone[5].edge_job.edges.low = alone[5].edge_job.edges.high = 20;
    alone[6].preview.quality = 5;
    run_all(&started, NULL, -1, -1, &plain);
    for (int i = 0; i < CHANGED; i++) {
        run_all(&started, &alone[i], CHANGE_AT, -1, &changed);
        if (memcmp(&plain, &changed, sizeof plain) == 0) fail_msg("change %d has no effect", i);
    }
    /* What shows only in frames that are nearly lost. */
    struct run run = run_start(&started);
    started.odometry.inliers_good = 123;
    started.odometry.lost_frames_reset = 45;
    one_frame(&run, 0, &started, &changed);
    assert_int_equal(run.rt->odometry.config.inliers_good, 123);
    assert_int_equal(run.rt->odometry.config.lost_frames_reset, 45);
    started.odometry = rig.config.odometry;
    free(run.memory);
}

static void refuses(const struct fovea_config *config, enum fovea_status status, const char *word)
{
    struct sent plain, refused;
    struct run run = run_start(&started);
    struct fovea_config before = *fovea_config_get(run.rt);
    assert_int_equal(fovea_parameters_check(run.rt, config, &error), status);
    assert_non_null(strstr(error.text, word));
    assert_non_null(strstr(error.text, "expected"));
    memset(&plain, 0, sizeof plain);
    memset(&refused, 0, sizeof refused);
    one_frame(&run, 0, NULL, &plain);
    one_frame(&run, 1, config, &refused);
    assert_memory_equal(&before, fovea_config_get(run.rt), sizeof before);
    free(run.memory);
}

static void test_wrong_values_are_refused_whole(void **state)
{
    (void)state;
    struct fovea_config wrong = started;
    wrong.features.threshold_min = 50; /* above the threshold of 20 */
    wrong.preview.quality = 40;        /* right, and not taken either */
    refuses(&wrong, FOVEA_ERROR_ARGUMENT, "features.threshold_min: found 50");
    wrong = started;
    wrong.preview.quality = 101;
    refuses(&wrong, FOVEA_ERROR_ARGUMENT, "preview.quality: found 101");
    wrong = started;
    wrong.image.preprocess.gamma = (double)NAN;
    refuses(&wrong, FOVEA_ERROR_ARGUMENT, "image.gamma");
    wrong = started;
    wrong.image.preprocess.operations.count = FOVEA_OPERATIONS_MAX + 1;
    refuses(&wrong, FOVEA_ERROR_ARGUMENT, "image.operations");
    wrong = started;
    wrong.image.preprocess.operations.items[0] = (enum fovea_operation)77;
    refuses(&wrong, FOVEA_ERROR_ARGUMENT, "image.operations: found operation 77");
    wrong = started;
    wrong.image.preprocess.denoise_size = 4;
    refuses(&wrong, FOVEA_ERROR_ARGUMENT, "image.denoise_size");
}

static void test_values_that_need_memory_of_the_start_are_refused(void **state)
{
    (void)state;
    const struct fovea_config all = started;
    struct fovea_config wrong = started;
    wrong.features.count_max++;
    refuses(&wrong, FOVEA_ERROR_UNSUPPORTED, "features.count_max");
    wrong = started;
    wrong.detect.count_max++;
    refuses(&wrong, FOVEA_ERROR_UNSUPPORTED, "detect.count_max");
    started.preview.period_frames = 0;
    refuses(&all, FOVEA_ERROR_UNSUPPORTED, "preview.period_frames");
    started = all;
    started.edge_job.period_frames = 0;
    refuses(&all, FOVEA_ERROR_UNSUPPORTED, "edges.period_frames");
    started = all;
    started.image.preprocess.operations.items[0] = FOVEA_OPERATION_DENOISE;
    refuses(&all, FOVEA_ERROR_UNSUPPORTED, "image.operations: found contrast_enhancement");
    started.image.preprocess.operations.count = 0;
    refuses(&all, FOVEA_ERROR_UNSUPPORTED, "image.operations: found 2");
    started = all;
}

/* Members that are no live parameters are not looked at. */
static void test_other_members_do_not_change(void **state)
{
    (void)state;
    struct sent plain, changed;
    struct fovea_config other = started;
    other.seed = 77;
    other.features.pyramid_levels = 3;
    other.odometry.keyframes = 5000;
    other.rig.cameras[0].camera.fx = -1;
    strcpy(other.channel_prefix, "?");
    run_all(&started, NULL, -1, -1, &plain);
    run_all(&started, &other, CHANGE_AT, -1, &changed);
    assert_memory_equal(plain.hash, changed.hash, sizeof plain.hash);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values_taken_before_the_first_frame_are_those_of_a_start),
        cmocka_unit_test(test_values_hold_from_their_step_on_and_in_copies),
        cmocka_unit_test(test_every_stage_takes_its_values),
        cmocka_unit_test(test_wrong_values_are_refused_whole),
        cmocka_unit_test(test_values_that_need_memory_of_the_start_are_refused),
        cmocka_unit_test(test_other_members_do_not_change),
    };
    return cmocka_run_group_tests_name("parameters", tests, setup, teardown);
}
