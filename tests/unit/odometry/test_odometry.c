/* Odometry on the simulated camera, whose truth is exact: poses, honesty when turning, standing or
 * carried off, the same bits with every kernel set. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "features/features.h"
#include "features/orb.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "geometry/linear.h"
#include "geometry/vec.h"
#include "kernels/cpu.h"
#include "odometry/odometry.h"

enum { FRAMES_MAX = 200, UNITS = 40, FEATURES = 1000, KEYFRAMES_MAX = 200 };

/* What a run left behind, frame by frame. */
struct record {
    int frames;
    struct fovea_pose pose[FRAMES_MAX];
    double truth[FRAMES_MAX][3];
    /* as the map had it at that frame */
    struct fv_se3 T_truth_cam[FRAMES_MAX], T_reference_world[FRAMES_MAX];
    int reference[FRAMES_MAX]; /* frame that became the reference keyframe */
    int64_t stamp[FRAMES_MAX];
    int born[KEYFRAMES_MAX]; /* frame of each keyframe, by number */
    /* optimised; with fewer than three steps; most frames from a keyframe to
     * the end of its window */
    int windows, hasty, late_frames;
    uint64_t hash;
};
static struct record records[2];
static uint32_t granted = FEATURES; /* of each frame */

struct rig {
    struct fv_kernels kernels;
    struct fv_pyramid pyramid;
    struct fv_features features;
    struct fv_orb orb;
    struct fv_odometry odometry;
    struct fv_arena arenas[3];
    void *memory[3];
};

static void carve(struct rig *rig, const struct fovea_camera *camera)
{
    const struct fovea_features_config features = {FEATURES, 8, 20, 7, 2, FOVEA_FEATURES_FAST};
    const struct fovea_odometry_config config = {.enabled = true,
                                                 .keyframes = 40,
                                                 .landmarks = 6000,
                                                 .window = 8,
                                                 .inliers_good = 40,
                                                 .lost_frames_reset = 15};
    struct fv_arena *frame = &rig->arenas[2];
    fv_pyramid_carve(&rig->pyramid, camera->width, camera->height, 8, frame);
    fv_features_carve(&rig->features, &features, &rig->pyramid, frame);
    fv_orb_carve(&rig->orb, FEATURES, &rig->pyramid, frame);
    fv_odometry_carve(&rig->odometry, &config, camera, FEATURES, false, false, &rig->arenas[0],
                      &rig->arenas[1], frame);
}

static void build_rig(struct rig *rig, const struct fovea_camera *camera, enum fv_cpu_set set)
{
    fv_kernels_init(&rig->kernels, set);
    for (int k = 0; k < 3; k++)
        fv_arena_count(&rig->arenas[k]);
    carve(rig, camera);
    for (int k = 0; k < 3; k++) {
        size_t bytes = (rig->arenas[k].used + 63) / 64 * 64;
        rig->memory[k] = aligned_alloc(64, bytes);
        memset(rig->memory[k], 0x5a, bytes); /* nothing may depend on what was there */
        fv_arena_init(&rig->arenas[k], rig->memory[k], bytes);
    }
    carve(rig, camera);
    fv_odometry_init(&rig->odometry, 1);
}

static void hash_pose(uint64_t *hash, const struct fovea_pose *pose)
{
    const uint8_t *bytes = (const uint8_t *)pose->T_world_cam;
    for (size_t i = 0; i < sizeof pose->T_world_cam; i++)
        *hash = (*hash ^ bytes[i]) * 1099511628211u;
    *hash = (*hash ^ pose->inliers) * 1099511628211u;
}

/* A unit of the map's job, and how the window fares. */
static void work(struct rig *rig, struct record *r)
{
    const struct fv_window *window = &rig->odometry.window;
    const struct fv_window_state *w = window->state;
    const enum fv_window_phase phase = w->phase;
    (void)fv_odometry_unit(&rig->odometry, &rig->kernels);
    if (phase == FV_WINDOW_PASS && w->phase == FV_WINDOW_DONE) r->hasty += w->pass < 1 + 3;
    if (phase != FV_WINDOW_DONE || w->phase != FV_WINDOW_IDLE) return;
    const int late = r->frames - r->born[w->keyframe_number];
    r->windows++;
    if (late > r->late_frames) r->late_frames = late;
}

