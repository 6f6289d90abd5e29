/* An outage of the camera, at the runtime: the pose is `lost` with the first step that hears of it,
 * and the camera is found again in the map, where it comes back to what it saw before. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "common/sim_rig.h"

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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lost_and_found)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
