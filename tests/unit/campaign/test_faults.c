/* The campaign's own judging: a runtime that gives nothing, or no numbers, misses its bars; a
 * record of another program, or a torn line of it, is not believed; a process that sleeps for ever
 * is found, also when it has already given its result. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "../../campaign/faults/child.h"
#include "../../campaign/faults/judge.h"
#include "../../campaign/faults/plan.h"
#include "../../campaign/faults/record.h"
#include "../../campaign/faults/report.h"

enum { FRAMES = 60 };
static struct faults_play play;
static double nees[FAULTS_GIVEN_MAX];
static const struct faults_plan no_fault = {.count = 0};

static void stand_at(double T[12], double x, double y)
{
    const double at[12] = {1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, 0};
    memcpy(T, at, sizeof at);
}

/* A walk with the truth for its poses; every tenth frame is a keyframe. */
static void walk(enum fovea_scale_source scale)
{
    memset(&play, 0, sizeof play);
    play.count = FRAMES;
    for (int i = 0; i < FRAMES; i++) {
        struct faults_frame *frame = &play.frame[i];
        struct fovea_pose *pose = &frame->pose;
        const int keyframe = i / 10 * 10;
        frame->index = (uint64_t)i;
        frame->stamp_ns = i * INT64_C(33000000);
        frame->image = frame->processed = frame->has_truth = true;
        stand_at(frame->truth, 0.1 * i, 0.002 * i * i);
        pose->state = FOVEA_TRACKING_OK;
        pose->posed = true;
        pose->scale_source = scale;
        pose->scale = pose->map_scale = 1;
        pose->keyframe_stamp_ns = keyframe * INT64_C(33000000);
        stand_at(pose->T_world_cam, 0.1 * i, 0.002 * i * i);
        stand_at(pose->T_keyframe_cam, 0.1 * (i - keyframe), 0.002 * (i * i - keyframe * keyframe));
        for (int row = 0, k = 0; row < 6; k += 6 - row, row++)
            pose->covariance[k] = 1e-4;
    }
}

static void judge(struct faults_verdict *verdict, bool exact)
{
    faults_judge(&no_fault, &play, exact, nees, verdict);
}

static void a_right_walk_is_right(void **unused)
{
    (void)unused;
    struct faults_verdict verdict;
    walk(FOVEA_SCALE_FREE);
    judge(&verdict, true);
    assert_int_equal(verdict.tracking, FRAMES);
    assert_int_equal(verdict.due, FRAMES);
    assert_int_equal(verdict.judged, FRAMES - FRAMES / 10);
    assert_int_equal(verdict.wrong, 0);
}

/* From frame `from` on, lengths are `factor` times as many of the unit, and the path of the world
 * goes on `aside` of where it was. */
static void bend(int from, double factor, double aside)
{
    for (int i = from; i < FRAMES; i++) {
        struct fovea_pose *pose = &play.frame[i].pose;
        for (int k = 3; k < 12; k += 4) {
            pose->T_world_cam[k] *= factor;
            pose->T_keyframe_cam[k] *= factor;
        }
        pose->T_world_cam[7] += aside;
    }
}

/* A unit of its own is judged by what is said of poses since their keyframes: a path that has
 * leapt, which those before and behind do not deny, has the same unit all along; one that changes
 * is false. */
static void a_unit_is_that_of_relative_poses(void **unused)
{
    (void)unused;
    struct faults_verdict verdict;
    walk(FOVEA_SCALE_FREE);
    bend(0, 3, 0);
    judge(&verdict, true);
    assert_int_equal(verdict.judged, FRAMES - FRAMES / 10);
    assert_int_equal(verdict.wrong, 0);
    walk(FOVEA_SCALE_FREE);
    bend(FRAMES / 2, 1, 3);
    judge(&verdict, true);
    assert_int_equal(verdict.judged, FRAMES - FRAMES / 10);
    assert_int_equal(verdict.wrong, 0);
    walk(FOVEA_SCALE_FREE);
    bend(FRAMES / 2, 1.2, 0);
    judge(&verdict, true);
    assert_true(verdict.wrong > FRAMES / 4);
}

/* A few poses that are sure have their unit to themselves: weak ones far off, as they state, have
 * no part in it. Nor has how sure each of them is. */
