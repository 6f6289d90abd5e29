/* Odometry with two cameras of the simulation: metres from the first frame on, the second camera
 * covered, gone or late, the same bits from every kernel set, and what is refused. */
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

static struct sim_rig rig;

#define ORBIT "sim:orbit?width=400&height=300&seed=2&baseline=0.11"

static void open_rig(const char *uri, int frames, enum fovea_sensors sensors)
{
    sim_rig_open(&rig, uri, 0, frames);
    if (rig.ops->info(rig.source)->rig.camera_count > 1)
        rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.sensors = sensors;
    rig.config.odometry.keyframes = 40;
    sim_rig_build(&rig);
}

/* How far a frame's position is from the truth, from the first frame's pose: no alignment. */
static double error_m(int frame)
{
    double off = 0;
    for (int r = 0; r < 3; r++) {
        double at = rig.truth[0][4 * r + 3]; /* T_truth_0 p, p as published */
        for (int c = 0; c < 3; c++)
            at += rig.truth[0][4 * r + c] * rig.pose[frame].T_world_cam[4 * c + 3];
        off += (at - rig.truth[frame][4 * r + 3]) * (at - rig.truth[frame][4 * r + 3]);
    }
    return __builtin_sqrt(off);
}

static void expect_metric(int frame)
{
    const struct fovea_pose *pose = &rig.pose[frame];
    assert_true(pose->posed && pose->map_id == 0 && pose->reset_counter == 0);
    assert_int_equal(pose->scale_source, FOVEA_SCALE_STEREO);
    assert_true(pose->scale == 1 && pose->scale_sigma > 0.001 && pose->scale_sigma < 0.02);
}

static void a_map_begins_in_metres_with_the_first_frame(void **state)
{
    (void)state;
    open_rig(ORBIT, 60, FOVEA_SENSORS_AUTO);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    for (int n = 0; n < rig.frames; n++) {
        expect_metric(n);
        assert_true(error_m(n) < 0.015);
    }
    assert_true(sim_rig_moved(rig.truth[0], rig.truth[59]) > 0.5);
    sim_rig_close(&rig);
}

/* Black pictures, then none, then as before. */
static void the_map_stays_in_metres_while_the_second_camera_is_gone(void **state)
{
    (void)state;
    uint8_t *black = calloc(400, 300);
    struct fovea_stats stats;
    open_rig(ORBIT, 80, FOVEA_SENSORS_STEREO);
    for (int n = 0; sim_rig_next(&rig); n++) {
        const struct fovea_image seen = rig.frame.images[1];
        if (n >= 20 && n < 40) rig.frame.images[1].data = black;
        if (n >= 40 && n < 60) rig.frame.images[1] = (struct fovea_image){0};
        sim_rig_process(&rig);
        rig.frame.images[1] = seen;
        fovea_stats_get(rig.rt, &stats);
        assert_true((stats.distances > 0) == (n < 20 || n >= 60));
        expect_metric(n);
        assert_true(error_m(n) < 0.03);
    }
    assert_int_equal(rig.frames, 80);
    sim_rig_close(&rig);
    free(black);
}

/* Motion of the camera since a frame, as published and as it was: how far these are apart. */
static double keyframe_error_m(int frame, int keyframe)
{
    struct fv_se3 T, truth, back;
    double between[3];
    fv_se3_from_rows(rig.pose[frame].T_keyframe_cam, &T);
    fv_se3_from_rows(rig.truth[frame], &truth);
    fv_se3_from_rows(rig.truth[keyframe], &back);
    fv_se3_invert(&back, &back);
    fv_se3_compose(&back, &truth, &truth);
    fv_subtract3(T.t, truth.t, between);
    return fv_norm3(between);
}

/* Black pictures of the first camera, then none: poses stay those of the first camera, also beside
 * keyframes that the second has seen, which stands 0.25 m aside and looks elsewhere. */
