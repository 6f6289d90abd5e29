/* The campaign of fault schedules: seeded faults upon 200 frames of simulated and recorded sources,
 * against the whole runtime with detector, map and grid; each in a process of its own.
 *
 * Usage: faults SEEDS FIRST FOLDER [--sample]   seeds FIRST to FIRST + SEEDS - 1. What is done
 *            stands in FOLDER/faults.seeds and is not run again by the same build; the report is
 *            FOLDER/faults.md, with pictures of the worst runs beside it. Exit 0: all bars hold.
 *            --sample: nothing is remembered, and no run without faults is made to compare with;
 *            rates of single kinds are not judged.
 *        faults --one SEED FOLDER [PICTURE.png]  one seed again, and what it is made of
 *        faults --bare SEED FOLDER [PICTURE.png] its source without the faults
 *        faults --recordings                     what FOLDER must hold: lines "NAME URI", to be
 *                                                recorded by `fovea run --record`
 *        faults --real URI FOLDER NAME           make FOLDER/NAME from a real recording
 *
 * A seed decides everything of its run (faults/plan.h). Judged are (faults/judge.h, report.c):
 *
 * - Crashes, hangs, heap calls in the loop, descriptors that stay open: none.
 * - Frames processed, frames in state `tracking` (without faults too), returns, maps: some of each,
 *   or nothing is judged.
 * - Judged for false confidence: at least 70 % of the tracking frames whose truth is exact. A frame
 *   that is its own keyframe is not judged, nor is a map of a few poses.
 * - False confidence, of tracking frames: at most 0.5 % for each kind of fault. A frame is false
 *   whose pose against its reference keyframe has a NEES over 22.5, or is not finite. Poses in
 *   metres are compared as they are. Those of free scale take their unit, and nothing else, from
 *   the truth: one for each map.
 * - Tracking frames: for each kind at least 30 % of those of the same source without faults.
 * - Frames: after a return of the source one is processed within 1 s of its time, in 99 %.
 * - Map: it loads, and a run without faults on the same place finds itself in it within 60 frames,
 *   or at least tracks with it loaded, in 99 %. A run that never had a pose has no map. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "faults/child.h"
#include "faults/drawing.h"
#include "faults/judge.h"
#include "faults/plan.h"
#include "faults/play.h"
#include "faults/real.h"
#include "faults/record.h"
#include "faults/report.h"
#include "app/run/heap.h"

enum { SEEDS_MAX = 10000, SOURCES_MAX = 512, WORST = 6, AGAIN_FROM = 100, AGAIN = 60 };

/* 99.9 % of six degrees of freedom are below 22.5: 0.1 % is what a right covariance gives. The
 * campaign holds each kind to the bar, and misses it for some (docs/measured.md). False frames come
 * in few runs and many at a time, so 45 runs cannot tell 1 % from 3 %: of samples drawn from 217
 * runs, 1 in 1,000 has more than 4.1 %. A sample fails where something has broken. */
static const double wrong_max = 0.005, wrong_max_of_sample = 0.06;

/* ---- in the child ---------------------------------------------------------------------------- */

static struct faults_play play, again;
static double nees[FAULTS_GIVEN_MAX];

struct task {
    struct faults_plan plan;
    const char *picture; /* NULL: none */
    bool explain;        /* a line for each frame of false confidence */
};

static bool posed_with(const struct faults_plan *plan, uint64_t frames, bool localise_only)
{
    struct faults_verdict verdict;
    const struct faults_plan bare = {.count = 0};
    memset(&again, 0, sizeof again);
    again.uri = plan->source;
    again.start = AGAIN_FROM;
    again.frames = frames;
    again.wheels = plan->wheels;
    again.alone = true;
    again.map = play.saved;
    again.map_bytes = play.saved_bytes;
    again.localise_only = localise_only;
    faults_play(&again);
    free(again.saved);
    play.heap_calls += again.heap_calls;
    play.descriptors += again.descriptors;
    faults_judge(&bare, &again, false, nees, &verdict);
    return localise_only ? verdict.posed > 0 : verdict.tracking > 0;
}

