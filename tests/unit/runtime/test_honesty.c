/* Odometry is honest on the simulated camera: standing, turning on the spot, carried off, followed. Short by default;
 * with FOVEA_LONG set, at full size and length (tools/campaign.sh). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/sim_rig.h"

static struct sim_rig rig;
static bool all; /* full length */

static void run(const char *trajectory, int seed, int start, int frames)
{
    char uri[128];
    snprintf(uri, sizeof uri, "sim:%s?seed=%d%s", trajectory, seed, all ? "" : "&width=400&height=300");
    sim_rig_open(&rig, uri, start, frames);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) sim_rig_process(&rig);
    sim_rig_close(&rig);
}

/* Median of what the truth's depth map holds when the camera stands. */
static double scene_depth_m(int seed)
{
    static struct fovea_truth truth;
    char uri[64];
    uint32_t below = 0, pixels = 64 * 64;
    double low = 0.1, high = 50;
    snprintf(uri, sizeof uri, "sim:stand?seed=%d&width=64&height=64", seed);
    sim_rig_open(&rig, uri, 200, 1);
    assert_int_equal(rig.ops->dequeue(rig.source, INT64_MAX, &rig.frame), FOVEA_OK);
    assert_int_equal(rig.ops->truth(rig.source, &rig.frame, &truth), FOVEA_OK);
    for (int step = 0; step < 40; step++) {
        double middle = 0.5 * (low + high);
        below = 0;
        for (uint32_t i = 0; i < pixels; i++)
            below += (double)truth.depth_m[i] < middle;
        *(2 * below > pixels ? &high : &low) = middle;
    }
    sim_rig_close(&rig);
    return low;
}

/* Mean place of a second from frame n on. */
static void mean_place(int n, double place[12])
{
    memset(place, 0, 12 * sizeof *place);
    for (int k = n; k < n + 30; k++)
        for (int i = 3; i < 12; i += 4)
            place[i] += rig.pose[k].T_world_cam[i] / 30;
}

/* After a walk of 6 s, five minutes of standing: no more than 1 mm per metre of depth, no keyframe. */
static void standing_still_does_not_drift(void **state)
{
    (void)state;
    const int stands = 210; /* a second after the last motion */
    double depth_m = scene_depth_m(1);
    run("stand", 1, 0, all ? 9180 : 400);
    double first[12], place[12], drift = 0, shake = 0;
    double metres = 1 / sim_rig_scale(&rig, 60, 180);
    mean_place(stands, first);
    for (int n = stands; n < rig.frames; n++) {
        assert_true(rig.pose[n].posed && rig.pose[n].map_id == rig.pose[stands].map_id);
        assert_int_equal(rig.pose[n].keyframes, rig.pose[stands].keyframes);
        assert_int_equal(rig.pose[n].reference_keyframe, rig.pose[stands].reference_keyframe);
        shake = fmax(shake, sim_rig_moved(first, rig.pose[n].T_world_cam));
        if (n + 30 > rig.frames) continue;
        mean_place(n, place);
        drift = fmax(drift, sim_rig_moved(first, place));
    }
    printf("standing for %.0f s at %.2f m: drift %.3f mm per metre, largest deviation of a frame %.3f\n",
           (rig.frames - stands) / 30.0, depth_m, 1e3 * drift * metres / depth_m, 1e3 * shake * metres / depth_m);
    assert_true(drift * metres / depth_m < 0.001);
}

/* Never moved at all, things moving about: there is no pose to give. */
static void who_never_moved_has_no_pose(void **state)
{
    (void)state;
    run("still", 1, 0, all ? 900 : 60);
    for (int n = 0; n < rig.frames; n++)
        assert_true(!rig.pose[n].posed && rig.pose[n].state == FOVEA_TRACKING_STARTING);
}

static void turning_is_never_translation(void **state)
{
    (void)state;
    for (int seed = 1; seed <= (all ? 10 : 1); seed++) {
        int posed = 0;
        run("rotate", seed, 0, all ? 900 : 120);
        for (int n = 0; n < rig.frames; n++)
            posed += rig.pose[n].posed;
        printf("rotate, seed %d: %d of %d frames posed\n", seed, posed, rig.frames);
        assert_int_equal(posed, 0);
    }
}

/* Carried off at frame 420: five frames later it is lost, and while away no pose is in the old map's world. */
static void being_carried_off_is_noticed(void **state)
{
    (void)state;
    for (int seed = 1; seed <= (all ? 20 : 1); seed++) {
        const int start = all ? 0 : 330, gone = 420 - start, back = 510 - start;
        run("kidnap", seed, start, (all ? 510 : 450) - start);
        assert_true(rig.pose[gone - 1].posed);
        int lost = gone;
        while (lost < rig.frames && rig.pose[lost].state != FOVEA_TRACKING_LOST) lost++;
        printf("kidnap, seed %d: lost after %d frames\n", seed, lost - gone + 1);
        assert_true(lost - gone < 5);
        for (int n = gone + 5; n < back && n < rig.frames; n++)
            assert_true(!rig.pose[n].posed || rig.pose[n].map_id != rig.pose[gone - 1].map_id);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(standing_still_does_not_drift),
        cmocka_unit_test(who_never_moved_has_no_pose),
        cmocka_unit_test(turning_is_never_translation),
        cmocka_unit_test(being_carried_off_is_noticed),
    };
    all = getenv("FOVEA_LONG") != NULL;
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_honesty: minutes under an emulator");
        return 0;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
