/* The loop on a source made for it: counting, pace, late frames, the end; and the shape of the JSON
 * about it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "app/run/heap.h"
#include "app/run/loop.h"
#include "app/run/report.h"
#include "drivers/clock.h"
#include "support/yaml_tree.h"

enum { SIDE = 64, FRAMES_MAX = 400 };

/* ---- a source -------------------------------------------------------------------------------- */

struct fovea_source {
    struct fovea_source_info info;
    int64_t stamps[FRAMES_MAX];
    int count, next, held;
    int64_t delay_ns; /* that a dequeue takes */
    enum fovea_status at_end;
    enum fovea_clock clock;
    int nothing; /* dequeues without a frame before each frame but the first */
    int asked;
    int pictures;     /* frames of a later number have none; 0: all have one */
    uint64_t dropped; /* by the source, with each frame */
    uint8_t pixels[SIDE * SIDE];
};

static struct fovea_source source;

static int64_t now_ns(void)
{
    int64_t wall, cpu;
    fv_timing_clock(NULL, &wall, &cpu);
    return wall;
}

static void pause_ns(int64_t ns)
{
    struct timespec time = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
    nanosleep(&time, NULL);
}

static const struct fovea_source_info *info(const struct fovea_source *from)
{
    return &from->info;
}

static enum fovea_status dequeue(struct fovea_source *from, int64_t deadline_ns,
                                 struct fovea_frame *frame)
{
    (void)deadline_ns;
    if (from->delay_ns > 0) pause_ns(from->delay_ns);
    if (from->next == from->count) return from->at_end;
    if (from->next > 0 && from->asked++ < from->nothing) return FOVEA_AGAIN;
    from->asked = 0;
    assert_true(from->held < FOVEA_SOURCE_FRAMES_HELD);
    from->held++;
    *frame = (struct fovea_frame){
        .image_count = 1,
        .images[0] = {from->pixels, SIDE, SIDE, SIDE, FOVEA_PIXEL_GREY8, sizeof from->pixels},
        .stamp_ns = from->stamps[from->next],
        .clock = from->clock,
        .sequence = (uint64_t)from->next,
    };
    if (from->pictures > 0 && from->next >= from->pictures) frame->images[0].data = NULL;
    from->next++;
    return FOVEA_OK;
}

static void requeue(struct fovea_source *from, const struct fovea_frame *frame)
{
    (void)frame;
    from->held--;
}

static void counts(const struct fovea_source *from, struct fovea_source_counts *counts)
{
    *counts = (struct fovea_source_counts){.dropped = from->dropped * (uint64_t)from->next};
}

static const struct fovea_source_ops ops = {
    .name = "made", .info = info, .dequeue = dequeue, .requeue = requeue, .counts = counts};

/* ---- a loop around it ------------------------------------------------------------------------ */

static struct fovea_config config;
static struct fv_timings timings;
static struct fv_loop_shared shared;
static struct fv_loop loop;
static void *memory;
static size_t bytes;

static int set_up(void **state)
{
    (void)state;
    struct fovea_error error;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = SIDE, .height = SIDE, .fx = 60, .fy = 60, .cx = 31.5, .cy = 31.5};
    config.preview.level = 0;
    config.features.pyramid_levels = 1;
    config.clock = fv_timing_clock;
    assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    memset(&source, 0, sizeof source);
    source.info =
        (struct fovea_source_info){.cameras[0] = {.width = SIDE, .height = SIDE}, .rate_hz = 100};
    source.at_end = FOVEA_END;
    source.clock = FOVEA_CLOCK_RECORDED;
    source.count = 100;
    for (int i = 0; i < FRAMES_MAX; i++)
        source.stamps[i] = 5000000000 + i * (int64_t)10000000;
    for (int i = 0; i < SIDE * SIDE; i++)
        source.pixels[i] = (uint8_t)((i * 7) ^ (i / SIDE * 13));
    fv_timings_init(&timings);
    memset(&shared, 0, sizeof shared);
    loop = (struct fv_loop){
        .config = &config, .ops = &ops, .source = &source, .timings = &timings, .shared = &shared};
    return fovea_init(memory, bytes, &config, &loop.rt, &error) != FOVEA_OK;
}

static int tear_down(void **state)
{
    (void)state;
    free(memory);
    return 0;
}

