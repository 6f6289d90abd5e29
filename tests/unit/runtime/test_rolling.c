/* Rolling shutter: with two cameras and an inertial sensor, a camera whose readout is stated goes
 * its way nearly as with a global shutter; without a stated readout it does not. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "fovea/fovea.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "runtime/state.h"

enum { FRAMES = 90, APART = 10 };

static struct sim_rig rig;

static void run(const char *uri, bool stated)
{
    sim_rig_open(&rig, uri, 0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    for (uint32_t i = 0; i < rig.config.rig.camera_count; i++)
        rig.config.rig.cameras[i].has_readout &= stated;
    rig.config.odometry.keyframes = 40;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        sim_rig_process(&rig);
    }
    assert_int_equal(rig.frames, FRAMES);
}

/* Motion from frame a to frame b, as seen at a. */
static struct fv_se3 between(const double a[12], const double b[12])
{
    struct fv_se3 T_a, T_b, inverse, out;
    fv_se3_from_rows(a, &T_a);
    fv_se3_from_rows(b, &T_b);
    fv_se3_invert(&T_a, &inverse);
    fv_se3_compose(&inverse, &T_b, &out);
    return out;
}

struct errors {
    double m, rad; /* root mean square over APART frames */
};

static struct errors errors_of(const char *uri, bool stated)
{
    struct errors e = {0};
    int count = 0;
    run(uri, stated);
    for (int n = APART; n < FRAMES; n++) {
        const struct fovea_pose *a = &rig.pose[n - APART], *b = &rig.pose[n];
        if (!a->posed || !b->posed || a->reset_counter != b->reset_counter) continue;
        const struct fv_se3 found = between(a->T_world_cam, b->T_world_cam),
                            truth = between(rig.truth[n - APART], rig.truth[n]);
        double t[3], R[9], w[3];
        fv_subtract3(found.t, truth.t, t);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                R[3 * r + c] = truth.R[r] * found.R[c] + truth.R[3 + r] * found.R[3 + c] +
                               truth.R[6 + r] * found.R[6 + c];
        fv_so3_log(R, w);
        e.m += fv_dot3(t, t);
        e.rad += fv_dot3(w, w);
        count++;
    }
    sim_rig_close(&rig);
    assert_true(count > FRAMES / 2);
    e.m = sqrt(e.m / count);
    e.rad = sqrt(e.rad / count);
    print_message("  %s, readout %s: %.2f mm, %.2f mrad over %d frames\n", uri,
                  stated ? "stated" : "not stated", 1e3 * e.m, 1e3 * e.rad, APART);
    return e;
}

/* `times`: by how much the error is less where the readout is stated. */
static void the_way_is_that_of_a_global_shutter(const char *scene, double times)
{
    char uri[160];
    (void)snprintf(uri, sizeof uri,
                   "sim:%s?width=400&height=300&rate=20&imu=200&baseline=0.11&seed=4", scene);
    const struct errors global = errors_of(uri, true);
    (void)strcat(uri, "&rolling=1&readout=20");
    const struct errors rolling = errors_of(uri, true), unknown = errors_of(uri, false);
    assert_true(rolling.m < 2 * global.m + 0.001 && rolling.rad < 2 * global.rad + 0.0005);
    assert_true(unknown.m > times * rolling.m);
}

/* A sensor's bias is no turn: pictures of a camera that hardly turns are not moved by it. */
static void a_bias_moves_nothing(void **state)
{
    (void)state;
    const char *uri =
        "sim:corridor?width=400&height=300&rate=20&imu=200&baseline=0.11&seed=4&rolling=1"
        "&readout=40&gyro_bias=0.1";
    const struct errors biased = errors_of(uri, true), unknown = errors_of(uri, false);
    assert_true(biased.m < 1.15 * unknown.m && biased.rad < 1.15 * unknown.rad);
}

/* Until the bias is known, what may be the bias is no turn; then the rate is that of the truth. */
static void slow_turns_wait_for_the_bias(void **state)
{
    (void)state;
    double rate[3];
    int unknown = 0;
    sim_rig_open(
        &rig,
        "sim:corridor?width=320&height=240&rate=20&imu=200&baseline=0.11&seed=4&gyro_bias=0.03", 0,
        FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        sim_rig_process(&rig);
        const bool known = fv_inertial_stage_rate(&rig.rt->inertial, rig.frame.stamp_ns, rate);
        unknown += !known;
        if (rig.frames > 20) assert_true(known);
        if (!known || rig.frames < 2) continue;
        const struct fv_se3 turn = between(rig.truth[rig.frames - 2], rig.truth[rig.frames - 1]);
        double w[3];
        fv_so3_log(turn.R, w);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(rate[k] - 20 * w[k]) < 0.05);
    }
    assert_true(unknown > 2);
    sim_rig_close(&rig);
}

static void fast_turns(void **state)
{
    (void)state;
    the_way_is_that_of_a_global_shutter("fast", 3);
}

static void a_way_sideways(void **state)
{
    (void)state;
    the_way_is_that_of_a_global_shutter("orbit", 1.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fast_turns),
        cmocka_unit_test(a_way_sideways),
        cmocka_unit_test(a_bias_moves_nothing),
        cmocka_unit_test(slow_turns_wait_for_the_bias),
    };
    const struct CMUnitTest emulated[] = {cmocka_unit_test(slow_turns_wait_for_the_bias)};
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts(
            "SKIPPED the ways of test_rolling beside those of a global shutter: minutes under an emulator");
        return cmocka_run_group_tests(emulated, NULL, NULL);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
