/* Closures and merged maps on a synthetic ring: points with random descriptors, keyframes whose
 * estimated poses drift in place, direction and scale, and see the first points again as new
 * landmarks when they come round. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/carved.h"
#include "geometry/vec.h"
#include "map/closure.h"

enum { RING = 60, KEYFRAMES = 67, POINTS = 5000, FEATURES = 260, REMEMBERED = 6 };

struct world {
    struct fv_kernels kernels;
    struct fovea_camera camera;
    struct fv_bearing_table bearings;
    struct fv_map map;
    struct fv_place place;
    struct fv_closure closure;
    void *memory;
    struct fv_random random;
    double point[POINTS][3];
    uint8_t descriptor[POINTS][32];
    int32_t landmark_of[POINTS]; /* newest */
    uint32_t seen_by[POINTS];    /* number of the keyframe that saw it last */
    struct fv_sim3 drift;        /* takes the true world to the estimated one, now */
    struct fv_se3 truth[KEYFRAMES];
    uint32_t slot[KEYFRAMES];
    uint32_t count;
    bool vague; /* seen is only what lies ahead, in coarse features */
};
static struct world w;
static const double ahead = 0.3; /* half the width and height of what lies ahead, at distance 1 */

static void carve(void *context, struct fv_arena *arena)
{
    (void)context;
    const struct fv_map_limits limits = {80, 16000, FEATURES, 640, 480, false};
    fv_bearing_carve(&w.bearings, limits.width, limits.height, arena);
    fv_map_carve(&w.map, &limits, &w.camera, &w.bearings, arena);
    fv_place_carve(&w.place, limits.keyframes, arena);
    fv_closure_carve(&w.closure, &limits, arena, arena);
}

static double uniform(double low, double high)
{
    return low + (high - low) * fv_random_unit(&w.random);
}

static void make_world(uint64_t seed)
{
    memset(&w, 0, sizeof w);
    struct fovea_error error;
    w.camera = (struct fovea_camera){.width = 640,
                                     .height = 480,
                                     .lens = FOVEA_LENS_RADTAN,
                                     .fx = 400,
                                     .fy = 400,
                                     .cx = 320,
                                     .cy = 240};
    assert_int_equal(fovea_camera_prepare(&w.camera, &error), FOVEA_OK);
    fv_kernels_init(&w.kernels, FV_CPU_C);
    w.memory = carved(carve, NULL);
    fv_bearing_init(&w.bearings, &w.camera);
    fv_map_reset(&w.map);
    fv_place_clear(&w.place);
    fv_closure_reset(&w.closure, seed);
    fv_random_seed(&w.random, seed);
    fv_sim3_identity(&w.drift);
    for (int i = 0; i < POINTS; i++) { /* on both sides of a round corridor of radius 10 */
        double angle = uniform(0, 6.283185),
               radius = uniform(0, 1) < 0.5 ? uniform(8, 9) : uniform(11, 12);
        const double p[3] = {radius * fv_cos(angle), uniform(-1, 1), radius * fv_sin(angle)};
        fv_copy3(p, w.point[i]);
        for (int k = 0; k < 32; k++)
            w.descriptor[i][k] = (uint8_t)fv_random_u32(&w.random);
        w.landmark_of[i] = FV_MAP_NONE;
    }
}

/* The n-th place: on the ring, looking along it. */
static void true_pose(uint32_t n, struct fv_se3 *T_cam_world)
{
    double angle = 6.283185307 * n / RING;
    const double z[3] = {-fv_sin(angle), 0, fv_cos(angle)}, y[3] = {0, -1, 0},
                 centre[3] = {10 * fv_cos(angle), 0, 10 * fv_sin(angle)};
    double x[3], t[3];
    fv_cross3(y, z, x);
    fv_copy3(x, T_cam_world->R);
    fv_copy3(y, T_cam_world->R + 3);
    fv_copy3(z, T_cam_world->R + 6);
    fv_rotate3(T_cam_world->R, centre, t);
    for (int k = 0; k < 3; k++)
        T_cam_world->t[k] = -t[k];
}

