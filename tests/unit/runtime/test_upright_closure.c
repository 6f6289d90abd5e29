/* A loop that is closed with an inertial sensor: the correction turns the map about gravity alone,
 * so that what keyframes have for down is as right after it as before, and places are better. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/run/trajectory.h"
#include "base/elementary.h"
#include "common/sim_body.h"
#include "fovea/fovea.h"
#include "geometry/vec.h"
#include "runtime/state.h"

enum { FRAMES = 780 }; /* 39 s: once round in 36 */

static struct sim_rig rig;
static int64_t stamps[FRAMES];
static fovea_pose_t body;

static const double *truth_at(int64_t stamp_ns)
{
    for (int i = 0; i < rig.frames; i++)
        if (stamps[i] == stamp_ns) return rig.truth[i];
    fail_msg("a keyframe of no frame");
    return NULL;
}

/* Of the keyframes of the current map. */
struct quality {
    double tilt;  /* rms angle between the map's gravity and the true one by the keyframe, rad */
    double place; /* rms distance from the truth after the best similarity, m */
};

static struct quality judge_map(void)
{
    const struct fv_map *map = &rig.rt->odometry.map;
    const double down[3] = {0, 0, -1}, origin[3] = {0, 0, 0};
    struct fv_similarity_sums sums = {0};
    struct quality quality = {0, 0};
    struct fv_map_gravity gravity;
    uint32_t count = 0;
    double R[9], t[3], scale;
    assert_true(fv_map_gravity_of(map, map->state->map_id, &gravity));
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        if (!keyframe->used) continue;
        const double *T = truth_at(keyframe->stamp_ns), at[3] = {T[3], T[7], T[11]};
        double own[3], in_map[3], across[3], centre[3];
        for (int i = 0; i < 9; i++)
            R[i] = T[4 * (i / 3) + i % 3];
        fv_rotate_back3(R, down, own);
        fv_rotate_back3(keyframe->T_cam_world.R, own, in_map);
        fv_cross3(in_map, gravity.down, across);
        quality.tilt += fv_dot3(across, across);
        fv_se3_apply_inverse(&keyframe->T_cam_world, origin, centre);
        fv_similarity_add(&sums, centre, at);
        count++;
    }
    quality.tilt = sqrt(quality.tilt / count);
    assert_true(fv_similarity_fit(&sums, &scale, R, t, &quality.place));
    return quality;
}

/* Run until a closure has been made; the map's quality before it and after. */
static void close_loop(const char *uri, enum fovea_sensors sensors, struct quality quality[2])
{
    bool judged = false;
    sim_rig_open(&rig, uri, 0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = sensors;
    sim_rig_build(&rig);
    const struct fv_closure_state *closure = rig.rt->odometry.closure.state;
    while (closure->counts.closed == 0 && sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        stamps[rig.frames] = rig.frame.stamp_ns;
        if (closure->phase >= FV_CLOSURE_GRAPH && !judged) {
            quality[0] = judge_map();
            judged = true;
        }
        sim_rig_process(&rig);
    }
    assert_true(judged && closure->counts.closed == 1);
    quality[1] = judge_map();
    /* The next frame's message says what the correction did to map and odom. */
    assert_true(sim_rig_next(&rig));
    sim_rig_take_samples(&rig);
    stamps[rig.frames] = rig.frame.stamp_ns;
    sim_rig_process(&rig);
    sim_body_take(&rig, &body);
}

static void a_closure_turns_the_map_about_gravity(void **state)
{
    (void)state;
    static const struct {
        const char *uri;
        enum fovea_sensors sensors;
    } runs[] = {
        {"sim:corridor?width=320&height=240&rate=20&imu=200&seed=2&baseline=0.12",
         FOVEA_SENSORS_STEREO_INERTIAL},
        {"sim:corridor?width=320&height=240&rate=20&imu=200&seed=3", FOVEA_SENSORS_MONO_INERTIAL}};
    for (int i = 0; i < 2; i++) {
        struct quality quality[2];
        close_loop(runs[i].uri, runs[i].sensors, quality);
        print_message("%s: tilts of keyframes %.3f, then %.3f degrees; places %.1f, then %.1f mm\n",
                      runs[i].uri, quality[0].tilt * 180 / FV_PI, quality[1].tilt * 180 / FV_PI,
                      1e3 * quality[0].place, 1e3 * quality[1].place);
        assert_true(quality[1].tilt < quality[0].tilt + 3e-4);
        assert_true(quality[1].place < 0.7 * quality[0].place);
        double across[3]; /* gravity as it is said in odom, whose z is that of the first estimate */
        fv_cross3(body.map_orientation + 1, body.gravity, across);
        const double tilt = 2 * fv_norm3(across) / 9.80665,
                     turn = 2 * fv_norm3(body.map_orientation + 1);
        print_message("map over odom: turned by %.3f degrees, tilted by %.4f\n", turn * 180 / FV_PI,
                      tilt * 180 / FV_PI);
        assert_true(turn > 5e-4 && tilt < 0.01 * turn);
        assert_true(body.map_scale == 1 && body.scale_state == FOVEA_POSE_T_SCALE_METRIC);
        sim_rig_close(&rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_closure_turns_the_map_about_gravity)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
