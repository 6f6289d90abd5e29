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
#include "support/decode.h"

#include "fovea_preview_t.h"

enum { FRAMES = 60, WIDTH = 320, HEIGHT = 240, PIXELS = WIDTH * HEIGHT, KEPT = 16, CAMERAS = 3 };
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
    sim_rig_open_kept(&rig, WAY, 0, FRAMES);
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

/* ---- previews of several cameras ------------------------------------------------------------- */

static struct kept_frame {
    int64_t stamp_ns;
    uint8_t pixels[CAMERAS][PIXELS];
} kept_frames[KEPT];

static double difference(const uint8_t *a, const uint8_t *b)
{
    double sum = 0;
    for (int i = 0; i < PIXELS; i++)
        sum += a[i] > b[i] ? a[i] - b[i] : b[i] - a[i];
    return sum / PIXELS;
}

/* It is the picture of its camera in the frame of its stamp. Returns the camera. */
static int judge_preview(const struct fovea_message *message)
{
    static uint8_t pixels[PIXELS];
    const struct fv_decode_image image = {.pixels = pixels, WIDTH, HEIGHT, WIDTH, false};
    const struct kept_frame *frame = NULL;
    fovea_preview_t preview;
    assert_true(fovea_preview_t_decode(message->data, 0, (int)message->bytes, &preview) > 0);
    assert_true(preview.width == WIDTH && preview.height == HEIGHT);
    assert_int_equal(fv_decode(preview.jpeg, (size_t)preview.size_bytes, &image, NULL), FOVEA_OK);
    for (int i = 0; i < KEPT; i++)
        if (kept_frames[i].stamp_ns == preview.stamp.time_ns) frame = &kept_frames[i];
    assert_non_null(frame);
    const int camera = preview.camera;
    assert_in_range(camera, 0, CAMERAS - 1);
    const double own = difference(pixels, frame->pixels[camera]);
    assert_true(own < 3);
    for (int i = 0; i < CAMERAS; i++)
        assert_true(i == camera || difference(pixels, frame->pixels[i]) > 2 * own + 1);
    fovea_preview_t_decode_cleanup(&preview);
    return camera;
}

/* Cameras of the previews of a run, a digit each; in frames from `blind` on, cameras 1 to
 * `last_blind` give no image. */
static void previews_of(uint32_t cameras, int blind, int last_blind, char shown[FRAMES + 1])
{
    size_t count = 0;
    for (int i = 0; i < KEPT; i++)
        kept_frames[i].stamp_ns = -1;
    sim_rig_open_kept(&rig, WAY "&camera2=0.1,0,0&camera3=0,0.1,0", 0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.enabled = false;
    rig.config.preview = (struct fovea_preview_config){
        .period_frames = 4, .quality = 90, .level = 0, .cameras = cameras};
    sim_rig_build(&rig);
    for (int n = 0; sim_rig_next(&rig); n++) {
        struct kept_frame *frame = &kept_frames[n % KEPT];
        frame->stamp_ns = rig.frame.stamp_ns;
        for (int i = 0; i < CAMERAS; i++)
            for (int y = 0; y < HEIGHT; y++)
                memcpy(frame->pixels[i] + (size_t)y * WIDTH,
                       rig.frame.images[i].data + (ptrdiff_t)y * rig.frame.images[i].stride_bytes,
                       WIDTH);
        for (int i = 1; n >= blind && i <= last_blind; i++)
            rig.frame.images[i].data = NULL;
        sim_rig_process(&rig);
        for (uint32_t i = 0; i < rig.work.message_count; i++)
            if (strstr(rig.work.messages[i].channel, "PREVIEW") != NULL)
                shown[count++] = (char)('0' + judge_preview(&rig.work.messages[i]));
    }
    shown[count] = '\0';
    sim_rig_close(&rig);
}

static void previews_show_the_cameras_in_turn(void **state)
{
    char shown[FRAMES + 1];
    (void)state;
    previews_of(1, FRAMES, 0, shown);
    assert_true(strlen(shown) > 4 && strspn(shown, "0") == strlen(shown));
    previews_of(FOVEA_CAMERAS_MAX, FRAMES, 0, shown); /* more than there are */
    assert_memory_equal(shown, "012012", 6);
    previews_of(CAMERAS, FRAMES / 2, 1, shown); /* one that is blind is left out, no other */
    assert_memory_equal(shown, "012", 3);
    assert_non_null(strstr("020202", shown + strlen(shown) - 4));
    previews_of(CAMERAS, FRAMES / 2, 2, shown);
    assert_memory_equal(shown, "012", 3);
    assert_string_equal(shown + strlen(shown) - 3, "000");
    previews_of(2, FRAMES / 2, 1, shown);
    assert_memory_equal(shown, "010", 3);
    assert_string_equal(shown + strlen(shown) - 3, "000");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_whole_and_bear_names_of_their_own),
        cmocka_unit_test(the_schedules_follow_from_the_rows),
        cmocka_unit_test(a_job_waits_for_work_and_never_when_its_key_is_off),
        cmocka_unit_test(a_reset_leaves_no_job_with_work),
        cmocka_unit_test(previews_show_the_cameras_in_turn),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