/* A feature of point i, with some bits of its descriptor wrong. */
static void fill_feature(struct fovea_feature *feature, uint8_t *descriptor, int i,
                         const double pixel[2])
{
    memset(feature, 0, sizeof *feature);
    feature->x_px = (float)pixel[0];
    feature->y_px = (float)pixel[1];
    feature->level = w.vague ? 7 : 0;
    memcpy(descriptor, w.descriptor[i], 32);
    for (int k = 0; k < 4; k++)
        descriptor[fv_random_below(&w.random, 32)] ^=
            (uint8_t)(1u << fv_random_below(&w.random, 8));
}

/* A keyframe at the next place: what it sees, and its links, in the world as it is estimated there.
 */
static void add_keyframe(void)
{
    const uint32_t n = w.count, current = fv_map_current(&w.map);
    struct fv_map_frame frame = fv_map_frame_at(&w.map, current);
    static int seen[FEATURES];
    static struct fovea_feature features[FEATURES];
    static uint8_t descriptors[FEATURES * 32];
    uint16_t from[FEATURES];
    uint32_t count = 0;
    true_pose(n, &w.truth[n]);
    for (int i = 0; i < POINTS && count < FEATURES; i++) {
        double q[3], pixel[2];
        fv_se3_apply(&w.truth[n], w.point[i], q);
        if (q[2] < 0.7 || q[2] > 6 || fovea_camera_project(&w.camera, q, pixel, 0) != FOVEA_OK ||
            pixel[0] < 0 || pixel[1] < 0 || pixel[0] >= 639 || pixel[1] >= 479)
            continue;
        if (w.vague && (fabs(q[0]) > ahead * q[2] || fabs(q[1]) > ahead * q[2])) continue;
        pixel[0] += 0.3 * fv_random_normal(&w.random);
        pixel[1] += 0.3 * fv_random_normal(&w.random);
        seen[count] = i;
        fill_feature(&features[count], &descriptors[32 * (size_t)count], i, pixel);
        count++;
    }
    fv_map_fill_frame(&w.map, current, features, descriptors, count, from);
    assert_int_equal(frame.keyframe->features, count);
    frame.keyframe->stamp_ns = n;
    frame.keyframe->T_cam_world = w.truth[n];
    frame.keyframe->depth = 3 * w.drift.s;
    fv_sim3_move_pose(&w.drift, &frame.keyframe->T_cam_world);
    uint32_t slot = fv_map_add_keyframe(&w.map, current);
    frame.keyframe->parent = (int32_t)slot;
    for (uint32_t f = 0; f < count; f++) {
        int i = seen[from[f]];
        if (w.landmark_of[i] == FV_MAP_NONE || w.seen_by[i] + REMEMBERED < n) {
            double p[3];
            fv_sim3_apply(&w.drift, w.point[i], p);
            w.landmark_of[i] = fv_map_add_landmark(&w.map, p, n);
        }
        w.seen_by[i] = n;
        (void)fv_map_link(&w.map, (uint32_t)w.landmark_of[i], slot, f);
        fv_map_refresh_landmark(&w.map, (uint32_t)w.landmark_of[i]);
    }
    w.slot[n] = slot;
    w.count++;
    const double x[7] = {0.002, 0.001, -0.002, 0.0003, 0.0015, 0, 0.0015};
    struct fv_sim3 step;
    fv_sim3_exp(x, &step);
    fv_sim3_compose(&w.drift, &step, &w.drift);
}

static void offer(uint32_t n)
{
    static struct fv_place_words words;
    const uint32_t slot = w.slot[n];
    struct fv_map_frame frame = fv_map_frame_at(&w.map, slot);
    fv_place_words_begin(&words);
    fv_place_words_add(&words, &w.kernels, frame.descriptors, frame.keyframe->features);
    fv_place_insert(&w.place, slot, frame.keyframe->generation, &words);
    fv_closure_offer(&w.closure, &w.map, &w.place, &words, slot);
}

static void camera_in_odom(double centre[3])
{
    const double origin[3] = {0, 0, 0};
    struct fv_sim3 S_odom_map;
    fv_se3_apply_inverse(&w.map.keyframes[fv_map_current(&w.map)].T_cam_world, origin, centre);
    fv_sim3_invert(&w.map.state->S_map_world, &S_odom_map);
    fv_sim3_apply(&S_odom_map, centre, centre);
}

/* Finish the work on an offered keyframe, a new keyframe (if `grow`) being born while the graph is
 * solved. True when the map was corrected; the pose in odom must not have noticed. */