static enum faults_map try_map(const struct faults_plan *plan, const struct faults_verdict *verdict)
{
    if (verdict->posed == 0) return FAULTS_MAP_NONE;
    if (posed_with(plan, AGAIN, true)) return FAULTS_MAP_LOCALISES;
    return posed_with(plan, FAULTS_FRAMES - AGAIN_FROM, false) ? FAULTS_MAP_TRACKS
                                                               : FAULTS_MAP_USELESS;
}

/* The run of a task; without faults where the plan has none, and then without its map. */
static void run_task(const void *argument, void *found)
{
    const struct task *task = argument;
    struct faults_result *result = found;
    memset(&play, 0, sizeof play);
    play.uri = task->plan.uri;
    play.twin = task->plan.twin;
    play.frames = FAULTS_FRAMES;
    play.wheels = task->plan.wheels;
    faults_play(&play);
    faults_judge(&task->plan, &play, task->plan.origin != FAULTS_REAL, nees, &result->verdict);
    if (task->explain) faults_explain(&play, nees);
    if (task->picture != NULL)
        faults_draw(task->picture, &task->plan, &play, nees, &result->verdict);
    if (task->plan.count > 0) result->map = try_map(&task->plan, &result->verdict);
    result->seed = task->plan.seed;
    result->kind = task->plan.kind;
    result->heap_calls = play.heap_calls;
    result->descriptors = play.descriptors;
    result->endless = play.endless;
    printf(
        "seed %llu: %s, %u frames given, %u processed, %u posed, %u tracking, %u judged, %u false "
        "(NEES up to %.4g, %.3f m); returns %u, late %u, longest %.2f s; map %u; %llu inferences, "
        "%llu masks, %llu grids, %llu messages; state %016llx\n",
        (unsigned long long)task->plan.seed, faults_kind_name(task->plan.kind), play.count,
        result->verdict.processed, result->verdict.posed, result->verdict.tracking,
        result->verdict.judged, result->verdict.wrong, result->verdict.worst,
        result->verdict.error_m, result->verdict.returns, result->verdict.late,
        result->verdict.last_s, result->map, (unsigned long long)play.detections,
        (unsigned long long)play.masks, (unsigned long long)play.grids,
        (unsigned long long)play.messages, (unsigned long long)play.hash);
    if (play.heap_calls > 0 || play.descriptors != 0 || play.endless)
        printf("  FAULT: %llu heap calls, %d descriptors left open%s\n",
               (unsigned long long)play.heap_calls, play.descriptors,
               play.endless ? ", no end" : "");
    free(play.saved);
}

/* ---- runs without faults, one for each source ------------------------------------------------ */

static struct faults_bare bares[SOURCES_MAX];
static uint32_t bare_count;
static uint64_t build; /* this program */

static void bares_read(const char *path)
{
    char line[FAULTS_LINE];
    FILE *file = faults_record_open(path, build);
    while (file != NULL && bare_count < SOURCES_MAX && faults_record_next(file, line))
        bare_count += faults_bare_read(line, &bares[bare_count]);
    if (file != NULL) fclose(file);
}

static const struct faults_bare *bare_of(const struct faults_plan *plan, const char *path)
{
    struct task task = {.plan = *plan};
    struct faults_result result = {.kind = FAULTS_KINDS};
    char line[FAULTS_LINE];
    for (uint32_t i = 0; i < bare_count; i++)
        if (strcmp(bares[i].source, plan->source) == 0 && bares[i].wheels == plan->wheels)
            return &bares[i];
    if (bare_count == SOURCES_MAX) faults_die("too many sources");
    task.plan.count = 0;
    task.plan.kind = FAULTS_KINDS;
    memcpy(task.plan.uri, plan->source, sizeof plan->source);
    if (faults_in_child(run_task, &task, &result, sizeof result, FAULTS_LOOK_MS) != FAULTS_WELL)
        faults_die("a source without faults does not run");
    struct faults_bare *bare = &bares[bare_count++];
    memcpy(bare->source, plan->source, sizeof bare->source);
    bare->wheels = plan->wheels;
    bare->verdict = result.verdict;
    faults_bare_write(bare, line);
    faults_record_append(path, build, line);
    return bare;
}