static void test_every_frame_at_full_speed(void **state)
{
    (void)state;
    source.stamps[10] = source.stamps[9]; /* repeats */
    source.stamps[20] = source.stamps[5]; /* goes back */
    fv_loop_run(&loop);
    assert_int_equal(loop.status, FOVEA_END);
    assert_int_equal(loop.counts.in, 100);
    assert_int_equal(loop.counts.processed, 98);
    assert_true(shared.images[0] == 98 && shared.images[1] == 0);
    assert_int_equal(loop.counts.refused, 2);
    assert_int_equal(loop.counts.late, 0);
    assert_int_equal(timings.step.cpu.count, 98);
    assert_int_equal(source.held, 0);
    assert_int_equal(loop.heap_calls, 0);
}

static void test_limits_and_failures(void **state)
{
    (void)state;
    loop.frames_max = 7;
    fv_loop_run(&loop);
    assert_int_equal(loop.counts.in, 7);
    assert_int_equal(loop.status, FOVEA_OK);
    loop.frames_max = 0;
    source.at_end = FOVEA_ERROR_SYSTEM;
    fv_loop_run(&loop);
    assert_int_equal(loop.counts.in, 93);
    assert_int_equal(loop.status, FOVEA_ERROR_SYSTEM);
    source.next = 0;
    atomic_store(&shared.stop, true);
    fv_loop_run(&loop);
    assert_int_equal(loop.counts.in, 0);
    assert_int_equal(loop.status, FOVEA_OK);
}

/* A hot machine: the governor has a shorter period, and frames are not late by it. */
static void test_share_of_the_period(void **state)
{
    (void)state;
    loop.real_time = true;
    source.count = 5;
    fv_loop_run(&loop);
    assert_int_equal(loop.governor.period_ns, loop.period_ns);
    atomic_store(&shared.share, 60);
    source.next = 0;
    fv_loop_run(&loop);
    assert_int_equal(loop.governor.period_ns, loop.period_ns / 100 * 60);
    assert_int_equal(loop.period_ns, 10000000);
}

static void test_pace_follows_stamps(void **state)
{
    (void)state;
    loop.real_time = true;
    source.count = 30;
    int64_t begin = now_ns();
    fv_loop_run(&loop);
    int64_t took = now_ns() - begin;
    assert_int_equal(loop.counts.in, 30);
    assert_true(took >= 290000000 - 1000000);
    /* Odd stamps neither stop nor hurry it. */
    begin = now_ns();
    source.next = 0;
    source.stamps[5] = INT64_MAX;
    source.stamps[6] = INT64_MIN;
    source.stamps[7] = source.stamps[4];
    source.count = 10;
    fv_loop_run(&loop);
    took = now_ns() - begin;
    assert_true(took >= 90000000 - 1000000);
    assert_int_equal(loop.counts.in, 10);
}

static void test_slow_source_drops_nothing(void **state)
{
    (void)state;
    loop.real_time = true;
    source.count = 20;
    source.delay_ns = 25000000; /* 40 Hz for frames of 100 Hz */
    fv_loop_run(&loop);
    assert_int_equal(loop.counts.processed + loop.counts.late, 20);
    assert_int_equal(loop.counts.late,
                     loop.counts.starved); /* 0 unless this machine stands still */
}

/* What happens in the middle of frame 10, or of the first that is processed after it: the loop
 * sleeps, or works for that much processor time.
 */
static bool busy, stalled;
static int64_t stall_ns;

static void stall(void *context, const struct fovea_inputs *inputs,
                  const struct fovea_outputs *outputs, const struct fovea_pose *pose)
{
    (void)context;
    (void)outputs;
    (void)pose;
    if (stalled || inputs->frame == NULL || inputs->frame->sequence < 10) return;
    stalled = true;
    if (!busy) pause_ns(stall_ns);
    const int64_t until_ns = fv_clock_ns(CLOCK_THREAD_CPUTIME_ID) + (busy ? stall_ns : 0);
    while (fv_clock_ns(CLOCK_THREAD_CPUTIME_ID) < until_ns) {
    }
}