static bool work(bool grow)
{
    bool committed = false;
    while (fv_closure_waiting(&w.closure)) {
        struct fv_closure_outcome outcome;
        double before[3], after[3];
        if (grow && w.closure.state->phase == FV_CLOSURE_SOLVE && w.count < KEYFRAMES) {
            w.map.keyframes[fv_map_current(&w.map)].parent = (int32_t)w.slot[w.count - 1];
            add_keyframe();
            grow = false;
        }
        camera_in_odom(before);
        (void)fv_closure_unit(&w.closure, &w.map, &w.kernels, &outcome);
        camera_in_odom(after);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(after[k] - before[k]) < 1e-9);
        committed |= outcome.committed;
    }
    return committed;
}

/* Distance of keyframe a from b as estimated, less the true one. */
static double distance_off(uint32_t a, uint32_t b)
{
    const double origin[3] = {0, 0, 0};
    double p[3], q[3], x[3], y[3], d[3], e[3];
    fv_se3_apply_inverse(&w.map.keyframes[w.slot[a]].T_cam_world, origin, p);
    fv_se3_apply_inverse(&w.map.keyframes[w.slot[b]].T_cam_world, origin, q);
    fv_se3_apply_inverse(&w.truth[a], origin, x);
    fv_se3_apply_inverse(&w.truth[b], origin, y);
    fv_subtract3(p, q, d);
    fv_subtract3(x, y, e);
    return fv_norm3(d) - fv_norm3(e);
}

/* Links from both ends agree, no landmark joins maps. */
static void check_links(void)
{
    for (uint32_t i = 0; i < w.map.limits.landmarks; i++) {
        const struct fv_landmark *l = &w.map.landmarks[i];
        if (!l->used) continue;
        for (uint32_t k = 0; k < l->observer_count; k++) {
            struct fv_map_frame frame = fv_map_frame_at(&w.map, l->observers[k].keyframe);
            assert_true(frame.keyframe->used);
            assert_int_equal(frame.landmark[l->observers[k].feature], i);
            assert_int_equal(frame.keyframe->map_id,
                             w.map.keyframes[l->observers[0].keyframe].map_id);
        }
    }
}

/* The newest keyframe is surer of its unit of length than those behind it will be. */
static void doubt_unit(void)
{
    w.map.keyframes[w.slot[w.count - 1]].unit_variance = (float)w.count;
}

/* Of the keyframes from `first` to `last`, which the closure has corrected, none is less sure of
 * its unit than the surer end, which is the older one; the others are what they were. */
static void check_units(uint32_t first, uint32_t last)
{
    const uint32_t older = w.closure.state->candidates[w.closure.state->candidate].slot;
    const float least = w.map.keyframes[older].unit_variance;
    assert_true(least >= 1 &&
                w.map.keyframes[w.closure.state->keyframe.slot].unit_variance == least);
    for (uint32_t n = 0; n <= last; n++) {
        const float own = (float)(n + 1), now = w.map.keyframes[w.slot[n]].unit_variance;
        assert_true(now == (n >= first && own > least ? least : own));
    }
}

static void test_closes_the_ring(void **context)
{
    (void)context;
    make_world(5);
    bool closed = false;
    while (w.count < RING - 4) {
        add_keyframe();
        doubt_unit();
        offer(w.count - 1);
        assert_false(work(false)); /* nothing has been met again */
    }
    double before = 0;
    while (w.count < KEYFRAMES && !closed) {
        add_keyframe();
        doubt_unit();
        before = distance_off(w.count - 1, 2);
        offer(w.count - 1);
        closed = work(true);
    }
    assert_true(closed);
    assert_int_equal(w.closure.state->counts.closed, 1);
    assert_true(w.count < KEYFRAMES); /* with some keyframes to spare */
    assert_true(w.closure.state->counts.fused > 50);
    check_units(0, w.count - 2);
    assert_true(fabs(before) > 0.5);                 /* it had drifted indeed */
    for (uint32_t n = w.count - 2; n < w.count; n++) /* the last one was born meanwhile */
        if (!(fabs(distance_off(n, 2)) < 0.2))
            fail_msg("keyframe %u of %u is %.3f off, %.3f before", n, w.count, distance_off(n, 2),
                     before);
    uint16_t shared[FV_MAP_KEYFRAMES_MAX];
    fv_map_count_shared(&w.map, w.closure.state->keyframe.slot, shared);
    assert_true(shared[w.closure.state->candidates[w.closure.state->candidate].slot] > 20);
    assert_true(fabs(w.map.state->S_map_world.s - 1) > 0.01);
    check_links();
    free(w.memory);
}