static void weak_poses_give_no_unit_to_sure_ones(void **unused)
{
    enum { SURE = 4, UNSURE = 100 };
    (void)unused;
    struct faults_verdict verdict;
    walk(FOVEA_SCALE_FREE);
    bend(0, 3, 0);
    for (int i = SURE; i < FRAMES; i++)
        play.frame[i].pose.state = FOVEA_TRACKING_WEAK;
    bend(SURE, 20, 0);
    judge(&verdict, true);
    assert_int_equal(verdict.judged, SURE - 1); /* the first is its own keyframe */
    assert_int_equal(verdict.wrong, 0);
    walk(FOVEA_SCALE_FREE);
    bend(FRAMES / 3, 1.2, 0);
    judge(&verdict, true);
    const uint32_t wrong = verdict.wrong;
    assert_true(wrong > FRAMES / 5 && wrong <= FRAMES / 3); /* the smaller part */
    for (int i = FRAMES / 3; i < FRAMES; i++)
        for (int k = 0; k < 21; k++)
            play.frame[i].pose.covariance[k] *= UNSURE; /* these would count for nothing */
    judge(&verdict, true);
    assert_int_equal(verdict.wrong, wrong);
}

/* Few poses that are far off, and far away, as where a run ends lost, do not make the others wrong.
 */
static void wrong_poses_give_no_unit_to_right_ones(void **unused)
{
    (void)unused;
    struct faults_verdict verdict;
    walk(FOVEA_SCALE_FREE);
    bend(FRAMES * 4 / 5, 0.5, 0);
    for (int i = FRAMES * 4 / 5; i < FRAMES; i++) {
        play.frame[i].truth[3] += 50.0 * (i % 10);
        play.frame[i].pose.T_keyframe_cam[3] += 25.0 * (i % 10);
    }
    judge(&verdict, true);
    assert_true(verdict.wrong > FRAMES / 10 && verdict.wrong <= FRAMES / 5);
    walk(FOVEA_SCALE_FREE);
    bend(FRAMES * 3 / 5, 4, 0); /* too long by more than the others would be too short */
    judge(&verdict, true);
    assert_true(verdict.wrong > FRAMES / 5 && verdict.wrong <= FRAMES * 2 / 5);
}

/* A walk whose stamps leap in some windows. Frames whose stamps are not after that of the last
 * processed one are refused, as the runtime does. */
static void leap(const struct faults_plan *plan)
{
    int64_t last_ns = -1;
    walk(FOVEA_SCALE_FREE);
    for (int i = 0; i < FRAMES; i++) {
        struct faults_frame *frame = &play.frame[i];
        if (faults_strikes(plan, (uint64_t)i)) frame->stamp_ns += 868000000;
        frame->processed = frame->stamp_ns > last_ns;
        if (frame->processed) last_ns = frame->stamp_ns;
    }
}

/* Whether frames flow again is a matter of the source's time: stamps that leap are at fault. */
static void leaping_stamps_are_no_wait(void **state)
{
    struct faults_plan plan = {.count = 1};
    struct faults_verdict verdict;
    (void)state;
    snprintf(plan.options[0], sizeof plan.options[0],
             "kind=jump&leap=868&seed=3&first=8&shortest=4&longest=4&fraction=0.3");
    leap(&plan);
    faults_judge(&plan, &play, true, nees, &verdict);
    assert_true(verdict.returns >= 2);
    assert_int_equal(verdict.late, 0);
    assert_true(verdict.last_s > 0.2 && verdict.last_s < 0.869);
    snprintf(plan.options[0], sizeof plan.options[0],
             "kind=black&seed=3&first=8&shortest=4&longest=4&count=1");
    walk(FOVEA_SCALE_FREE);
    for (int i = 12; i < 12 + 31; i++)
        play.frame[i].processed = false;
    faults_judge(&plan, &play, true, nees, &verdict);
    assert_int_equal(verdict.returns, 1);
    assert_int_equal(verdict.late, 1);
}

/* One place that is no number makes that frame false, and no other unjudged. */
static void what_is_not_finite_is_false(void **unused)
{
    (void)unused;
    struct faults_verdict verdict;
    for (int kind = 0; kind < 4; kind++) {
        walk(kind == 0 ? FOVEA_SCALE_FREE : FOVEA_SCALE_INERTIAL);
        struct fovea_pose *pose = &play.frame[33].pose;
        if (kind < 2) pose->T_world_cam[3] = NAN;
        if (kind == 2) pose->T_keyframe_cam[7] = INFINITY;
        if (kind == 3) pose->covariance[4] = NAN;
        judge(&verdict, true);
        assert_int_equal(verdict.judged, FRAMES - FRAMES / 10);
        assert_int_equal(verdict.wrong, 1);
        assert_true(isfinite(verdict.error_m));
        judge(&verdict, false); /* without a truth, too */
        assert_int_equal(verdict.wrong, 1);
    }
    for (int i = 0; i < FRAMES; i++)
        for (int k = 0; k < 12; k++)
            play.frame[i].pose.T_world_cam[k] = NAN;
    judge(&verdict, true);
    assert_int_equal(verdict.wrong, FRAMES);
}