static void the_second_camera_stands_in_for_the_first(void **state)
{
    (void)state;
    uint8_t *black = calloc(400, 300);
    static int64_t stamps[110];
    int by_second = 0;
    open_rig("sim:orbit?width=400&height=300&seed=2&camera2=0.25,0.02,-0.03,5,-8,12", 110,
             FOVEA_SENSORS_AUTO);
    for (int n = 0; sim_rig_next(&rig); n++) {
        const struct fovea_image seen = rig.frame.images[0];
        stamps[n] = rig.frame.stamp_ns;
        if (n >= 20 && n < 40) rig.frame.images[0].data = black;
        if (n >= 40 && n < 90) rig.frame.images[0] = (struct fovea_image){0};
        sim_rig_process(&rig);
        rig.frame.images[0] = seen;
        expect_metric(n);
        assert_true(error_m(n) < 0.03);
        int keyframe = n;
        while (keyframe > 0 && stamps[keyframe] != rig.pose[n].keyframe_stamp_ns)
            keyframe--;
        by_second += keyframe >= 20 && keyframe < 90 && keyframe != n;
        assert_true(keyframe_error_m(n, keyframe) < 0.01);
    }
    assert_int_equal(rig.frames, 110);
    assert_true(by_second > 20);
    sim_rig_close(&rig);
    free(black);
}

/* The second camera hangs on one picture: its distances contradict the map, and are left out. */
static void a_second_camera_that_hangs_does_not_bend_the_path(void **state)
{
    (void)state;
    uint8_t *hung = malloc(400 * 300);
    open_rig(ORBIT, 70, FOVEA_SENSORS_AUTO);
    for (int n = 0; sim_rig_next(&rig); n++) {
        const struct fovea_image seen = rig.frame.images[1];
        if (n == 20)
            for (int y = 0; y < 300; y++)
                memcpy(hung + y * 400, seen.data + (size_t)y * (size_t)seen.stride_bytes, 400);
        if (n > 20) {
            rig.frame.images[1].data = hung;
            rig.frame.images[1].stride_bytes = 400;
        }
        sim_rig_process(&rig);
        rig.frame.images[1] = seen;
        expect_metric(n);
        assert_true(error_m(n) < 0.03);
    }
    sim_rig_close(&rig);
    free(hung);
}

/* Covered from the start, odometry begins with the first camera, in a unit of its own; distances
 * give its metres as soon as there are some. */
static void a_map_begun_with_one_camera_gets_its_metres_from_two(void **state)
{
    (void)state;
    int first = 0;
    open_rig(ORBIT, 90, FOVEA_SENSORS_AUTO);
    for (int n = 0; sim_rig_next(&rig); n++) {
        const struct fovea_image seen = rig.frame.images[1];
        if (n < 60) rig.frame.images[1].data = NULL;
        sim_rig_process(&rig);
        rig.frame.images[1] = seen;
        const struct fovea_pose *pose = &rig.pose[n];
        if (n < 60) assert_int_equal(pose->scale_source, FOVEA_SCALE_FREE);
        if (first == 0 && pose->scale_source == FOVEA_SCALE_STEREO) first = n;
    }
    assert_true(rig.pose[59].posed && first >= 60 && first < 75);
    const struct fovea_pose *last = &rig.pose[89];
    const double ratio = sim_rig_moved(last->T_world_cam, rig.pose[first].T_world_cam) /
                         sim_rig_moved(rig.truth[89], rig.truth[first]);
    assert_true(last->map_id == 0 && last->scale != 1 && last->scale_sigma < 0.03);
    assert_true(__builtin_fabs(ratio - 1) < 3 * last->scale_sigma);
    sim_rig_close(&rig);
}

/* Squared distance of a frame's place before its reference keyframe from the true one, over its
 * variance. */
static double squared_error(int frame, int keyframe)
{
    const struct fovea_pose *pose = &rig.pose[frame];
    const double *T = rig.truth[keyframe];
    double sum = 0;
    for (int r = 0; r < 3; r++) {
        double true_m = 0;
        for (int i = 0; i < 3; i++)
            true_m += T[4 * i + r] * (rig.truth[frame][4 * i + 3] - T[4 * i + 3]);
        const double off = true_m - pose->T_keyframe_cam[4 * r + 3];
        sum += off * off;
    }
    return sum / (pose->covariance[0] + pose->covariance[6] + pose->covariance[11]);
}

/* Behind pictures with noise a frame has none, and its reference keyframe still has. The noise is
 * taken for the camera's usual one, or no picture of it would become a keyframe. */