static void run(const char *uri, int start, int frames, enum fv_cpu_set set, struct record *record)
{
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_error error;
    struct fovea_source *source;
    const struct fovea_source_selection all = {
        .start = (uint64_t)start, .step = 1, .frames = (uint64_t)frames};
    if (fv_source_find(uri, &ops, &address, &error) || ops->open(address, &all, &source, &error) ||
        ops->start(source, &error))
        fail_msg("%s", error.text);
    struct fovea_camera camera = ops->info(source)->rig.cameras[0].camera;
    assert_int_equal(fovea_camera_prepare(&camera, &error), FOVEA_OK);
    static struct rig rig;
    build_rig(&rig, &camera, set);
    memset(record, 0, sizeof *record);
    record->hash = 14695981039346656037u;
    struct fovea_frame frame;
    static struct fovea_truth truth;
    uint64_t keyframes = 0;
    while (record->frames < frames && ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        fv_pyramid_build(&rig.pyramid, &rig.kernels, &frame.images[0]);
        uint32_t count = fv_features_find(&rig.features, &rig.kernels, &rig.pyramid, NULL, granted);
        fv_orb_describe(&rig.orb, &rig.kernels, &rig.pyramid, rig.features.corners, count);
        const struct fv_odometry_input input = {.stamp_ns = frame.stamp_ns,
                                                .count = count,
                                                .features = rig.features.list,
                                                .descriptors = rig.orb.descriptors};
        fv_odometry_step(&rig.odometry, &rig.kernels, &input);
        const struct fv_keyframe reference = rig.odometry.map.keyframes[rig.odometry.state->newest];
        for (; keyframes < rig.odometry.map.state->keyframe_number; keyframes++)
            record->born[keyframes] = record->frames;
        assert_true(keyframes < KEYFRAMES_MAX);
        for (int unit = 0; unit < UNITS && fv_odometry_job_waiting(&rig.odometry); unit++)
            work(&rig, record);
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        int n = record->frames++;
        record->pose[n] = rig.odometry.state->pose;
        for (int i = 0; i < 3; i++)
            record->truth[n][i] = truth.T_world_cam[4 * i + 3];
        fv_se3_from_rows(truth.T_world_cam, &record->T_truth_cam[n]);
        record->T_reference_world[n] = reference.T_cam_world;
        record->stamp[n] = frame.stamp_ns;
        record->reference[n] = -1;
        for (int k = 0; k <= n; k++)
            if (record->stamp[k] == reference.stamp_ns) record->reference[n] = k;
        hash_pose(&record->hash, &record->pose[n]);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    for (int k = 0; k < 3; k++)
        free(rig.memory[k]);
}

static double travelled(const struct record *r, int a, int b, bool truth)
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double d = truth ? r->truth[b][i] - r->truth[a][i]
                         : r->pose[b].T_world_cam[4 * i + 3] - r->pose[a].T_world_cam[4 * i + 3];
        sum += d * d;
    }
    return sqrt(sum);
}

static void an_orbit_is_followed_at_constant_scale(void **state)
{
    (void)state;
    struct record *r = &records[0];
    run("sim:orbit?width=480&height=360", 0, 200, fv_cpu_best(fv_cpu_detect()), r);
    int first = 0, posed = 0;
    while (first < r->frames && !r->pose[first].posed)
        first++;
    assert_true(first <= 14);
    double low = 1e9, high = 0;
    for (int n = first; n < r->frames; n++) {
        assert_true(r->pose[n].posed && (n < first + 40 || r->pose[n].state == FOVEA_TRACKING_OK));
        assert_true(r->pose[n].inliers >= FOVEA_POSED_INLIERS_MIN && r->pose[n].covariance[0] > 0);
        posed++;
        if (n - first < 75) continue;
        double scale = travelled(r, n - 60, n, false) / travelled(r, n - 60, n, true);
        low = fmin(low, scale);
        high = fmax(high, scale);
    }
    printf("orbit: first pose %d, scale over two seconds from %.4f to %.4f\n", first, low, high);
    assert_true(posed > 150 && high / low < 1.05);
}

/* A fifth of the usual features, as a small board grants them. */
static void few_features_begin_a_map(void **state)
{
    (void)state;
    struct record *r = &records[0];
    granted = 200;
    run("sim:orbit?width=480&height=360", 0, 120, fv_cpu_best(fv_cpu_detect()), r);
    granted = FEATURES;
    int first = 0, posed = 0;
    while (first < r->frames && !r->pose[first].posed)
        first++;
    for (int n = first; n < r->frames; n++)
        posed += r->pose[n].posed;
    assert_true(first < r->frames / 2);
    assert_int_equal(posed, r->frames - first);
    const double begun =
                     travelled(r, first, first + 20, false) / travelled(r, first, first + 20, true),
                 later = travelled(r, r->frames - 21, r->frames - 1, false) /
                         travelled(r, r->frames - 21, r->frames - 1, true);
    printf("few features: first pose %d, then a scale %.3f times that at first\n", first,
           later / begun);
    assert_true(fabs(log(later / begun)) < 0.05);
}

/* Normalised squared error of a pose relative to its reference keyframe; `unit` is metres per unit
 * of the map. */
static double squared_error(const struct record *r, int n, double unit)
{
    struct fv_se3 estimate, truth, T, inverse;
    double error[6], A[36], solved[6], turn[9];
    fv_se3_from_rows(r->pose[n].T_world_cam, &T);
    fv_se3_compose(&r->T_reference_world[n], &T, &estimate);
    fv_se3_invert(&r->T_truth_cam[r->reference[n]], &inverse);
    fv_se3_compose(&inverse, &r->T_truth_cam[n], &truth);
    const double d[3] = {truth.t[0] / unit - estimate.t[0], truth.t[1] / unit - estimate.t[1],
                         truth.t[2] / unit - estimate.t[2]};
    fv_rotate_back3(estimate.R, d, error);
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            turn[3 * row + column] = estimate.R[row] * truth.R[column] +
                                     estimate.R[3 + row] * truth.R[3 + column] +
                                     estimate.R[6 + row] * truth.R[6 + column];
    fv_so3_log(turn, error + 3);
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++)
            A[6 * row + column] = A[6 * column + row] = r->pose[n].covariance[k];
    memcpy(solved, error, sizeof solved);
    assert_true(fv_ldlt_solve(A, 6, solved));
    double sum = 0;
    for (int k = 0; k < 6; k++)
        sum += error[k] * solved[k];
    return sum;
}