/* ---- the report ------------------------------------------------------------------------------ */

/* One run of each kind that is as it should be. */
static void good_runs(struct faults_result runs[FAULTS_KINDS])
{
    memset(runs, 0, FAULTS_KINDS * sizeof *runs);
    for (uint32_t kind = 0; kind < FAULTS_KINDS; kind++)
        runs[kind] = (struct faults_result){.seed = kind,
                                            .kind = kind,
                                            .bare = 180,
                                            .map = FAULTS_MAP_LOCALISES,
                                            .verdict = {.given = 200,
                                                        .processed = 200,
                                                        .posed = 190,
                                                        .tracking = 170,
                                                        .due = 170,
                                                        .judged = 150,
                                                        .returns = 4}};
}

static bool holds(const struct faults_result runs[FAULTS_KINDS], bool sample)
{
    const struct faults_bars bars = {.sample = sample, .wrong_max = 0.005};
    FILE *out = fopen("/dev/null", "w");
    assert_non_null(out);
    const bool right = faults_report(out, runs, FAULTS_KINDS, NULL, &bars);
    fclose(out);
    return right;
}

enum want { PROCESSED, TRACKING, JUDGED, RETURNS, LATE, MAPS, USELESS, BARE, WANTS };

static void spoil(struct faults_result *run, enum want want)
{
    struct faults_verdict *v = &run->verdict;
    if (want == PROCESSED) memset(v, 0, sizeof *v);
    if (want == TRACKING) v->tracking = v->due = v->judged = 0;
    if (want == JUDGED) v->judged = v->wrong = 0;
    if (want == RETURNS) v->returns = v->late = 0;
    if (want == LATE) v->late = v->returns;
    if (want == MAPS) run->map = FAULTS_MAP_NONE;
    if (want == USELESS) run->map = FAULTS_MAP_USELESS;
    if (want == BARE) run->bare = 0;
}

static void nothing_misses_the_bars(void **unused)
{
    (void)unused;
    static struct faults_result runs[FAULTS_KINDS];
    for (int sample = 0; sample < 2; sample++) {
        good_runs(runs);
        assert_true(holds(runs, sample));
        for (enum want want = 0; want < WANTS; want++) {
            if (want == BARE && sample) continue; /* a sample makes none */
            good_runs(runs);
            for (uint32_t kind = 0; kind < FAULTS_KINDS; kind++)
                spoil(&runs[kind], want);
            assert_false(holds(runs, sample));
        }
    }
    good_runs(runs);
    spoil(&runs[FV_FAULT_blur], BARE);
    assert_false(holds(runs, false));
    good_runs(runs);
    spoil(&runs[FV_FAULT_blur], JUDGED);
    assert_false(holds(runs, false));
}

/* ---- seeds ----------------------------------------------------------------------------------- */

/* Every kind has seeds, and so has each origin with it, as far as the kind goes with a real
 * recording; a fault has the name of its kind, and two at once have two. */
static void every_kind_is_drawn(void **unused)
{
    (void)unused;
    enum { TURNS = FAULTS_KIND_MIXED + 1, SEEDS = 20 * TURNS };
    static uint32_t drawn[FAULTS_KINDS][FAULTS_REAL + 1];
    static struct faults_plan plan;
    char asked[64];
    memset(drawn, 0, sizeof drawn);
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        faults_plan_draw(seed, "folder", &plan);
        assert_in_range(plan.kind, 0, FAULTS_KINDS - 1);
        drawn[plan.kind][plan.origin]++;
        assert_int_equal(plan.count, plan.kind == FAULTS_KIND_MIXED ? 2 : 1);
        if (plan.kind != FAULTS_KIND_HOLD) assert_int_equal(plan.kind, seed % TURNS);
        if (plan.kind == FAULTS_KIND_MIXED) continue;
        (void)snprintf(asked, sizeof asked, "kind=%s&", faults_kind_name(plan.kind));
        assert_int_equal(strncmp(plan.options[0], asked, strlen(asked)), 0);
    }
    for (uint32_t kind = 0; kind < FAULTS_KINDS; kind++) {
        const uint32_t all = kind < FAULTS_KIND_MIXED ? 20 : 10;
        assert_int_equal(drawn[kind][FAULTS_SIMULATED], all * 6 / 10);
        assert_int_equal(drawn[kind][FAULTS_RECORDED] + drawn[kind][FAULTS_REAL], all * 4 / 10);
        assert_true(drawn[kind][FAULTS_RECORDED] >= all * 3 / 10);
    }
}

/* ---- the record ------------------------------------------------------------------------------ */

