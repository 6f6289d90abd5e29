/* The table of jobs: each row is whole, its stage bears its name, its key is a key of the
 * configuration, switched on by that key the job has work, and switched off by it none. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "app/config/settings.h"
#include "common/job_switch.h"
#include "common/sim_rig.h"
#include "runtime/jobs.h"

enum { FRAMES = 60 };
#define WAY "sim:orbit?width=320&height=240&lens=pinhole&fov=70&rate=3"

static struct sim_rig rig;

static bool is_key(const char *name)
{
    for (size_t i = 0; i < fv_settings_key_count; i++)
        if (strcmp(fv_settings_keys[i].name, name) == 0) return true;
    return false;
}

static void rows_are_whole_and_bear_names_of_their_own(void **state)
{
    (void)state;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        const struct fv_job *row = fv_jobs[job];
        const char *name = fovea_job_name((enum fovea_job)job);
        assert_true(is_key(row->key));
        assert_true(row->waiting != NULL && row->advance != NULL);
        assert_in_range(row->units_min, 1, row->units_fixed);
        assert_string_equal(fovea_job_key((enum fovea_job)job), row->key);
        assert_string_equal(fovea_stage_name((enum fovea_stage)(FOVEA_STAGE_JOBS + job)), name);
        for (int stage = 0; stage < FOVEA_STAGE_JOBS + job; stage++)
            assert_string_not_equal(fovea_stage_name((enum fovea_stage)stage), name);
    }
    assert_string_equal(fovea_job_name(FOVEA_JOB_COUNT), "unknown");
    assert_string_equal(fovea_job_key(FOVEA_JOB_COUNT), "");
    assert_string_equal(fovea_stage_name(FOVEA_STAGE_COUNT), "unknown");
}

static void the_schedules_follow_from_the_rows(void **state)
{
    (void)state;
    struct fovea_grants fixed, short_of_time;
    struct fovea_governor governor;
    fovea_config_default(&rig.config);
    fovea_governor_init(&governor, &rig.config, 1000000);
    fovea_grants_fixed(&rig.config, &fixed);
    fovea_governor_next(&governor, &rig.config, &short_of_time);
    fovea_governor_work(&governor, 2000000, UINT32_MAX, &short_of_time);
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        assert_int_equal(fixed.units[job], fv_jobs[job]->units_fixed);
        assert_int_equal(short_of_time.units[job], fv_jobs[job]->units_min);
    }
}

/* Jobs that waited in any step of a run. */
static uint32_t jobs_seen(void)
{
    uint32_t seen = 0;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_process(&rig);
        seen |= rig.outputs.jobs_waiting;
    }
    sim_rig_close(&rig);
    return seen;
}

static void open_with_all_jobs(void)
{
    sim_rig_open(&rig, WAY, 0, FRAMES);
    assert_true(job_switch_all(&rig.config, 4));
}

static void a_job_waits_for_work_and_never_when_its_key_is_off(void **state)
{
    (void)state;
    open_with_all_jobs();
    assert_int_equal(jobs_seen(), (1u << FOVEA_JOB_COUNT) - 1);
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        open_with_all_jobs();
        assert_true(job_switch(&rig.config, (enum fovea_job)job, 0));
        assert_int_equal(jobs_seen() & 1u << job, 0);
    }
}

/* The detector and the preview are in the middle of the last image when the command comes. */
static void a_reset_leaves_no_job_with_work(void **state)
{
    (void)state;
    open_with_all_jobs();
    sim_rig_build(&rig);
    for (int i = 0; i < 8 && sim_rig_next(&rig); i++)
        sim_rig_process(&rig);
    assert_true(sim_rig_next(&rig));
    fovea_step(rig.rt, &rig.inputs, &rig.outputs);
    assert_true(rig.outputs.jobs_waiting & 1u << FOVEA_JOB_DETECT);
    assert_true(rig.outputs.jobs_waiting & 1u << FOVEA_JOB_PREVIEW);
    struct fovea_inputs command = rig.inputs;
    command.frame = NULL;
    command.sample_count = 0;
    command.commands = FOVEA_COMMAND_RESET;
    fovea_step(rig.rt, &command, &rig.outputs);
    assert_int_equal(rig.outputs.jobs_waiting, 0);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_whole_and_bear_names_of_their_own),
        cmocka_unit_test(the_schedules_follow_from_the_rows),
        cmocka_unit_test(a_job_waits_for_work_and_never_when_its_key_is_off),
        cmocka_unit_test(a_reset_leaves_no_job_with_work),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