static void bares_sum(struct faults_verdict *sum)
{
    memset(sum, 0, sizeof *sum);
    for (uint32_t i = 0; i < bare_count; i++) {
        const struct faults_verdict *v = &bares[i].verdict;
        sum->given += v->given;
        sum->tracking += v->tracking;
        sum->due += v->due;
        sum->judged += v->judged;
        sum->wrong += v->wrong;
        sum->worst = fmax(sum->worst, v->worst);
    }
}

/* ---- all seeds ------------------------------------------------------------------------------- */

static struct faults_result results[SEEDS_MAX];
static uint32_t result_count;

static bool is_done(uint64_t seed)
{
    for (uint32_t i = 0; i < result_count; i++)
        if (results[i].seed == seed) return true;
    return false;
}

/* Whether the source of a plan is there: real recordings need the data. */
static bool is_there(const struct faults_plan *plan)
{
    return plan->origin != FAULTS_REAL || access(plan->source + strlen("tum:"), F_OK) == 0;
}

static void run_seed(uint64_t seed, const char *folder, bool sample, struct faults_result *result)
{
    static struct task task;
    char path[FAULTS_TEXT];
    faults_plan_draw(seed, folder, &task.plan);
    memset(result, 0, sizeof *result);
    result->seed = seed;
    result->kind = task.plan.kind;
    result->end = faults_in_child(run_task, &task, result, sizeof *result, FAULTS_LOOK_MS);
    if (result->end != FAULTS_WELL || result->heap_calls > 0 || result->descriptors != 0 ||
        result->endless)
        printf("  again: build/tests/campaign/faults --one %llu %s   (%s)\n",
               (unsigned long long)seed, folder, task.plan.uri);
    (void)snprintf(path, sizeof path, "%s/faults.bare", folder);
    if (!sample) result->bare = bare_of(&task.plan, path)->verdict.tracking;
}

static void run_all(uint64_t first, uint32_t seeds, const char *folder, bool sample)
{
    char path[FAULTS_TEXT], line[FAULTS_LINE];
    struct faults_plan plan;
    uint32_t skipped = 0;
    (void)snprintf(path, sizeof path, "%s/faults.bare", folder);
    if (!sample) bares_read(path);
    (void)snprintf(path, sizeof path, "%s/faults.seeds", folder);
    FILE *file = sample ? NULL : faults_record_open(path, build);
    while (file != NULL && result_count < SEEDS_MAX && faults_record_next(file, line))
        result_count += faults_result_read(line, &results[result_count]) &&
                        results[result_count].seed - first < seeds;
    if (file != NULL) fclose(file);
    for (uint64_t seed = first; seed < first + seeds && result_count < SEEDS_MAX; seed++) {
        faults_plan_draw(seed, folder, &plan);
        skipped += !is_there(&plan);
        if (is_done(seed) || !is_there(&plan)) continue;
        run_seed(seed, folder, sample, &results[result_count]);
        faults_result_write(&results[result_count], line);
        if (!sample) faults_record_append(path, build, line);
        result_count++;
    }
    if (skipped > 0) printf("SKIPPED %u seeds on real recordings, which are not there\n", skipped);
}

/* ---- the report ------------------------------------------------------------------------------ */

static int worse(const void *a, const void *b)
{
    const struct faults_result *x = a, *y = b;
    if (x->end != y->end) return x->end < y->end ? 1 : -1;
    if (x->verdict.wrong != y->verdict.wrong) return x->verdict.wrong < y->verdict.wrong ? 1 : -1;
    if (x->verdict.worst != y->verdict.worst) return x->verdict.worst < y->verdict.worst ? 1 : -1;
    return (x->seed > y->seed) - (x->seed < y->seed);
}