static void a_record_is_of_one_build(void **unused)
{
    (void)unused;
    char folder[] = "/tmp/fovea_faults_XXXXXX", path[64], before[80], line[FAULTS_LINE],
         written[FAULTS_LINE];
    struct faults_result result = {.seed = 7, .kind = 1, .verdict = {.due = 3, .worst = 1.5}},
                         again;
    assert_non_null(mkdtemp(folder));
    (void)snprintf(path, sizeof path, "%s/seeds", folder);
    (void)snprintf(before, sizeof before, "%s.before", path);
    assert_null(faults_record_open(path, 1));
    faults_result_write(&result, written);
    faults_record_append(path, 1, written);
    FILE *file = fopen(path, "a"); /* the next was torn */
    assert_non_null(file);
    fputs("8 1 0 180 1 0 0 0 200 2", file);
    fclose(file);

    for (int i = 0; i < 2; i++) {
        file = faults_record_open(path, 1);
        assert_non_null(file);
        assert_true(faults_record_next(file, line));
        assert_true(faults_result_read(line, &again));
        faults_result_write(&again, line);
        assert_string_equal(line, written);
        assert_int_equal(faults_record_next(file, line), i == 1);
        fclose(file);
        if (i == 0) faults_record_append(path, 1, written);
    }
    assert_false(faults_result_read("8 1 0 180 1 0 0 0 200 2", &again));
    assert_null(faults_record_open(path, 2));
    assert_int_equal(access(before, F_OK), 0);
    assert_int_not_equal(access(path, F_OK), 0);
    assert_int_equal(unlink(before), 0);
    assert_int_equal(rmdir(folder), 0);
    assert_true(faults_build() != 0 && faults_build() == faults_build());
}

static void wheels_make_another_source(void **unused)
{
    (void)unused;
    char line[FAULTS_LINE];
    struct faults_bare bare = {.source = "sim:orbit?seed=1 and more", .wheels = true}, again;
    for (int i = 0; i < 2; i++, bare.wheels = false) {
        faults_bare_write(&bare, line);
        assert_true(faults_bare_read(line, &again));
        assert_string_equal(again.source, bare.source);
        assert_int_equal(again.wheels, bare.wheels);
    }
}

/* ---- hangs ----------------------------------------------------------------------------------- */

/* Looks until a process is thought to hang that uses `used` ticks from look to look; 0: never. */
static int looks_until(unsigned long used, bool awake_between)
{
    struct faults_sleep sleep = {0};
    for (int look = 1; look <= 10 * FAULTS_ASLEEP_S; look++)
        if (faults_sleeps(&sleep, !awake_between || look % 20 != 0, (unsigned long)look * used,
                          100))
            return look;
    return 0;
}

static void sleepers_are_found(void **unused)
{
    (void)unused;
    assert_int_equal(looks_until(0, false), FAULTS_ASLEEP_S + 1);
    assert_int_equal(looks_until(1, false), FAULTS_ASLEEP_S + 1); /* it looks about itself */
    assert_int_equal(looks_until(3, false), 0);
    assert_int_equal(looks_until(0, true), 0); /* it waits for a processor */
}

static void sleep_for_ever(void)
{
    for (;;)
        pause();
}

static void work(const void *argument, void *result)
{
    const int what = *(const int *)argument;
    *(int *)result = 5;
    if (what == 1) sleep_for_ever();
    if (what == 2) (void)atexit(sleep_for_ever); /* behind the result */
    if (what == 3) abort();
}

static void a_child_is_watched_to_its_end(void **unused)
{
    (void)unused;
    static const enum faults_end ends[4] = {FAULTS_WELL, FAULTS_HANG, FAULTS_HANG, FAULTS_CRASH};
    alarm(120);
    for (int what = 0; what < 4; what++) {
        int result = 0;
        assert_int_equal(faults_in_child(work, &what, &result, sizeof result, 10), ends[what]);
        assert_int_equal(result, what == 0 ? 5 : 0);
    }
    alarm(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_right_walk_is_right),
        cmocka_unit_test(a_unit_is_that_of_relative_poses),
        cmocka_unit_test(weak_poses_give_no_unit_to_sure_ones),
        cmocka_unit_test(wrong_poses_give_no_unit_to_right_ones),
        cmocka_unit_test(what_is_not_finite_is_false),
        cmocka_unit_test(leaping_stamps_are_no_wait),
        cmocka_unit_test(nothing_misses_the_bars),
        cmocka_unit_test(every_kind_is_drawn),
        cmocka_unit_test(a_record_is_of_one_build),
        cmocka_unit_test(wheels_make_another_source),
        cmocka_unit_test(sleepers_are_found),
        cmocka_unit_test(a_child_is_watched_to_its_end),
    };
    return cmocka_run_group_tests_name("judging of the campaign of faults", tests, NULL, NULL);
}
