/* The path after all optimisation has the scale of the map, not that of the last place. */
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

#include "app/run/final_path.h"
#include "common/sim_rig.h"
#include "geometry/se3.h"

static struct sim_rig rig;

/* With the samples of its inertial sensor; true as long as frames come. */
static bool next(struct fv_final *final)
{
    if (!sim_rig_next(&rig)) return false;
    sim_rig_take_samples(&rig);
    sim_rig_process(&rig);
    const struct fovea_pose *pose = &rig.pose[rig.frames - 1];
    struct fv_trajectory_sample sample = {.stamp_ns = rig.frame.stamp_ns, .map = pose->map_id};
    memcpy(sample.T_world_cam, pose->T_world_cam, sizeof sample.T_world_cam);
    if (pose->posed) fv_final_frame(final, pose, &sample);
    fv_final_observe(final, rig.rt);
    fv_final_drain(final);
    return true;
}

/* Where the last frame's keyframe has ended puts that frame, in units of the map. */
static void place_of_last(double place[3])
{
    static struct fovea_keyframe list[FOVEA_ODOMETRY_KEYFRAMES_MAX];
    const struct fovea_pose *pose = &rig.pose[rig.frames - 1];
    const uint32_t count = fovea_keyframes_get(rig.rt, list, FOVEA_ODOMETRY_KEYFRAMES_MAX);
    struct fv_se3 T, T_keyframe_cam;
    for (uint32_t i = 0; i < count; i++) {
        if (!list[i].used || list[i].number != pose->reference_keyframe) continue;
        fv_se3_from_rows(list[i].T_world_cam, &T);
        fv_se3_from_rows(pose->T_keyframe_cam, &T_keyframe_cam);
        fv_se3_compose(&T, &T_keyframe_cam, &T);
        memcpy(place, T.t, sizeof T.t);
        return;
    }
    fail_msg("the last frame's keyframe is gone");
}

static void a_final_path_has_the_scale_of_the_map(void **state)
{
    (void)state;
    char path[] = "/tmp/fovea_final_XXXXXX", line[512], last[512] = "";
    struct fovea_error error;
    struct fv_trajectory_summary summary;
    struct fv_final *final;
    double place[3], written[3], stamp_s;
    close(mkstemp(path));
    sim_rig_open(&rig, "sim:orbit?width=400&height=300&rate=20&imu=200&seed=4", 0, 160);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = FOVEA_SENSORS_MONO_INERTIAL;
    sim_rig_build(&rig);
    assert_int_equal(fv_final_open(path, &final, &error), FOVEA_OK);
    while (next(final))
        continue;
    const struct fovea_pose *pose = &rig.pose[rig.frames - 1];
    assert_true(pose->scale_source == FOVEA_SCALE_INERTIAL);
    fv_final_finish(final, rig.rt, &summary);
    const double scale = fovea_map_scale_get(rig.rt, pose->map_id);
    print_message("%.4f m per unit of the map, %.4f at the end\n", scale, pose->scale);
    assert_true(fabs(scale / pose->scale - 1) > 1e-4 && fabs(scale / pose->scale - 1) < 0.1);
    FILE *file = fopen(path, "r");
    while (fgets(line, sizeof line, file) != NULL)
        if (line[0] != '#') memcpy(last, line, sizeof last);
    fclose(file);
    assert_int_equal(sscanf(last, "%lf %lf %lf %lf", &stamp_s, written, written + 1, written + 2),
                     4);
    place_of_last(place);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(written[i] - scale * place[i]) < 1e-6);
    assert_true(fovea_map_scale_get(rig.rt, pose->map_id + 1) == 0);
    fv_final_close(final);
    unlink(path);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_final_path_has_the_scale_of_the_map)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
