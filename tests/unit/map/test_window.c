/* Window optimisation on a synthetic map: noise on poses, points and pixels must shrink to what the
 * pixels allow. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "fovea/camera.h"
#include "base/elementary.h"
#include "geometry/vec.h"
#include "map/window.h"

enum { VIEWS = 8, POINTS = 400, WINDOW = 5 };

struct fixture {
    struct fv_map map;
    struct fv_window window;
    struct fv_turns turns;
    struct fovea_camera camera;
    struct fv_bearing_table bearings;
    struct fv_se3 truth[VIEWS];
    double points[POINTS][3];
    uint32_t landmark[POINTS];
    void *memory;
};

static double uniform(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

static void carve(void *context, struct fv_arena *arena)
{
    struct fixture *f = context;
    const struct fv_map_limits limits = {VIEWS + 2, 1000, POINTS, 752, 480, false};
    const struct fv_window_limits window = {WINDOW, 600, 5000, 8, 1e-4};
    fv_bearing_carve(&f->bearings, limits.width, limits.height, arena);
    fv_map_carve(&f->map, &limits, &f->camera, &f->bearings, arena);
    fv_window_carve(&f->window, &window, &f->map, true, arena);
}

/* What a gyro with this bias, of which the samples are not rid, measured between the keyframes:
 * .3 s each. */
static void measure_turns(struct fixture *f, const double bias[3], double bias_sigma)
{
    const struct fv_gyro_known known = {{0, 0, 0}, bias_sigma, {{0}, 0, 0}, 0};
    memset(&f->turns, 0, sizeof f->turns);
    for (int v = 0; v < VIEWS; v++) {
        struct fv_turn turn;
        fv_turn_begin(&turn, known.bias);
        for (int i = 0; i < 3; i++)
            turn.by_bias[4 * i] = -0.3;
        turn.variance = 1e-10;
        turn.time_s = 0.3;
        if (v > 0) {
            double between[9], drifted[3], E[9];
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++)
                    between[3 * r + c] = fv_dot3(f->truth[v - 1].R + 3 * r, f->truth[v].R + 3 * c);
            for (int i = 0; i < 3; i++)
                drifted[i] = 0.3 * bias[i];
            fv_so3_exp(drifted, E);
            fv_multiply33(between, E, turn.R);
        }
        fv_turns_follow(&f->turns, v > 0 ? &turn : NULL, &known);
        fv_turns_keyframe(&f->turns, f->map.keyframes[v].number);
    }
    f->window.turns = &f->turns;
}

/* A row of frames that look at a cloud; the first `exact` poses and no points are exact. */
static void build(struct fixture *f, uint64_t seed, double pose_noise, double point_noise,
                  double pixel_noise, double outliers, int exact)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    const struct fovea_camera camera = {
        752,     480,     FOVEA_LENS_RADTAN, 458.654,
        457.296, 367.215, 248.375,           {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
        0};
    memset(f, 0, sizeof *f);
    f->camera = camera;
    assert_int_equal(fovea_camera_prepare(&f->camera, NULL), FOVEA_OK);
    f->memory = carved(carve, f);
    fv_bearing_init(&f->bearings, &f->camera);
    fv_map_reset(&f->map);
    for (int i = 0; i < POINTS; i++) {
        f->points[i][0] = uniform(&random, -5, 11);
        f->points[i][1] = uniform(&random, -3, 3);
        f->points[i][2] = uniform(&random, 4, 9);
        double start[3];
        for (int k = 0; k < 3; k++)
            start[k] = f->points[i][k] + point_noise * fv_random_normal(&random);
        f->landmark[i] = (uint32_t)fv_map_add_landmark(&f->map, start, 0);
    }
    for (int v = 0; v < VIEWS; v++) {
        double turn[3] = {uniform(&random, -.05, .05), uniform(&random, -.05, .05),
                          uniform(&random, -.05, .05)};
        fv_so3_exp(turn, f->truth[v].R);
        f->truth[v].t[0] = -0.8 * v;
        f->truth[v].t[1] = uniform(&random, -.1, .1);
        f->truth[v].t[2] = uniform(&random, -.1, .1);
        struct fv_map_frame frame = fv_map_frame_at(&f->map, fv_map_current(&f->map));
        static const uint8_t descriptors[POINTS * FV_MAP_DESCRIPTOR_BYTES];
        struct fovea_feature features[POINTS] = {{0}};
        uint16_t from[POINTS];
        uint32_t seen[POINTS], count = 0;
        for (uint32_t i = 0; i < POINTS; i++) {
            double q[3], pixel[2];
            fv_se3_apply(&f->truth[v], f->points[i], q);
            if (fovea_camera_project(&f->camera, q, pixel, NULL) != FOVEA_OK) continue;
            if (uniform(&random, 0, 1) < outliers) pixel[0] += uniform(&random, -60, 60);
            for (int k = 0; k < 2; k++)
                pixel[k] += pixel_noise * fv_random_normal(&random);
            if (pixel[0] < 0 || pixel[1] < 0 || pixel[0] > 751 || pixel[1] > 479) continue;
            features[count].x_px = (float)pixel[0];
            features[count].y_px = (float)pixel[1];
            seen[count++] = i;
        }
        fv_map_fill_frame(&f->map, fv_map_current(&f->map), features, descriptors, count, from);
        frame.keyframe->T_cam_world = f->truth[v];
        frame.keyframe->parent = v > 0 ? v - 1 : FV_MAP_NONE;
        double step[6];
        for (int k = 0; k < 6; k++)
            step[k] = v < exact ? 0 : pose_noise * fv_random_normal(&random) * (k < 3 ? 1 : 0.2);
        fv_se3_move(&frame.keyframe->T_cam_world, step);
        uint32_t slot = fv_map_add_keyframe(&f->map, fv_map_current(&f->map));
        for (uint32_t k = 0; k < frame.keyframe->features; k++)
            assert_true(fv_map_link(&f->map, f->landmark[seen[from[k]]], slot, k));
    }
}