static void a_keyframe_with_noise_counts_as_what_it_is(void **state)
{
    enum { FIRST = 50, LENGTH = 10, BEHIND = 20, SEEDS = 3 };
    double sum = 0;
    int count = 0;
    (void)state;
    for (int seed = 1; seed <= SEEDS; seed++) {
        char uri[160];
        int64_t stamps[FIRST + LENGTH];
        snprintf(uri, sizeof uri,
                 "fault:sim:orbit?width=320&height=240&baseline=0.11&seed=%d?"
                 "kind=noise&amount=50&first=%d&shortest=%d&longest=%d&count=1",
                 seed, FIRST, LENGTH, LENGTH);
        open_rig(uri, FIRST + LENGTH + BEHIND, FOVEA_SENSORS_AUTO);
        while (sim_rig_next(&rig)) {
            if (rig.frames < FIRST + LENGTH) stamps[rig.frames] = rig.frame.stamp_ns;
            rig.rt->odometry.state->usable.noise = 50;
            sim_rig_process(&rig);
        }
        for (int n = FIRST + LENGTH; n < rig.frames; n++)
            for (int k = FIRST; k < FIRST + LENGTH; k++) {
                if (!rig.pose[n].posed || rig.pose[n].keyframe_stamp_ns != stamps[k]) continue;
                sum += squared_error(n, k);
                count++;
            }
        sim_rig_close(&rig);
    }
    printf("%d poses behind noise: squared error %.2f of its variance\n", count, sum / count);
    assert_true(count >= 2 * BEHIND && sum / count < 1.3);
}

/* A turn has no parallax, and needs none: what it brings into view has measured distances. */
static void a_turn_on_the_spot_keeps_place_and_attitude(void **state)
{
    (void)state;
    open_rig("sim:rotate?width=400&height=300&rate=20&seed=3&baseline=0.11", 150,
             FOVEA_SENSORS_AUTO);
    double most_m = 0, most_rad = 0, farthest = 0;
    while (sim_rig_next(&rig)) {
        sim_rig_process(&rig);
        struct fv_se3 truth, first, pose;
        double R[9], turn[3];
        expect_metric(rig.frames - 1);
        fv_se3_from_rows(rig.truth[rig.frames - 1], &truth);
        fv_se3_from_rows(rig.truth[0], &first);
        fv_se3_from_rows(rig.pose[rig.frames - 1].T_world_cam, &pose);
        fv_se3_invert(&first, &first);
        fv_se3_compose(&first, &truth, &truth); /* T_world_cam */
        fv_so3_log(truth.R, turn);
        farthest = fmax(farthest, fv_norm3(turn));
        fv_multiply33_transposed(pose.R, truth.R, R);
        fv_so3_log(R, turn);
        most_rad = fmax(most_rad, fv_norm3(turn));
        most_m = fmax(most_m, error_m(rig.frames - 1));
    }
    printf("turned by %.2f rad: at most %.4f rad and %.4f m off\n", farthest, most_rad, most_m);
    assert_true(farthest > 1.5); /* nothing of the first view is left */
    assert_true(most_rad < 0.0087 && most_m < 0.05);
    sim_rig_close(&rig);
}

/* Round a ring of corridors, back to its start: the closure leaves the map in metres. */
static void a_closure_keeps_the_metres(void **state)
{
    (void)state;
    struct fovea_stats stats;
    open_rig("sim:corridor?seed=1&width=240&height=180&rate=8&baseline=0.11", 344,
             FOVEA_SENSORS_AUTO);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    fovea_stats_get(rig.rt, &stats);
    assert_true(stats.closures > 0);
    expect_metric(rig.frames - 1);
    assert_true(rig.pose[rig.frames - 1].map_scale == 1);
    sim_rig_close(&rig);
}

static void one_camera_of_a_rig_is_odometry_with_that_camera(void **state)
{
    (void)state;
    static struct fovea_pose alone[40];
    open_rig("sim:orbit?width=400&height=300&seed=2", 40, FOVEA_SENSORS_AUTO);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    memcpy(alone, rig.pose, sizeof alone);
    sim_rig_close(&rig);
    open_rig(ORBIT, 40, FOVEA_SENSORS_MONO);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    assert_true(rig.pose[39].posed);
    assert_memory_equal(alone, rig.pose, sizeof alone);
    sim_rig_close(&rig);
}