static void run_stalled(int frames, int64_t ns, bool by_work)
{
    free(memory);
    assert_int_equal(set_up(NULL), 0);
    loop.real_time = true;
    loop.hooks.step_done = stall;
    source.count = frames;
    stalled = false;
    busy = by_work;
    stall_ns = ns;
    fv_loop_run(&loop);
    assert_int_equal(loop.counts.in, frames);
    assert_int_equal(loop.counts.processed + loop.counts.late, frames);
    assert_int_equal(timings.latency.count, loop.counts.processed);
}

/* Frames are dropped when more than four wait. Without any load on this machine none is where three
 * wait; where 16 wait, all but the last few are.
 */
static void test_late_frames(void **state)
{
    (void)state;
    run_stalled(40, 25000000, false);
    assert_int_equal(loop.counts.late, loop.counts.starved);
    run_stalled(80, 165000000, false);
    assert_true(loop.counts.late >= 10);
    assert_int_equal(loop.counts.starved, loop.counts.late); /* it was not the loop's work */
}

static void test_frames_late_by_the_loops_own_work(void **state)
{
    (void)state;
    run_stalled(40, 25000000, true);
    assert_int_equal(loop.counts.late, loop.counts.starved);
    /* Frame n is due 10 n ms later, and the work took 165 ms: 11 to 22 are late by over 40 ms. */
    run_stalled(80, 165000000, true);
    assert_true(loop.counts.late - loop.counts.starved >= 11);
    assert_true(loop.counts.late - loop.counts.starved <= 24); /* a slow machine's steps count */
}

static struct {
    uint32_t framed, without, wrong;
    clockid_t clock;
} told;

/* Times are those of the frames' clock, and its offset leads to UTC. */
static void times_check(void *context, const struct fovea_inputs *inputs,
                        const struct fovea_outputs *outputs, const struct fovea_pose *pose)
{
    const int64_t hour_ns = 3600 * FV_SECOND_NS; /* the clocks are years apart */
    const int64_t off_ns = fv_clock_ns(told.clock) - inputs->now_ns,
                  utc_off_ns = fv_clock_ns(CLOCK_REALTIME) - inputs->now_ns - inputs->utc_offset_ns;
    (void)context;
    (void)outputs;
    (void)pose;
    if (inputs->frame != NULL) {
        told.framed++;
        told.wrong += told.clock == CLOCK_REALTIME && inputs->utc_offset_ns != 0;
        return;
    }
    told.without++;
    told.wrong += off_ns < -hour_ns || off_ns > hour_ns;
    told.wrong += utc_off_ns < -hour_ns || utc_off_ns > hour_ns;
}

static void test_steps_without_a_frame_are_on_the_frames_clock(void **state)
{
    static const struct {
        enum fovea_clock clock;
        clockid_t of;
    } rows[] = {{FOVEA_CLOCK_MONOTONIC, CLOCK_MONOTONIC},
                {FOVEA_CLOCK_BOOTTIME, CLOCK_BOOTTIME},
                {FOVEA_CLOCK_REALTIME, CLOCK_REALTIME}};
    (void)state;
    source.info.live = true;
    source.nothing = 2;
    loop.hooks.step_done = times_check;
    for (int r = 0; r < 3; r++) {
        const int64_t begin_ns = fv_clock_ns(rows[r].of);
        memset(&told, 0, sizeof told);
        told.clock = rows[r].of;
        source.clock = rows[r].clock;
        source.next = source.asked = 0;
        source.count = 5;
        for (int i = 0; i < 5; i++)
            source.stamps[i] = begin_ns + i * (int64_t)10000000;
        fv_loop_run(&loop);
        assert_int_equal(told.framed, 5);
        assert_int_equal(told.without, 4 * 2);
        assert_int_equal(told.wrong, 0);
        assert_int_equal(loop.counts.without_frame, 8);
    }
}

static void grab(void *context, const struct fovea_inputs *inputs,
                 const struct fovea_outputs *outputs, const struct fovea_pose *pose)
{
    void *volatile piece = malloc(16);
    (void)context;
    (void)inputs;
    (void)outputs;
    (void)pose;
    free(piece);
}

static void test_planted_heap_call_is_counted(void **state)
{
    (void)state;
    if (!fv_heap_counted()) {
        print_message("heap counting SKIPPED: this build has a sanitizer's allocator\n");
        return;
    }
    loop.hooks.step_done = grab;
    fv_loop_run(&loop);
    assert_int_equal(loop.heap_calls, 200);
}

/* ---- JSON, which is YAML too ----------------------------------------------------------------- */