static void destroy(struct fixture *f)
{
    free(f->memory);
}

static double pose_error(const struct fixture *f, int first, int last)
{
    double worst = 0;
    for (int v = first; v <= last; v++) {
        struct fv_se3 inverse, D;
        fv_se3_invert(&f->map.keyframes[v].T_cam_world, &inverse);
        fv_se3_compose(&f->truth[v], &inverse, &D);
        worst = fmax(worst, fv_norm3(D.t));
    }
    return worst;
}

/* The worst error of the turn from a keyframe to the next, from `first` on. */
static double turn_error(const struct fixture *f, int first)
{
    double worst = 0;
    for (int v = first; v < VIEWS; v++) {
        double between[9], E[9], D[9], e[3];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) {
                between[3 * r + c] = fv_dot3(f->map.keyframes[v].T_cam_world.R + 3 * r,
                                             f->map.keyframes[v - 1].T_cam_world.R + 3 * c);
                E[3 * r + c] = fv_dot3(f->truth[v].R + 3 * r, f->truth[v - 1].R + 3 * c);
            }
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) {
                double sum = 0;
                for (int k = 0; k < 3; k++)
                    sum += between[3 * r + k] * E[3 * c + k];
                D[3 * r + c] = sum;
            }
        fv_so3_log(D, e);
        worst = fmax(worst, fv_norm3(e));
    }
    return worst;
}

static double median_point_error(const struct fixture *f)
{
    double low = 0, high = 10;
    for (int step = 0; step < 50; step++) {
        double middle = 0.5 * (low + high);
        int below = 0, all = 0;
        for (int i = 0; i < POINTS; i++) {
            const struct fv_landmark *l = &f->map.landmarks[f->landmark[i]];
            if (!l->used || l->observer_count < 4) continue;
            double d[3];
            fv_subtract3(l->point, f->points[i], d);
            all++;
            below += fv_norm3(d) < middle;
        }
        *(2 * below > all ? &high : &low) = middle;
    }
    return low;
}

static struct fv_window_result run(struct fixture *f, uint32_t newest, int *units)
{
    assert_true(fv_window_start(&f->window, &f->map, newest));
    *units = 1;
    while (fv_window_unit(&f->window))
        assert_true(++*units < 500);
    return fv_window_commit(&f->window, &f->map);
}

static void exact_pixels_give_the_truth(void **state)
{
    (void)state;
    struct fixture f;
    build(&f, 51, 0.03, 0.1, 0, 0, 3); /* the three outside the window are exact and hold it */
    int units;
    struct fv_window_result result = run(&f, VIEWS - 1, &units);
    printf("units %d, cost %.3g to %.3g, pose %.2e, point %.2e\n", units, result.cost_at_start,
           result.cost, pose_error(&f, 3, 7), median_point_error(&f));
    assert_int_equal(result.moved_keyframes, WINDOW);
    assert_true(result.cost < 1e-3 * result.cost_at_start);
    assert_true(pose_error(&f, 3, 7) < 1e-4 && median_point_error(&f) < 1e-3);
    destroy(&f);
}

static void noise_and_outliers_are_borne(void **state)
{
    (void)state;
    struct fixture f;
    build(&f, 52, 0.02, 0.05, 0.7, 0.05, 3);
    int units;
    struct fv_window_result result = run(&f, VIEWS - 1, &units);
    printf("units %d, cost %.0f to %.0f, dropped %u, pose %.4f, point %.4f\n", units,
           result.cost_at_start, result.cost, result.dropped_observations, pose_error(&f, 3, 7),
           median_point_error(&f));
    assert_true(pose_error(&f, 3, 7) < 0.03 && median_point_error(&f) < 0.05);
    assert_in_range(result.dropped_observations, 40, 260);
    destroy(&f);
}