/* The covariance says how far off the pose is, and a pose called good is not far off. Windows are
 * done within six frames of their keyframes, in at least three steps. */
static void confidence_is_earned(void **state)
{
    (void)state;
    struct record *r = &records[0];
    double sum = 0;
    int count = 0, good = 0, false_confidence = 0;
    for (int seed = 1; seed <= 2; seed++) {
        char uri[80];
        snprintf(uri, sizeof uri, "sim:orbit?seed=%d", seed);
        run(uri, 0, 90, fv_cpu_best(fv_cpu_detect()), r);
        int first = 0;
        while (first < r->frames && !r->pose[first].posed)
            first++;
        assert_true(first < 40);
        assert_true(r->windows > 5 && r->hasty == 0 && r->late_frames < 6);
        double unit =
            travelled(r, first, r->frames - 1, true) / travelled(r, first, r->frames - 1, false);
        for (int n = first + 1; n < r->frames; n++) {
            if (!r->pose[n].posed || r->reference[n] < 0 || r->reference[n] == n) continue;
            double error = squared_error(r, n, unit);
            sum += error;
            count++;
            good += r->pose[n].state == FOVEA_TRACKING_OK;
            false_confidence += r->pose[n].state == FOVEA_TRACKING_OK && error > 22.5;
        }
    }
    printf(
        "%d poses, %d of them called good: normalised squared error %.2f per dimension, falsely confident %d\n",
        count, good, sum / count / 6, false_confidence);
    assert_true(sum / count / 6 > 0.1 && sum / count / 6 < 2);
    assert_true(good > count / 2 && false_confidence <= good / 50);
}

static void turning_on_the_spot_is_no_translation(void **state)
{
    (void)state;
    run("sim:rotate?width=480&height=360", 0, 90, fv_cpu_best(fv_cpu_detect()), &records[0]);
    for (int n = 0; n < records[0].frames; n++)
        assert_true(!records[0].pose[n].posed &&
                    records[0].pose[n].state == FOVEA_TRACKING_STARTING);
}

static void being_carried_off_is_noticed(void **state)
{
    (void)state;
    struct record *r = &records[0];
    run("sim:kidnap?width=480&height=360", 340, 100, fv_cpu_best(fv_cpu_detect()),
        r); /* carried off at 14 s, frame 420 */
    assert_true(r->pose[78].posed);
    for (int n = 85; n < r->frames; n++)
        assert_true(!r->pose[n].posed || r->pose[n].reset_counter > r->pose[78].reset_counter);
}

static void standing_still_neither_drifts_nor_makes_keyframes(void **state)
{
    (void)state;
    struct record *r = &records[0];
    run("sim:stopgo?width=480&height=360", 0, 170, fv_cpu_best(fv_cpu_detect()), r);
    int still = 0, keyframes = 0;
    double moved = 0;
    for (int n = 20; n < r->frames; n++) {
        if (!r->pose[n].posed || !r->pose[n - 20].posed || travelled(r, n - 20, n, true) > 1e-9)
            continue;
        still++;
        keyframes += r->pose[n].keyframes > r->pose[n - 1].keyframes;
        moved = fmax(moved, travelled(r, n - 10, n, false));
    }
    printf("stopgo: %d frames still, largest change over ten frames %.5f of the depth\n", still,
           moved);
    assert_true(still > 20 && keyframes == 0 && moved < 0.01);
}

static void kernel_sets_give_the_same_bits(void **state)
{
    (void)state;
    run("sim:orbit?width=320&height=240", 0, 60, FV_CPU_C, &records[0]);
    run("sim:orbit?width=320&height=240", 0, 60, fv_cpu_best(fv_cpu_detect()), &records[1]);
    assert_true(records[0].pose[59].posed);
    assert_true(records[0].hash == records[1].hash);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_orbit_is_followed_at_constant_scale),
        cmocka_unit_test(few_features_begin_a_map),
        cmocka_unit_test(confidence_is_earned),
        cmocka_unit_test(turning_on_the_spot_is_no_translation),
        cmocka_unit_test(being_carried_off_is_noticed),
        cmocka_unit_test(standing_still_neither_drifts_nor_makes_keyframes),
        cmocka_unit_test(kernel_sets_give_the_same_bits),
    };
    const struct CMUnitTest bits[] = {cmocka_unit_test(kernel_sets_give_the_same_bits)};
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED the simulated trajectories of test_odometry: minutes under an emulator");
        return cmocka_run_group_tests(bits, NULL, NULL);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
