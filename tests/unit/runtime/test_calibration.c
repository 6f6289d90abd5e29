/* The check of the calibration in the loop: a lens that is knocked during the run and the file of
 * another camera are reported, and a calibration that is right is not.
 *
 * FOVEA_LONG=N: N whole runs of each kind over the trajectories of the simulated camera, even seeds
 * (default: a short one). FOVEA_SEED: the first seed. */
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

#include "common/data_folder.h"
#include "common/sim_rig.h"
#include "runtime/state.h"

#include "fovea_calibration_warning_t.h"

static struct sim_rig rig;

static int number_of(const char *name, int otherwise)
{
    const char *text = getenv(name);
    return text != NULL && text[0] != '\0' ? (int)strtol(text, NULL, 10) : otherwise;
}

/* What a run said. */
struct said {
    int first;               /* frame of the first verdict; -1: none */
    double first_difference; /* of the focal length, then */
    int messages;            /* on the channel */
    double fps;
    struct fovea_calibration last;
    uint64_t hash;                       /* of the state at the end */
    fovea_calibration_warning_t message; /* the first with that verdict, its lists copied below */
    float mean_px[24][2];
    int32_t samples[24];
};

static void message_note(struct said *said, const struct fovea_message *m)
{
    fovea_calibration_warning_t decoded;
    if (strcmp(m->channel, "FOVEA_CALIBRATION_WARNING") != 0) return;
    said->messages++;
    assert_true(fovea_calibration_warning_t_decode(m->data, 0, (int)m->bytes, &decoded) > 0);
    assert_int_equal(decoded.cell_count, 24);
    assert_int_equal(decoded.cell_count, decoded.columns * decoded.rows);
    if (said->message.state == FOVEA_CALIBRATION_WARNING_T_STATE_OK) {
        said->message = decoded;
        for (int i = 0; i < 24; i++) {
            memcpy(said->mean_px[i], decoded.mean_px[i], sizeof said->mean_px[i]);
            said->samples[i] = decoded.samples[i];
        }
    }
    fovea_calibration_warning_t_decode_cleanup(&decoded);
}

/* The frame before which another map is entered; -1: none. */
static int entered = -1;

static struct said run(const char *uri, double focal, int frames)
{
    struct said said = {.first = -1};
    sim_rig_open(&rig, uri, 0, frames);
    rig.config.rig.cameras[0].camera.fx *= focal;
    rig.config.rig.cameras[0].camera.fy *= focal;
    sim_rig_build(&rig);
    said.fps = rig.ops->info(rig.source)->rate_hz;
    for (int n = 0; sim_rig_next(&rig); n++) {
        if (n == entered) rig.rt->calibration.state->map_id ^= 1;
        sim_rig_process(&rig);
        for (uint32_t m = 0; m < rig.work.message_count; m++)
            message_note(&said, &rig.work.messages[m]);
        fovea_calibration_get(rig.rt, &said.last);
        if (said.last.state == FOVEA_CALIBRATION_OK) continue;
        if (said.first < 0) {
            said.first = n;
            said.first_difference = said.last.focal_difference;
        }
    }
    said.hash = fovea_state_hash(rig.rt);
    sim_rig_close(&rig);
    return said;
}

/* ---- simulated ------------------------------------------------------------------------------- */

struct plan {
    int runs, frames, knocked; /* frame of the knock */
    const char *size;
};

static struct plan plan_of(void)
{
    const int whole = number_of("FOVEA_LONG", 0);
    if (whole > 0) return (struct plan){whole, 700, 350, ""};
    return (struct plan){1, 100, 70, "&width=320&height=240"};
}

static void source_write(char uri[256], const struct plan *plan, int i, double factor)
{
    static const char *const paths[] = {"orbit", "wander", "tour", "stopgo", "corridor"};
    const char *path = paths[plan->size[0] != '\0' ? 0 : i % 5];
    char inner[128];
    snprintf(inner, sizeof inner, "sim:%s?seed=%d%s&frames=%d", path,
             number_of("FOVEA_SEED", 2) + 2 * i, plan->size, plan->frames);
    if (factor == 1)
        snprintf(uri, 256, "%s", inner);
    else
        snprintf(uri, 256, "fault:%s?kind=zoom&factor=%g&first=%d&fraction=1", inner, factor,
                 plan->knocked);
}

static void a_knocked_lens_is_reported(void **state)
{
    const struct plan plan = plan_of();
    int wrong = 0, latest = 0;
    (void)state;
    for (int i = 0; i < plan.runs; i++) {
        char uri[256];
        const double factor = i % 2 == 0 ? 1.02 : 1 / 1.02;
        source_write(uri, &plan, i, factor);
        struct said said = run(uri, 1, plan.frames);
        if (said.first < 0 && plan.size[0] == '\0') { /* the run ended before the time was over */
            struct plan whole = plan;
            whole.frames = plan.knocked + (int)(60 * said.fps);
            source_write(uri, &whole, i, factor);
            said = run(uri, 1, whole.frames);
        }
        const int after = said.first - plan.knocked;
        if (after > latest) latest = after;
        if (after < 0 || after > 60 * said.fps || said.last.cause != FOVEA_CALIBRATION_CHANGED ||
            said.last.focal_difference / log(factor) < 0.2 ||
            said.last.focal_difference / log(factor) > 1.5) {
            print_message("%s: frame %d, %s\n", uri, said.first, said.last.reason);
            wrong++;
        }
    }
    print_message("knocked by 2 %%: %d of %d reported, the latest after %d frames\n",
                  plan.runs - wrong, plan.runs, latest);
    assert_int_equal(wrong, 0);
}