/* What happened to the map since the start of the job: a landmark gone, another born on a moved
 * keyframe. */
static void commit_respects_what_changed(void **state)
{
    (void)state;
    struct fixture f;
    build(&f, 53, 0.03, 0.1, 0.3, 0, 3);
    assert_true(fv_window_start(&f.window, &f.map, VIEWS - 1));
    while (fv_window_unit(&f.window))
        ;
    fv_map_remove_landmark(&f.map, f.landmark[7]);
    const double place[3] = {1, 2, 3};
    int32_t reused = fv_map_add_landmark(&f.map, place, 1);
    assert_int_equal(reused, f.landmark[7]); /* same slot, new generation */
    struct fv_map_frame frame = fv_map_frame_at(&f.map, VIEWS - 1);
    uint32_t feature = 0;
    while (frame.landmark[feature] != FV_MAP_NONE)
        feature++;
    assert_true(fv_map_link(&f.map, (uint32_t)reused, VIEWS - 1, feature));
    struct fv_se3 before = f.map.keyframes[VIEWS - 1].T_cam_world;
    double seen_before[3], seen_after[3];
    fv_se3_apply(&before, place, seen_before);
    (void)fv_window_commit(&f.window, &f.map);
    fv_se3_apply(&f.map.keyframes[VIEWS - 1].T_cam_world, f.map.landmarks[reused].point,
                 seen_after);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(seen_before[k] - seen_after[k]) < 1e-9); /* it moved with its keyframe */
    assert_true(memcmp(&before, &f.map.keyframes[VIEWS - 1].T_cam_world, sizeof before) != 0);
    destroy(&f);
}

/* Turns that a gyro measured hold the turns between keyframes, from the one before the window on,
 * and its bias is found with them. */
static void a_gyro_holds_the_turns(void **state)
{
    (void)state;
    const double bias[3] = {4e-3, -2e-3, 3e-3};
    struct fixture f;
    int units;
    build(&f, 54, 0.005, 0.05, 0.7, 0, 3);
    (void)run(&f, VIEWS - 1, &units);
    const double alone = turn_error(&f, 3);
    destroy(&f);
    build(&f, 54, 0.005, 0.05, 0.7, 0, 3);
    measure_turns(&f, bias, 1e-2);
    assert_true(fv_window_start(&f.window, &f.map, VIEWS - 1));
    assert_int_equal(f.window.gyro->count, WINDOW);
    while (fv_window_unit(&f.window))
        ;
    const struct fv_window_gyro *gyro = f.window.gyro;
    double off[3];
    fv_subtract3(gyro->bias, bias, off);
    (void)fv_window_commit(&f.window, &f.map);
    printf("turns off by %.2e alone, %.2e with a gyro, its bias by %.2e of %.2e\n", alone,
           turn_error(&f, 3), fv_norm3(off), fv_norm3(bias));
    assert_true(turn_error(&f, 3) < 0.4 * alone);
    assert_true(fv_norm3(off) < 0.15 * fv_norm3(bias));
    destroy(&f);
}

/* A turn that is wrong by 3 degrees is left out, one by half a degree pulls little. */
static void a_wrong_turn_is_borne(void **state)
{
    (void)state;
    static const double wrong[3] = {0, 0.05, 0.007}, none[3] = {0, 0, 0};
    double errors[3];
    for (int i = 0; i < 3; i++) {
        struct fixture f;
        const double by[3] = {0, wrong[i], 0};
        double E[9], R[9];
        int units;
        build(&f, 55, 0.003, 0.05, 0.7, 0, 3);
        measure_turns(&f, none, 1e-4);
        struct fv_turn *turn = &f.turns.links[5].turn;
        fv_so3_exp(by, E);
        fv_multiply33(turn->R, E, R);
        memcpy(turn->R, R, sizeof R);
        turn->variance = 4e-8;
        (void)run(&f, VIEWS - 1, &units);
        if (i == 1) assert_int_equal(f.window.gyro->count, WINDOW - 1);
        turn->time_s = 11; /* by then its bias has walked */
        assert_true(fv_window_start(&f.window, &f.map, VIEWS - 1));
        assert_int_equal(f.window.gyro->count, WINDOW - 1);
        errors[i] = turn_error(&f, 3);
        destroy(&f);
    }
    printf("turns off by %.2e, %.2e with one 50 mrad wrong, %.2e with one 7 mrad wrong\n",
           errors[0], errors[1], errors[2]);
    assert_true(errors[1] < 1.5e-3);
    assert_true(errors[2] < 0.75 * wrong[2]);
}

