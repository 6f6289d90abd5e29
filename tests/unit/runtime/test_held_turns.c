/* Poses held by the gyro: over a second the camera's turns are truer than the pictures' alone, and
 * where the mount is wrong the gyro does not hold them; a gyro whose scale is off by what cheap
 * ones are makes them no worse. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "fovea/fovea.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "runtime/state.h"

enum { FRAMES = 260, FIRST = 140, APART = 20, TURNED_WRONG_MRAD = 87 };
enum setting { MONO, INERTIAL, WRONG_MOUNT, WRONG_SCALE };

static struct sim_rig rig;

static void turn_mount(struct fovea_rig *given)
{
    const double by[3] = {1e-3 * TURNED_WRONG_MRAD, 0, 0};
    struct fv_se3 T, wrong = {{0}, {0, 0, 0}};
    fv_so3_exp(by, wrong.R);
    fv_se3_from_rows(given->imu.T_body_imu, &T);
    fv_se3_compose(&T, &wrong, &T);
    fv_se3_to_rows(&T, given->imu.T_body_imu);
}

static void run(const char *uri, enum setting setting)
{
    sim_rig_open_kept(&rig, uri, 0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = setting == MONO ? FOVEA_SENSORS_MONO : FOVEA_SENSORS_AUTO;
    if (setting == WRONG_MOUNT) turn_mount(&rig.config.rig);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        for (uint32_t i = 0; setting == WRONG_SCALE && i < rig.inputs.sample_count; i++)
            for (int k = 0; k < 3; k++)
                rig.samples[i].imu.gyro[k] *= 1.01;
        sim_rig_process(&rig);
    }
    /* What two pictures ask of the map leaves a turn alone that a known gyro has measured. */
    if (setting == MONO || setting == INERTIAL)
        assert_int_equal(rig.rt->odometry.state->agreement.motion_bias.held, setting == INERTIAL);
}

/* By which small turn the pose of frame b turned away from that of frame a more than the truth. */
static void error_of(const double pose_a[12], const double pose_b[12], const double true_a[12],
                     const double true_b[12], double error[3])
{
    double found[9], truth[9], E[9];
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            found[3 * r + c] = truth[3 * r + c] = 0;
            for (int k = 0; k < 3; k++) {
                found[3 * r + c] += pose_a[4 * k + r] * pose_b[4 * k + c];
                truth[3 * r + c] += true_a[4 * k + r] * true_b[4 * k + c];
            }
        }
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            E[3 * r + c] =
                truth[r] * found[c] + truth[3 + r] * found[3 + c] + truth[6 + r] * found[6 + c];
    fv_so3_log(E, error);
}

/* Root mean square error of the turns of a second, mrad, once the gyro is known. */
static double errors_of(const char *uri, enum setting setting)
{
    double square = 0;
    int count = 0;
    run(uri, setting);
    for (int n = FIRST + APART; n < rig.frames; n++) {
        const struct fovea_pose *a = &rig.pose[n - APART], *b = &rig.pose[n];
        double e[3];
        if (!a->posed || !b->posed || a->reset_counter != b->reset_counter) continue;
        error_of(a->T_world_cam, b->T_world_cam, rig.truth[n - APART], rig.truth[n], e);
        square += fv_dot3(e, e);
        count++;
    }
    sim_rig_close(&rig);
    assert_true(count > (FRAMES - FIRST - APART) / 2);
    return 1e3 * sqrt(square / count);
}

static void compare(const char *uri)
{
    const double mono = errors_of(uri, MONO), inertial = errors_of(uri, INERTIAL),
                 wrong = errors_of(uri, WRONG_MOUNT), scaled = errors_of(uri, WRONG_SCALE);
    print_message(
        "%s: turns of a second are off by %.2f mrad by pictures, %.2f with the gyro, "
        "%.2f with one whose mount is wrong, %.2f with one whose scale is 1 %% too large\n",
        uri, mono, inertial, wrong, scaled);
    assert_true(inertial < 0.75 * mono);
    assert_true(wrong < 1.35 * mono); /* matches are searched for by what it says, and no more */
    assert_true(scaled < 1.2 * mono);
}

static void turns_are_truer(void **state)
{
    (void)state;
    compare("sim:orbit?width=400&height=300&rate=20&imu=200&gyro_bias=0.02&seed=8");
    compare("sim:wander?width=400&height=300&rate=20&imu=200&gyro_bias=0.02&seed=6");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(turns_are_truer)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