/* A map that was steady for few frames only, since it was begun or entered, does not tell a lens
 * that moved from a wrong file. The largest difference is kept. */
static void a_knock_of_a_young_map_is_a_wrong_file(void **state)
{
    const struct plan plan = {1, 60, 40, "&width=320&height=240"};
    char uri[256];
    (void)state;
    source_write(uri, &plan, 0, 1.02);
    const struct said said = run(uri, 1, plan.frames);
    assert_in_range(said.first, plan.knocked, plan.frames);
    assert_int_equal(said.last.cause, FOVEA_CALIBRATION_UNFIT);
    assert_true(said.first_difference > 0.004 && said.last.focal_difference < 0.03);
    const struct plan later = plan_of();
    source_write(uri, &later, 0, 1.02);
    entered = later.knocked - 10;
    const struct said again = run(uri, 1, later.frames);
    entered = -1;
    assert_in_range(again.first, later.knocked, later.frames);
    assert_int_equal(again.last.cause, FOVEA_CALIBRATION_UNFIT);
    const struct said grows = run("sim:orbit?width=320&height=240&seed=2", 1.7, 100);
    assert_int_equal(grows.last.cause, FOVEA_CALIBRATION_UNFIT);
    assert_true(grows.last.focal_difference < grows.first_difference && grows.first_difference < 0);
}

static void a_lens_that_is_right_is_never_reported(void **state)
{
    const struct plan plan = plan_of();
    int wrong = 0;
    (void)state;
    for (int i = 0; i < plan.runs; i++) {
        char uri[256];
        source_write(uri, &plan, i, 1);
        const struct said said = run(uri, 1, plan.frames);
        assert_true(said.messages > 0);
        assert_int_equal(said.message.state, FOVEA_CALIBRATION_WARNING_T_STATE_OK);
        if (said.first < 0 && said.last.reason[0] == '\0') continue;
        print_message("%s: frame %d, %s\n", uri, said.first, said.last.reason);
        wrong++;
    }
    print_message("not knocked: %d of %d reported\n", wrong, plan.runs);
    assert_int_equal(wrong, 0);
}

static void the_message_shows_the_pattern(void **state)
{
    struct plan plan = plan_of();
    char uri[256];
    double outward = 0;
    int cells = 0;
    (void)state;
    source_write(uri, &plan, 0, 1.02);
    const struct said said = run(uri, 1, plan.frames), again = run(uri, 1, plan.frames);
    assert_int_equal(said.message.state, FOVEA_CALIBRATION_WARNING_T_STATE_WRONG);
    assert_true(said.message.rms_px > said.message.expected_px && said.message.expected_px > 0);
    for (int i = 0; i < 24; i++) { /* the picture is larger: residuals point outward */
        const int column = i % 6, row = i / 6;
        const double x = column - 2.5, y = row - 1.5;
        assert_true((said.samples[i] == 0) == (isnan(said.mean_px[i][0]) != 0));
        if (said.samples[i] < 20) continue;
        cells++;
        outward += (double)said.mean_px[i][0] * x + (double)said.mean_px[i][1] * y;
    }
    assert_true(cells >= 8 && outward / cells > 0.02);
    assert_true(said.hash == again.hash && said.first == again.first);
}

static void switched_off_it_takes_no_memory_and_says_nothing(void **state)
{
    struct fovea_config config;
    size_t with, without;
    struct fovea_error error;
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=320&height=240", 0, 1);
    config = rig.config;
    assert_int_equal(fovea_size(&config, &with, &error), FOVEA_OK);
    config.calibration.check = false;
    assert_int_equal(fovea_size(&config, &without, &error), FOVEA_OK);
    assert_true(without < with && with - without < 64 * 1024);
    rig.config.calibration.check = false;
    sim_rig_build(&rig);
    struct fovea_calibration calibration;
    assert_true(sim_rig_next(&rig));
    sim_rig_process(&rig);
    fovea_calibration_get(rig.rt, &calibration);
    assert_int_equal(calibration.state, FOVEA_CALIBRATION_OK);
    sim_rig_close(&rig);
}

/* ---- a recording ----------------------------------------------------------------------------- */

static void a_wrong_file_is_reported_on_a_drone(void **state)
{
    char uri[256];
    (void)state;
    snprintf(uri, sizeof uri, "%s/euroc_mh05_a/mav0", fv_data_folder());
    if (access(uri, R_OK) != 0) {
        print_message("SKIPPED: %s is not here\n", uri);
        return;
    }
    snprintf(uri, sizeof uri, "euroc:%s/euroc_mh05_a", fv_data_folder());
    const struct said right = run(uri, 1, 100), doubled = run(uri, 2, 100);
    assert_int_equal(right.first, -1);
    print_message("euroc_mh05_a, focal length doubled: frame %d, %s\n", doubled.first,
                  doubled.last.reason);
    assert_true(doubled.first >= 0 && doubled.first < 100);
    assert_int_equal(doubled.last.cause, FOVEA_CALIBRATION_UNFIT);
    assert_true(doubled.last.focal_difference < 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_knocked_lens_is_reported),
        cmocka_unit_test(a_knock_of_a_young_map_is_a_wrong_file),
        cmocka_unit_test(a_lens_that_is_right_is_never_reported),
        cmocka_unit_test(the_message_shows_the_pattern),
        cmocka_unit_test(switched_off_it_takes_no_memory_and_says_nothing),
        cmocka_unit_test(a_wrong_file_is_reported_on_a_drone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