static void test_merges_maps(void **context)
{
    (void)context;
    make_world(6);
    for (int i = 0; i < 15; i++) {
        add_keyframe();
        doubt_unit();
        offer(w.count - 1);
        assert_false(work(false));
    }
    /* Lost, and another map begun in a world of its own, a little further on; it comes round to the
     * first. */
    fv_map_begin_another(&w.map);
    const double x[7] = {3, 1, -2, 0.5, 1, -0.3, 0.6};
    fv_sim3_exp(x, &w.drift);
    memset(w.landmark_of, 0xff, sizeof w.landmark_of);
    w.map.keyframes[fv_map_current(&w.map)].parent = FV_MAP_NONE;
    bool merged = false;
    while (w.count < KEYFRAMES && !merged) {
        add_keyframe();
        doubt_unit();
        offer(w.count - 1);
        merged = work(false);
        check_links();
    }
    assert_true(merged);
    assert_int_equal(w.closure.state->counts.merged, 1);
    check_units(15, w.count - 1);
    assert_int_equal(w.map.state->map_id, w.map.keyframes[w.slot[0]].map_id);
    assert_int_equal(fv_map_count_keyframes(&w.map, w.map.state->map_id),
                     w.map.state->keyframe_count);
    assert_true(w.map.state->odom_id !=
                w.map.state->map_id); /* poses go on in the frame they were in */
    assert_true(fabs(distance_off(w.count - 1, 2)) < 0.2);
    free(w.memory);
}

/* All that meets lies in one direction and is seen coarsely: the place is known again, but where it
 * is to a degree only, and nothing is corrected by that. */
static void test_vague_relation_corrects_nothing(void **context)
{
    (void)context;
    make_world(6);
    w.vague = true;
    while (w.count < KEYFRAMES) {
        add_keyframe();
        offer(w.count - 1);
        assert_false(work(false));
    }
    assert_true(w.closure.state->counts.confirmed > 3);
    assert_true(w.closure.state->counts.implausible > 3);
    free(w.memory);
}

/* Maps that were left are entered again with the odom frame that they had. */
static void test_odom_of_maps(void **context)
{
    (void)context;
    make_world(7);
    struct fv_map_state *s = w.map.state;
    const uint32_t first = s->map_id;
    s->S_map_world.s = 1.5;
    fv_map_begin_another(&w.map);
    assert_true(s->S_map_world.s == 1 && s->odom_id == s->map_id && s->map_id != first);
    const uint32_t second = s->map_id;
    fv_map_enter(&w.map, first);
    assert_true(s->S_map_world.s == 1.5);
    assert_int_equal(s->odom_id, first);
    for (int i = 0; i < FV_MAP_WORLDS_MAX + 1; i++)
        fv_map_begin_another(&w.map);
    fv_map_enter(&w.map, second); /* too long ago: a frame of its own */
    assert_true(s->odom_id != second && s->S_map_world.s == 1);
    free(w.memory);
}

/* A full pool gives up what is most redundant, never the newest; landmarks unseen for long make
 * room first.
 */
static void test_full_pools(void **context)
{
    (void)context;
    make_world(8);
    for (int i = 0; i < 30; i++)
        add_keyframe();
    for (uint32_t k = 0; k < 30; k++)
        fv_map_rate_keyframe(&w.map, w.slot[k]);
    uint32_t goes = fv_map_most_redundant(&w.map);
    for (uint32_t k = 0; k < 30; k++) {
        const struct fv_keyframe *keyframe = &w.map.keyframes[w.slot[k]];
        bool newest = keyframe->number + FV_MAP_KEEP_NEWEST >= w.map.state->keyframe_number;
        assert_true(newest || keyframe->redundancy <= w.map.keyframes[goes].redundancy);
        assert_false(newest && w.slot[k] == goes);
    }
    uint32_t keyframes = w.map.state->keyframe_count, wanted = w.map.state->free_count + 500;
    fv_map_make_room(&w.map, wanted, 1000); /* all unseen for long: the thinnest go */
    assert_true(w.map.state->free_count >= wanted);
    assert_int_equal(w.map.state->keyframe_count, keyframes);
    check_links();
    fv_map_make_room(&w.map, w.map.limits.landmarks,
                     30); /* none may go by age: keyframes do, but two stay */
    assert_int_equal(w.map.state->keyframe_count, 2);
    check_links();
    free(w.memory);
}

