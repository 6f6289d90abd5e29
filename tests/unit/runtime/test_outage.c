/* An outage of the camera, at the runtime: the pose is `lost` with the first step that hears of it,
 * and the camera is found again in the map, where it comes back to what it saw before. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "common/sim_body.h"
#include "common/sim_rig.h"
#include "fovea_pose_t.h"
#include "geometry/se3.h"
#include "geometry/vec.h"

enum { BEFORE = 24, BACK_AT = 8, AFTER = 14, FOUND_WITHIN = 5 };
#define ORBIT "sim:orbit?width=320&height=240&lens=pinhole&fov=70&rate=3"

static struct sim_rig rig;

static bool publishes(const char *channel)
{
    for (uint32_t i = 0; i < rig.outputs.message_count; i++)
        if (strcmp(rig.outputs.messages[i].channel, channel) == 0) return true;
    return false;
}

static enum fovea_tracking_state step_without_frame(enum fovea_source_state state)
{
    struct fovea_inputs inputs = {.now_ns = rig.frame.stamp_ns, .source_state = state};
    struct fovea_pose pose;
    fovea_grants_fixed(&rig.config, &inputs.grants);
    assert_int_equal(fovea_step(rig.rt, &inputs, &rig.outputs), FOVEA_AGAIN);
    fovea_pose_get(rig.rt, &pose);
    return pose.state;
}

static void lost_and_found(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sequence:" ORBIT "[frames=24] then " ORBIT "[start=8,frames=14]", 0, 0);
    sim_rig_build(&rig);
    while (rig.frames < BEFORE && sim_rig_next(&rig))
        sim_rig_process(&rig);
    assert_int_equal(rig.frames, BEFORE);
    assert_int_equal(rig.pose[BEFORE - 1].state, FOVEA_TRACKING_OK);

    /* A late frame is waited for; from stalled on there is nothing to go on from. The loss
     * is published once, at once. */
    assert_int_equal(step_without_frame(FOVEA_SOURCE_LATE), FOVEA_TRACKING_OK);
    assert_false(publishes("FOVEA_POSE"));
    assert_int_equal(step_without_frame(FOVEA_SOURCE_GONE), FOVEA_TRACKING_LOST);
    assert_true(publishes("FOVEA_POSE"));
    for (int k = 0; k < 10; k++) {
        assert_int_equal(step_without_frame(k < 8 ? FOVEA_SOURCE_GONE : FOVEA_SOURCE_RETURNING),
                         FOVEA_TRACKING_LOST);
        assert_false(publishes("FOVEA_POSE"));
    }

    /* It comes back a third of the way before where it was lost. */
    int found = -1;
    while (sim_rig_next(&rig)) {
        sim_rig_process(&rig);
        if (found < 0 && rig.pose[rig.frames - 1].state == FOVEA_TRACKING_OK)
            found = rig.frames - 1;
    }
    assert_int_equal(rig.frames, BEFORE + AFTER);
    if (found < BEFORE || found >= BEFORE + FOUND_WITHIN)
        fail_msg("found again at frame %d", found);
    assert_int_equal(rig.pose[rig.frames - 1].state, FOVEA_TRACKING_OK);
    assert_int_equal(rig.pose[rig.frames - 1].reset_counter, rig.pose[BEFORE - 1].reset_counter);
    const double way =
        sim_rig_moved(rig.pose[BACK_AT].T_world_cam, rig.pose[BEFORE - 1].T_world_cam);
    for (int k = found; k < rig.frames; k++) { /* each view as the first time */
        const int first = k - BEFORE + BACK_AT;
        const double off = sim_rig_moved(rig.pose[k].T_world_cam, rig.pose[first].T_world_cam);
        if (off > 0.05 * way)
            fail_msg("frame %d: %.1f %% of the way off frame %d", k, 100 * off / way, first);
    }
    sim_rig_close(&rig);
}

/* How far two bodies are apart, and by how much turned. */
static double apart(const fovea_pose_t *a, const fovea_pose_t *b, double *turn)
{
    double A[9], B[9], between[9], r[3], d[3];
    fv_so3_from_quaternion(a->orientation, A);
    fv_so3_from_quaternion(b->orientation, B);
    fv_multiply33_transposed(A, B, between);
    fv_so3_log(between, r);
    fv_subtract3(a->position, b->position, d);
    *turn = fv_norm3(r);
    return fv_norm3(d);
}

/* Black pictures for longer than poses go on without them, and then a place that was not seen
 * before: another map begins, in the same `odom`, upright. */
static void another_map_goes_on_in_odom(void **state)
{
    (void)state;
    static fovea_pose_t body, last;
    int begun = 0;
    double turn;
    sim_rig_open(&rig,
                 "fault:sim:orbit?seed=203&rate=20&imu=200&baseline=0.11&width=400&height=300?"
                 "kind=black&first=180&shortest=40&longest=40&count=1",
                 0, 240);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = FOVEA_SENSORS_AUTO;
    rig.config.odometry.keyframes = 40;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        sim_rig_process(&rig);
        sim_body_take(&rig, &body);
        const int n = rig.frames - 1;
        if (n == 179) {
            assert_int_equal(body.change_count, 1);
            assert_true(body.gravity_sigma > 0);
        }
        if (n >= 180) {
            const double way = sim_rig_moved(rig.truth[n - 1], rig.truth[n]);
            assert_int_equal(body.reset_counter, 0);
            assert_int_equal(body.change_count, 1);
            assert_true(body.gravity_sigma > 0);
            const double step = apart(&body, &last, &turn);
            assert_true(fabs(step - way) < 0.02 && turn < 0.1);
            if (body.map_id != last.map_id) begun = n;
            assert_true(isfinite(body.velocity[0]) || begun == n); /* behind it by one way */
        }
        last = body; /* but for what it points to */
    }
    assert_true(begun >= 220 && begun < 223);
    const double moved = sim_rig_moved(rig.pose[179].T_world_cam, rig.pose[239].T_world_cam),
                 truth = sim_rig_moved(rig.truth[179], rig.truth[239]);
    assert_true(fabs(moved - truth) < 0.1);
    assert_true(sim_body_gravity_error(&rig, &body) < 3.5 * body.gravity_sigma);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lost_and_found),
        cmocka_unit_test(another_map_goes_on_in_odom),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