static void every_kernel_set_gives_the_same_state(void **state)
{
    (void)state;
    static const char *const sets[] = {"c", "sse4", "avx2", "avx512", "neon", "i8mm"};
    uint64_t first = 0;
    int compared = 0;
    for (size_t i = 0; i < sizeof sets / sizeof sets[0]; i++) {
        size_t bytes;
        struct fovea_error error;
        setenv("FOVEA_CPU", sets[i], 1);
        sim_rig_open(&rig, ORBIT, 0, 12);
        rig.config.rig = rig.ops->info(rig.source)->rig;
        rig.config.odometry.keyframes = 8;
        if (fovea_size(&rig.config, &bytes, &error)) fail_msg("%s", error.text);
        rig.rt = NULL;
        void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
        if (fovea_init(memory, bytes, &rig.config, &rig.rt, &error) == FOVEA_OK) {
            while (sim_rig_next(&rig))
                sim_rig_process(&rig);
            const uint64_t hash = fovea_state_hash(rig.rt);
            assert_true(rig.pose[11].posed);
            if (compared++ == 0) first = hash;
            assert_true(hash == first);
        }
        rig.rt = memory;
        sim_rig_close(&rig);
    }
    unsetenv("FOVEA_CPU");
    assert_true(compared > 1);
}

static void expect_refused(const char *part)
{
    size_t bytes;
    struct fovea_error error;
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    if (strstr(error.text, part) == NULL) fail_msg("found '%s', expected '%s'", error.text, part);
    rig.config.odometry.sensors = FOVEA_SENSORS_AUTO; /* which makes do with the first */
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_OK);
    rig.config.odometry.sensors = FOVEA_SENSORS_STEREO;
}

static void stereo_is_refused_without_two_cameras_that_serve(void **state)
{
    (void)state;
    size_t both, bytes;
    struct fovea_error error;
    sim_rig_open(&rig, ORBIT, 0, 1);
    const struct fovea_rig whole = rig.ops->info(rig.source)->rig;
    rig.config.rig = whole;
    rig.config.odometry.sensors = FOVEA_SENSORS_STEREO;
    assert_int_equal(fovea_size(&rig.config, &both, &error), FOVEA_OK);
    rig.config.rig.camera_count = 1;
    expect_refused("found stereo with one camera");
    assert_int_equal(
        (rig.config.odometry.sensors = FOVEA_SENSORS_MONO, fovea_size(&rig.config, &bytes, &error)),
        FOVEA_OK);
    assert_true(bytes < both && 10 * both < 18 * bytes);
    rig.config.odometry.sensors = FOVEA_SENSORS_STEREO;
    rig.config.rig = whole;
    rig.config.rig.cameras[1].calibrated = false;
    expect_refused("a second camera without a calibration");
    rig.config.rig = whole;
    rig.config.rig.cameras[1].has_T_body_cam = false;
    expect_refused("a second camera without T_body_cam");
    rig.config.rig = whole;
    memcpy(rig.config.rig.cameras[1].T_body_cam, whole.cameras[0].T_body_cam,
           sizeof whole.cameras[0].T_body_cam);
    expect_refused("less than 5 mm from the first");
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_map_begins_in_metres_with_the_first_frame),
        cmocka_unit_test(the_map_stays_in_metres_while_the_second_camera_is_gone),
        cmocka_unit_test(the_second_camera_stands_in_for_the_first),
        cmocka_unit_test(a_second_camera_that_hangs_does_not_bend_the_path),
        cmocka_unit_test(a_map_begun_with_one_camera_gets_its_metres_from_two),
        cmocka_unit_test(a_keyframe_with_noise_counts_as_what_it_is),
        cmocka_unit_test(a_turn_on_the_spot_keeps_place_and_attitude),
        cmocka_unit_test(a_closure_keeps_the_metres),
        cmocka_unit_test(one_camera_of_a_rig_is_odometry_with_that_camera),
        cmocka_unit_test(every_kernel_set_gives_the_same_state),
        cmocka_unit_test(stereo_is_refused_without_two_cameras_that_serve),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