/* A correction by a turn, a factor and a shift as seen from the last keyframe. */
static bool plausible(uint32_t since, double turn_rad, double factor, double shift)
{
    const double origin[3] = {0, 0, 0}, axis[3] = {0, turn_rad, 0};
    const uint32_t last = w.slot[w.count - 1];
    double centre[3], moved[3];
    struct fv_sim3 S;
    fv_se3_apply_inverse(&w.map.keyframes[last].T_cam_world, origin, centre);
    fv_sim3_identity(&S);
    fv_so3_exp(axis, S.R);
    S.s = factor;
    fv_sim3_apply(&S, centre, moved);
    fv_subtract3(centre, moved, S.t);
    S.t[1] += shift;
    return fv_closure_plausible(&w.map, last, w.slot[since], &S);
}

/* Drift is a fraction of the way, 41 in 39 steps of the ring, and some of the depth, 3. */
static void test_no_larger_than_drift(void **state)
{
    (void)state;
    make_world(9);
    for (int n = 0; n < 40; n++)
        add_keyframe();
    assert_true(plausible(0, 0, 1, 0) && plausible(0, 0.5, 1.9, 4));
    assert_true(plausible(0, 0, 1, 4.7) && !plausible(0, 0, 1, 5.8));
    assert_true(plausible(37, 0, 1, 1) &&
                !plausible(37, 0, 1, 1.3)); /* a short way, a small correction */
    assert_true(!plausible(0, 0.7, 1, 0) && !plausible(0, -0.7, 1, 0));
    assert_true(!plausible(0, 0, 2.2, 0) && !plausible(0, 0, 1 / 2.2, 0));
    w.map.keyframes[w.slot[0]].map_id =
        1; /* another map lies anywhere, and has a unit of its own */
    assert_true(plausible(0, 3, 40, 1000) && plausible(0, 3, 1.0 / 40, 1000));
    assert_true(!plausible(0, 0, 60, 0) && !plausible(0, 0, 1.0 / 60, 0));
    free(w.memory);
}

/* A ray's direction is known to a pixel over the focal length; the distance, to that over all the
 * parallax. */
static void test_certainty_of_distances(void **state)
{
    (void)state;
    const double A[6] = {400, 0, 0, 0, 400, 0};
    struct fv_landmark l = {.spread = 0.1F, .observer_count = 4};
    assert_true(fabs(fv_closure_distance_sigma(&l, A, 1) - sqrt(1e-4 + 1 / 6400.0)) < 1e-6);
    assert_true(fabs(fv_closure_distance_sigma(&l, A, 0.25) - sqrt(1e-4 + 4 / 6400.0)) < 1e-6);
    l.spread = 1;
    assert_true(fabs(fv_closure_distance_sigma(&l, A, 1) - 0.01) < 1e-3);
    l.spread = 0;
    assert_true(fabs(fv_closure_distance_sigma(&l, A, 1) - 1) < 1e-3);

    make_world(5);
    add_keyframe();
    add_keyframe();
    const struct fv_map_frame frame = fv_map_frame_at(&w.map, w.slot[0]);
    struct fv_correspondence m;
    uint32_t feature = 0;
    memset(&m, 0, sizeof m);
    while (frame.landmark[feature] == FV_MAP_NONE)
        feature++;
    fv_closure_side_a(&w.map, &frame, feature, &m);
    fv_closure_side_b(&w.map, &frame, feature, &m);
    assert_true(m.sigma_a >= 0.01 && m.sigma_a == m.sigma_b && m.weight_a > 0 &&
                m.weight_a == m.weight_b);
    assert_memory_equal(m.point_a, m.point_b, sizeof m.point_a);
    assert_memory_equal(m.bearing_a, m.bearing_b, sizeof m.bearing_a);
    assert_memory_equal(m.A_a, m.A_b, sizeof m.A_a);
    free(w.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closes_the_ring),
        cmocka_unit_test(test_merges_maps),
        cmocka_unit_test(test_vague_relation_corrects_nothing),
        cmocka_unit_test(test_odom_of_maps),
        cmocka_unit_test(test_full_pools),
        cmocka_unit_test(test_no_larger_than_drift),
        cmocka_unit_test(test_certainty_of_distances),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
