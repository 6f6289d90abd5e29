#include "report.h"

#include <math.h>
#include <string.h>

/* Bars of a campaign. */
static const double judged_min = 0.7, tracking_min = 0.3, flow_min = 0.99, map_min = 0.99;

struct sum {
    uint32_t runs, ends[3], returns, late, maps[4];
    uint64_t processed, tracking, with_bare, bare, due, judged, wrong, heap_calls;
    uint32_t spoiled; /* runs with any false frame */
    uint32_t leaks, endless;
    double worst;
};

static void add(struct sum *sum, const struct faults_result *result)
{
    const struct faults_verdict *v = &result->verdict;
    sum->runs++;
    sum->ends[result->end]++;
    if (result->end != FAULTS_WELL) return;
    sum->processed += v->processed;
    sum->tracking += v->tracking;
    if (result->bare > 0) {
        sum->with_bare += v->tracking;
        sum->bare += result->bare;
    }
    sum->due += v->due;
    sum->judged += v->judged;
    sum->wrong += v->wrong;
    sum->spoiled += v->wrong > 0;
    sum->returns += v->returns;
    sum->late += v->late;
    sum->maps[result->map]++;
    sum->heap_calls += result->heap_calls;
    sum->leaks += result->descriptors != 0;
    sum->endless += result->endless;
    sum->worst = fmax(sum->worst, v->worst);
}

static double share(uint64_t part, uint64_t of)
{
    return of > 0 ? (double)part / (double)of : 0;
}

static void row(FILE *out, const char *name, const struct sum *sum)
{
    char kept[32] = "–", flow[32] = "–";
    if (sum->bare > 0)
        (void)snprintf(kept, sizeof kept, "%.0f %%", 100 * share(sum->with_bare, sum->bare));
    if (sum->returns > 0)
        (void)snprintf(flow, sizeof flow, "%u of %u", sum->returns - sum->late, sum->returns);
    fprintf(out,
            "| %s | %u | %llu | %s | %.2f %% (%llu of %llu) | %u | %.3g | %s | %u, %u, %u, %u |\n",
            name, sum->runs, (unsigned long long)sum->tracking, kept,
            100 * share(sum->wrong, sum->judged), (unsigned long long)sum->wrong,
            (unsigned long long)sum->judged, sum->spoiled, sum->worst, flow,
            sum->maps[FAULTS_MAP_LOCALISES], sum->maps[FAULTS_MAP_TRACKS],
            sum->maps[FAULTS_MAP_USELESS], sum->maps[FAULTS_MAP_NONE]);
}

static bool holds(FILE *out, bool right, const char *bar, const char *of, double found)
{
    if (!right) fprintf(out, "- bar missed: %s, %s: %.4g\n", bar, of, found);
    return right;
}

/* Of all that runs can be judged by there must be something: a runtime that does nothing does
 * nothing wrong. */
static bool judge_worth(FILE *out, const struct sum *all, double slack)
{
    const double judged = share(all->judged, all->due),
                 flow = share(all->returns - all->late, all->returns) + slack;
    const uint32_t with_map =
        all->runs - all->maps[FAULTS_MAP_NONE] - all->ends[FAULTS_CRASH] - all->ends[FAULTS_HANG];
    const double usable = share(with_map - all->maps[FAULTS_MAP_USELESS], with_map) + slack;
    bool right = holds(out, all->processed > 0, "frames processed", "all", (double)all->processed);
    right &= holds(out, all->tracking > 0, "frames tracking", "all", (double)all->tracking);
    right &= holds(out, judged >= judged_min, "judged, % of tracking frames with a truth", "all",
                   100 * judged);
    right &= holds(out, all->returns > 0 && flow >= flow_min,
                   "frames flow within 1 s of a fault's end, %", "all", 100 * flow);
    return holds(out, with_map > 0 && usable >= map_min, "maps usable, %", "all", 100 * usable) &&
           right;
}

/* Bars of the campaign that hold for each kind. */
static bool judge_kinds(FILE *out, const struct sum kinds[FAULTS_KINDS], double wrong_max)
{
    bool right = true;
    struct sum gone = {0}; /* the source itself was away */
    for (uint32_t kind = 0; kind < FAULTS_KINDS; kind++) {
        const struct sum *sum = &kinds[kind];
        const char *name = faults_kind_name(kind);
        const double wrong = share(sum->wrong, sum->judged), judged = share(sum->judged, sum->due),
                     kept = share(sum->with_bare, sum->bare);
        if (sum->runs == 0) continue;
        right &= holds(out, judged >= judged_min, "judged, % of tracking frames with a truth", name,
                       100 * judged);
        right &= holds(out, wrong <= wrong_max, "false confidence, % of frames", name, 100 * wrong);
        right &=
            holds(out, sum->bare > 0, "tracking frames without faults", name, (double)sum->bare);
        right &= holds(out, kept >= tracking_min, "tracking frames, % of those without faults",
                       name, 100 * kept);
        if (kind != FV_FAULT_unplug && kind != FV_FAULT_drop) continue;
        gone.runs += sum->runs;
        gone.returns += sum->returns;
        gone.late += sum->late;
    }
    if (gone.runs == 0) return right;
    const double flow = share(gone.returns - gone.late, gone.returns);
    return holds(out, flow >= flow_min, "frames flow within 1 s of a return, %", "unplug, drop",
                 100 * flow) &&
           right;
}

bool faults_report(FILE *out, const struct faults_result *results, uint32_t count,
                   const struct faults_verdict *bare, const struct faults_bars *bars)
{
    static struct sum kinds[FAULTS_KINDS], all, none;
    memset(kinds, 0, sizeof kinds);
    memset(&all, 0, sizeof all);
    for (uint32_t i = 0; i < count; i++) {
        add(&kinds[results[i].kind], &results[i]);
        add(&all, &results[i]);
    }
    fprintf(out,
            "| kind | runs | tracking frames | of those without faults | false confidence | runs "
            "with any | worst NEES | frames within 1 s of a fault's end | map: localises, tracks, "
            "useless, none |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
    if (bare != NULL) {
        none.tracking = bare->tracking;
        none.judged = bare->judged;
        none.wrong = bare->wrong;
        none.worst = bare->worst;
        none.runs = bare->given / FAULTS_FRAMES;
        row(out, "no fault", &none);
    }
    for (uint32_t kind = 0; kind < FAULTS_KINDS; kind++)
        row(out, faults_kind_name(kind), &kinds[kind]);
    row(out, "all", &all);
    fprintf(out,
            "\n%u runs: %u crashes, %u hangs, %llu heap calls, %u with leaked descriptors, %u "
            "without an end\n",
            all.runs, all.ends[FAULTS_CRASH], all.ends[FAULTS_HANG],
            (unsigned long long)all.heap_calls, all.leaks, all.endless);
    bool right = all.ends[FAULTS_CRASH] + all.ends[FAULTS_HANG] + all.leaks + all.endless == 0 &&
                 all.heap_calls == 0;
    const double wrong = share(all.wrong, all.judged);
    right &= judge_worth(out, &all, bars->sample && all.runs > 0 ? 1.0 / all.runs : 0);
    right &=
        holds(out, wrong <= bars->wrong_max, "false confidence, % of frames", "all", 100 * wrong);
    return (bars->sample || judge_kinds(out, kinds, bars->wrong_max)) && right;
}
