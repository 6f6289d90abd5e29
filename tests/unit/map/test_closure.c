/* Closures and merged maps on the ring. */
#include "common/closure_ring.h"

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