/* The gradient of the turns' cost, by difference, where keyframes turn far from each other. */
static void gradients_are_those_of_the_cost(void **state)
{
    (void)state;
    const double bias[3] = {2e-3, -1e-3, 3e-3};
    struct fixture f;
    struct fv_random random;
    build(&f, 57, 0.003, 0.05, 0.7, 0, 3);
    fv_random_seed(&random, 5);
    measure_turns(&f, bias, 1e-9); /* the bias stays */
    assert_true(fv_window_start(&f.window, &f.map, VIEWS - 1));
    struct fv_window_state *s = f.window.state;
    struct fv_window_gyro *gyro = f.window.gyro;
    assert_int_equal(gyro->count, WINDOW);
    for (uint32_t i = 0; i < s->pose_count; i++) {
        const double by[3] = {uniform(&random, -1, 1), uniform(&random, -1, 1),
                              uniform(&random, -1, 1)};
        fv_so3_exp(by, s->poses[i].T_cam_world.R);
    }
    for (uint64_t k = 0; k < gyro->count; k++) {
        const double *Ra = s->poses[gyro->turns[k].a].T_cam_world.R,
                     *Rb = s->poses[gyro->turns[k].b].T_cam_world.R;
        double between[9], E[9], off[3];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                between[3 * r + c] = fv_dot3(Ra + 3 * r, Rb + 3 * c);
        for (int i = 0; i < 3; i++)
            off[i] = uniform(&random, -1e-5, 1e-5);
        fv_so3_exp(off, E);
        fv_multiply33(between, E, gyro->turns[k].turn.R);
        gyro->turns[k].weight = 1e8;
    }
    s->damping = 0;
    for (uint32_t p = 0; p < s->pose_count; p++) {
        if (s->poses[p].column < 0) continue;
        for (int i = 3; i < 6; i++) {
            const struct fv_se3 before = s->poses[p].T_cam_world;
            double cost[2], step[6] = {0};
            for (int side = 0; side < 2; side++) {
                step[i] = side == 0 ? -1e-6 : 1e-6;
                s->poses[p].T_cam_world = before;
                fv_se3_move(&s->poses[p].T_cam_world, step);
                cost[side] = fv_window_add_turns(&f.window);
            }
            s->poses[p].T_cam_world = before;
            memset(s->gradient, 0, sizeof s->gradient);
            (void)fv_window_add_turns(&f.window);
            const double slope = (cost[1] - cost[0]) / 2e-6,
                         stated = -2 * s->gradient[s->poses[p].column + i];
            assert_true(fabs(slope - stated) < 1e-2 * (fabs(stated) + 100));
        }
    }
    /* and by the bias, of which something is known */
    gyro->weight = 1e6;
    for (int i = 0; i < 3; i++) {
        double cost[2];
        fv_copy3(bias, gyro->bias);
        for (int side = 0; side < 2; side++) {
            gyro->bias[i] = bias[i] + (side == 0 ? -1e-6 : 1e-6);
            cost[side] = fv_window_add_turns(&f.window);
        }
        gyro->bias[i] = bias[i];
        (void)fv_window_add_turns(&f.window);
        const double slope = (cost[1] - cost[0]) / 2e-6, stated = -2 * gyro->gradient[i];
        assert_true(fabs(stated) > 1000 && fabs(slope - stated) < 1e-2 * fabs(stated));
    }
    destroy(&f);
}

/* Without measured turns the result has the bits of a window that has no gyro. */
static void no_turns_change_nothing(void **state)
{
    (void)state;
    struct fixture f;
    struct fv_se3 poses[2][VIEWS];
    int units;
    for (int gyro = 0; gyro < 2; gyro++) {
        build(&f, 56, 0.02, 0.05, 0.7, 0, 3);
        if (gyro == 0) f.window.gyro = NULL;
        if (gyro == 1) f.window.turns = &f.turns; /* of which none is known */
        (void)run(&f, VIEWS - 1, &units);
        for (int v = 0; v < VIEWS; v++)
            poses[gyro][v] = f.map.keyframes[v].T_cam_world;
        destroy(&f);
    }
    assert_memory_equal(poses[0], poses[1], sizeof poses[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_gyro_holds_the_turns),
        cmocka_unit_test(a_wrong_turn_is_borne),
        cmocka_unit_test(gradients_are_those_of_the_cost),
        cmocka_unit_test(no_turns_change_nothing),
        cmocka_unit_test(exact_pixels_give_the_truth),
        cmocka_unit_test(noise_and_outliers_are_borne),
        cmocka_unit_test(commit_respects_what_changed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