static int64_t whole(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node,
                     const char *key)
{
    struct fovea_error error;
    const struct fv_yaml_node *child;
    int64_t value = -1;
    if (fv_yaml_require(tree, node, key, &child, &error) != FOVEA_OK) fail_msg("%s", error.text);
    if (fv_yaml_integer(tree, child, 0, INT64_MAX, &value, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return value;
}

static void assert_times(const struct fv_yaml_tree *tree, const struct fv_yaml_node *node)
{
    static const char *const prefixes[] = {"", "wall_"};
    assert_non_null(node);
    for (int i = 0; i < 2; i++) {
        char key[32];
        snprintf(key, sizeof key, "%smean_ns", prefixes[i]);
        int64_t mean = whole(tree, node, key);
        snprintf(key, sizeof key, "%sp50_ns", prefixes[i]);
        int64_t p50 = whole(tree, node, key);
        snprintf(key, sizeof key, "%sp99_ns", prefixes[i]);
        int64_t p99 = whole(tree, node, key);
        snprintf(key, sizeof key, "%smax_ns", prefixes[i]);
        int64_t max = whole(tree, node, key);
        assert_true(p50 <= p99 && p99 <= max && mean <= max);
    }
}

static void test_json(void **state)
{
    (void)state;
    char *text = NULL;
    size_t text_bytes = 0;
    struct fovea_error error;
    struct fv_yaml_tree *tree;
    fv_loop_run(&loop);
    struct fv_report report = {.source = "made:\"up\"\n\\",
                               .kernel_set = "c",
                               .width = SIDE,
                               .height = SIDE,
                               .loop = &loop,
                               .part_bytes = {1, 2, 3},
                               .block_bytes = 6,
                               .resident_bytes = 7,
                               .anonymous_bytes = 5};
    FILE *file = open_memstream(&text, &text_bytes);
    fv_report_json(file, &report);
    fclose(file);
    if (fv_yaml_parse("json", text, text_bytes, &tree, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    const struct fv_yaml_node *frames = fv_yaml_child(tree->root, "frames");
    assert_int_equal(whole(tree, frames, "in"), 100);
    assert_int_equal(whole(tree, frames, "processed"), 100);
    assert_int_equal(whole(tree, frames, "dropped"), 0);
    assert_int_equal(whole(tree, frames, "posed"), 0);
    assert_int_equal(whole(tree, frames, "lost"), 0);
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++)
        assert_times(tree, fv_yaml_child(fv_yaml_child(tree->root, "stages"), fovea_stage_name(i)));
    assert_times(tree, fv_yaml_child(tree->root, "step"));
    assert_times(tree, fv_yaml_child(tree->root, "work"));
    assert_times(tree, fv_yaml_child(tree->root, "frame"));
    const struct fv_yaml_node *parts = fv_yaml_child(tree->root, "memory");
    assert_int_equal(whole(tree, parts, "persistent"), 1);
    assert_int_equal(whole(tree, parts, "job"), 2);
    assert_int_equal(whole(tree, parts, "frame"), 3);
    assert_int_equal(whole(tree, parts, "resident_bytes"), 7);
    assert_int_equal(whole(tree, parts, "anonymous_bytes"), 5);
    if (fv_heap_counted()) assert_int_equal(whole(tree, tree->root, "heap_calls_after_init"), 0);
    assert_string_equal(fv_yaml_child(tree->root, "source")->value, report.source);
    fv_yaml_free(tree);
    free(text);
}

/* What a camera loses while the loop is busy is the loop's loss as well. */
static void test_losses_of_a_camera(void **state)
{
    (void)state;
    source.info.live = true;
    source.dropped = 2;
    source.pictures = 40;
    source.stamps[20] = source.stamps[5]; /* refused */
    fv_loop_run(&loop);
    assert_int_equal(shared.frames, 100);
    assert_int_equal(shared.pictures, 39);
    assert_int_equal(shared.dropped, 200);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_every_frame_at_full_speed, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_limits_and_failures, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_share_of_the_period, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_pace_follows_stamps, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_slow_source_drops_nothing, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_late_frames, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_frames_late_by_the_loops_own_work, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_losses_of_a_camera, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_steps_without_a_frame_are_on_the_frames_clock, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(test_planted_heap_call_is_counted, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_json, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