static void draw_worst(FILE *out, const char *folder)
{
    static struct task task;
    static struct faults_result result;
    char path[FAULTS_TEXT];
    fprintf(out, "\nThe worst runs; `faults --one SEED FOLDER` repeats one.\n\n");
    for (uint32_t i = 0; i < result_count && i < WORST; i++) {
        const struct faults_result *r = &results[i];
        (void)snprintf(path, sizeof path, "%s/worst-%u.png", folder, i + 1);
        faults_plan_draw(r->seed, folder, &task.plan);
        task.picture = path;
        const bool drawn =
            faults_in_child(run_task, &task, &result, sizeof result, FAULTS_LOOK_MS) == FAULTS_WELL;
        fprintf(out, "- seed %llu, %s: %u of %u judged frames false, NEES up to %.4g: %s, `%s`\n",
                (unsigned long long)r->seed, faults_kind_name(r->kind), r->verdict.wrong,
                r->verdict.judged, r->verdict.worst, drawn ? path : "no picture", task.plan.uri);
    }
}

static void copy_out(const char *path)
{
    int c;
    FILE *file = fopen(path, "r");
    while (file != NULL && (c = fgetc(file)) != EOF)
        putchar(c);
    if (file != NULL) fclose(file);
}

static int report(const char *folder, bool sample)
{
    char path[FAULTS_TEXT];
    struct faults_verdict bare;
    const struct faults_bars bars = {.sample = sample,
                                     .wrong_max = sample ? wrong_max_of_sample : wrong_max};
    (void)snprintf(path, sizeof path, "%s/faults.md", folder);
    FILE *out = fopen(path, "w");
    if (out == NULL) faults_die("the report cannot be written");
    qsort(results, result_count, sizeof *results, worse);
    bares_sum(&bare);
    const bool right =
        faults_report(out, results, result_count, sample ? NULL : &bare, &bars) && result_count > 0;
    if (!sample) draw_worst(out, folder);
    if (fclose(out)) faults_die("the report cannot be written");
    copy_out(path);
    return right ? 0 : 1;
}

/* `bare`: its source without the faults. */
static int one(uint64_t seed, const char *folder, const char *picture, bool bare)
{
    struct task task = {.picture = picture, .explain = true};
    struct faults_result result;
    faults_plan_draw(seed, folder, &task.plan);
    if (bare) task.plan.count = 0;
    if (bare) memcpy(task.plan.uri, task.plan.source, sizeof task.plan.source);
    printf("%s%s\n", task.plan.uri, task.plan.wheels ? " (scale.source wheel_odometry)" : "");
    return faults_in_child(run_task, &task, &result, sizeof result, FAULTS_LOOK_MS) == FAULTS_WELL
               ? 0
               : 1;
}

static int recordings(void)
{
    char name[64], uri[256];
    for (uint32_t i = 0; faults_recording(i, name, uri); i++)
        printf("%s %s\n", name, uri);
    return 0;
}

int main(int argc, char **argv)
{
    if (!fv_heap_counted()) puts("heap calls are not counted in this build");
    if (argc == 2 && strcmp(argv[1], "--recordings") == 0) return recordings();
    if (argc >= 4 && (strcmp(argv[1], "--one") == 0 || strcmp(argv[1], "--bare") == 0))
        return one(strtoull(argv[2], NULL, 10), argv[3], argc > 4 ? argv[4] : NULL,
                   strcmp(argv[1], "--bare") == 0);
    if (argc == 5 && strcmp(argv[1], "--real") == 0) {
        faults_real(argv[2], argv[3], argv[4]);
        return 0;
    }
    if (argc < 4 || atoi(argv[1]) < 1 || atoi(argv[1]) > SEEDS_MAX)
        faults_die("usage: faults SEEDS FIRST FOLDER [--sample]");
    const bool sample = argc > 4 && strcmp(argv[4], "--sample") == 0;
    build = faults_build();
    run_all(strtoull(argv[2], NULL, 10), (uint32_t)atoi(argv[1]), argv[3], sample);
    return report(argv[3], sample);
}
