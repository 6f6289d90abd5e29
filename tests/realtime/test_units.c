/* Units are bounded: run one by one on the simulated camera, 99 of 100 of every job take at most
 * 0.25 ms of processor time, and 999 of 1000 at most four times that. Runs repeat bit for bit, so
 * while some are over it all are timed again, and the least time of each counts: what others on the
 * machine add is not the unit's. Judged in the ordinary build alone (FOVEA_TIMED). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "app/run/timing.h"
#include "common/job_switch.h"
#include "fovea/fovea.h"
#include "drivers/table.h"
#include "fovea/source.h"

enum { REPEATS_MAX = 40, UNITS_MAX = 100000, UNIT_NS = 250000, UNIT_MAX_NS = 4 * UNIT_NS };

static struct fv_histogram histograms[FOVEA_JOB_COUNT];
static struct unit {
    int job;
    int64_t least_ns;
} units[UNITS_MAX];
static uint32_t next_unit;

static int64_t cpu_ns(void)
{
    int64_t wall, cpu;
    fv_timing_clock(NULL, &wall, &cpu);
    return cpu;
}

#define JOB(name) (1u << FOVEA_JOB_##name)
#define EVERY_JOB ((1u << FOVEA_JOB_COUNT) - 1)

/* Sources, and the jobs that are timed there. All but closure begin with the frames; the
 * way through the corridor closes a loop. */
static const struct scenario {
    const char *uri;
    uint32_t step, frames, timed;
    bool detects;
} scenarios[] = {
    {"sim:corridor?width=752&height=480", 1, 100, EVERY_JOB & ~JOB(DETECT) & ~JOB(CLOSURE), false},
    {"sim:tour", 1, 100, EVERY_JOB & ~JOB(CLOSURE), true},
    {"sim:corridor?width=320&height=240", 4, 340, JOB(CLOSURE), false},
    {"sim:corridor?width=752&height=480&baseline=0.11", 1, 100, JOB(MAP), false},
};

static void note(int job, int64_t took_ns)
{
    struct unit *unit = &units[next_unit++];
    assert_true(next_unit < UNITS_MAX &&
                (unit->least_ns == 0 || unit->job == job)); /* the same each time */
    if (unit->least_ns == 0 || took_ns < unit->least_ns) *unit = (struct unit){job, took_ns};
}

/* As many units as the fixed schedule grants, those of timed jobs each by itself. */
static void work_one_by_one(struct fovea *rt, const struct fovea_grants *granted, uint32_t timed)
{
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        const uint32_t units_each = timed >> job & 1 ? 1 : granted->units[job];
        for (uint32_t n = 0; n < granted->units[job]; n += units_each) {
            struct fovea_grants some = {.features = granted->features};
            struct fovea_outputs outputs;
            some.units[job] = units_each;
            const int64_t begin = cpu_ns();
            fovea_work(rt, &some, &outputs);
            const int64_t took = cpu_ns() - begin;
            if (outputs.units_done[job] == 0) break;
            if (timed >> job & 1) note(job, took);
        }
    }
}

static void run(const struct scenario *scenario)
{
    const struct fovea_source_selection everything = {.step = scenario->step,
                                                      .frames = scenario->frames};
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_error error;
    struct fovea_config config;
    struct fovea_frame frame;
    struct fovea *rt;
    size_t bytes;
    fovea_config_default(&config);
    assert_int_equal(fv_source_find(scenario->uri, &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &everything, &source, &error), FOVEA_OK);
    if (ops->info(source)->rig.camera_count > 1)
        config.rig = ops->info(source)->rig;
    else
        config.rig.cameras[0].camera = ops->info(source)->rig.cameras[0].camera;
    assert_true(job_switch_all(&config, 4));
    config.edge_job.segments = true;
    if (!scenario->detects) config.detect.model = NULL;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    assert_non_null(memory);
    assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
        struct fovea_outputs outputs;
        fovea_grants_fixed(&config, &inputs.grants);
        fovea_step(rt, &inputs, &outputs);
        work_one_by_one(rt, &inputs.grants, scenario->timed);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    free(memory);
}

/* Whether the least times of all units so far keep the bounds; tells them. */
static bool judged_good(void)
{
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        histograms[job] = (struct fv_histogram){0};
    for (uint32_t i = 0; i < next_unit; i++)
        fv_histogram_add(&histograms[units[i].job], units[i].least_ns);
    bool good = true;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        const struct fv_histogram *h = &histograms[job];
        const int64_t p99 = fv_histogram_percentile(h, 0.99),
                      p999 = fv_histogram_percentile(h, 0.999);
        print_message("%-10s %6llu units, %7.1f us mean, %7.1f p99, %7.1f p99.9, %7.1f max\n",
                      fovea_job_name((enum fovea_job)job), (unsigned long long)h->count,
                      (double)fv_histogram_mean(h) * 1e-3, (double)p99 * 1e-3, (double)p999 * 1e-3,
                      (double)h->max_ns * 1e-3);
        good = good && h->count > 100 && p99 <= UNIT_NS && p999 <= UNIT_MAX_NS;
    }
    return good;
}

static void test_units_are_bounded(void **state)
{
    (void)state;
    if (getenv("FOVEA_TIMED") == NULL) {
        print_message("SKIPPED times of units: judged in the ordinary build alone\n");
        skip();
    }
    bool good = false;
    for (int i = 0; i < REPEATS_MAX && !good; i++) {
        next_unit = 0;
        for (size_t v = 0; v < sizeof scenarios / sizeof scenarios[0]; v++)
            run(&scenarios[v]);
        good = judged_good();
    }
    assert_true(good);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_units_are_bounded)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
